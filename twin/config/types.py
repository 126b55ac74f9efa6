"""Names, limits and markers that the settings of several verbs share."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

Signal = Literal["steps", "staircase", "chirp", "prbs", "multisine", "triangle", "dog-leg"]
Programme = Literal["hold", "step", "doublet", "pitch-over", "point"]
Seat = Literal["linkage", "transfer-function"]
Kind = Literal["emulator", "firmware"]
OnFault = Literal["end", "neutral", "ignore"]
Integrator = Literal["implicitfast", "euler", "rk4", "ab1", "ab2", "ab3", "ab4"]
Axis = Literal["x", "y", "both"]

TURNTABLE, TRANSFER_FUNCTION = "turntable", "transfer-function"
SMALLEST_DT = 1e-6  # s; a thousandth of the usual step, far below every time constant of the models
# s; at 8 ms the rail of the ramp is no longer stable, at 4 ms rods open by a third of a millimetre
LARGEST_DT = 0.005
LONGEST_FLIGHT = 36_000.0  # s
LARGEST_SEED = 2**53 - 1  # whole numbers that a model's numerics hold exactly
LARGEST_UNIT = 2**32 - 1


@dataclass(frozen=True, slots=True)
class Range:
    """Limits of a number, for `Annotated[float, Range(...)]`.

    Attributes
    ----------
    low, high : smallest and largest allowed value
    unit : of both, for the message
    size : whether the limits apply to the absolute value
    """

    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    size: bool = False

    def __contains__(self, value: float) -> bool:
        """Whether a number lies within the limits."""
        return self.low <= (abs(value) if self.size else value) <= self.high

    def __str__(self) -> str:
        """Both limits in words."""
        unit = f" {self.unit}" if self.unit else ""
        what = "a magnitude " if self.size else ""
        if math.isinf(self.high):
            return f"{what}at least {self.low:g}{unit}"
        if math.isinf(self.low):
            return f"{what}at most {self.high:g}{unit}"
        high = int(self.high) if float(self.high).is_integer() else self.high
        return f"{what}from {self.low:g} to {high}{unit}"


class Marker:
    """How a setting appears on the command line; see `twin.cli.arguments`."""


POSITIONAL: Final = Marker()
REPEATABLE: Final = Marker()
FLAG: Final = Marker()

Flag = Annotated[bool, FLAG]
"""True where the flag is given; there is no `--no-flag`."""
Texts = Annotated[tuple[str, ...], REPEATABLE]
Overrides = Annotated[tuple[tuple[str, float], ...], REPEATABLE]
"""Named parameters and their values; also accepted as `NAME=VALUE` texts or as a mapping."""
GivenOverrides = Overrides | Mapping[str, float] | Sequence[str]

Seed = Annotated[int, Range(0, LARGEST_SEED)]
Unit = Annotated[int, Range(0, LARGEST_UNIT)]
Port = Annotated[int, Range(0, 65535)]
Step = Annotated[float, Range(SMALLEST_DT, LARGEST_DT, "s")]
Frequency = Annotated[float, Range(0.1, 1e5, "Hz")]
Duration = Annotated[float, Range(1e-3, LONGEST_FLIGHT, "s")]
Count = Annotated[int, Range(1, 1000)]
Degrees = Annotated[float, Range(1e-3, 180.0, "°", size=True)]
