"""Names, limits and checks that several commands share."""

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from twin.errors import TwinError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Signal = Literal["steps", "staircase", "chirp", "prbs", "multisine", "triangle", "dog-leg"]
Programme = Literal["hold", "step", "doublet", "pitch-over", "point"]
Seat = Literal["linkage", "transfer-function"]
Kind = Literal["emulator", "firmware"]
OnFault = Literal["end", "neutral", "ignore"]
Integrator = Literal["implicitfast", "euler", "rk4", "ab1", "ab2", "ab3", "ab4"]
# s; at 8 ms the rail of the ramp is no longer stable, and rods gape by a third of a millimetre at 4
LARGEST_DT = 0.005
LONGEST_FLIGHT = 36_000.0  # s
LARGEST_SEED = 2**53  # whole numbers that a model's numerics hold exactly
TURNTABLE, TRANSFER_FUNCTION = "turntable", "transfer-function"
Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]  # --json, and no --no-json


def refuse_no_number(config: "DataclassInstance") -> None:
    """Refuse a NaN or an infinity in any field.

    Raises
    ------
    TwinError : the flag and its value
    """
    for name, value in asdict(config).items():
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and not math.isfinite(number):
                raise TwinError(f"--{name.replace('_', '-')} {number}: must be finite")
