"""What bounds a servo, step by step: dead band and rate limit before it, backlash behind it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.array import Array
from analysis.transfer_function.file import ModelFileError

Structure = Literal["command", "speed", "clipped", "set-point"]
STRUCTURES: tuple[Structure, ...] = ("command", "speed", "clipped", "set-point")


@dataclass(frozen=True, slots=True)
class Servo:
    """What bounds a real servo; zero switches a part off.

    `structure` says where. `command`: dead band and rate limit on the command, then delay and
    transfer function, then backlash on the output. `speed`: the servo's own loop saturates, after
    the delay (see `analysis.transfer_function.speed`), then backlash; its channels must be of first
    or second order without zeros. `clipped`: as `speed`, but the speed itself is clipped, not what
    the loop aims at. `set-point`: as `speed`, behind a set point of bounded speed, with a limit
    each way. The channels of these two must be of second order.

    Attributes
    ----------
    rate_limit : fastest change of the position aimed at, ahead of the gain [rad/s]; upward with
        `set-point`
    rate_limit_back, slew : of `set-point`, ahead of the gain: fastest speed downward, and of the
        set point [rad/s]
    dead_band : commands closer than this to the one held are ignored, half width [rad]
    backlash : total play between drive and output [rad]
    """

    rate_limit: float = 0.0
    dead_band: float = 0.0
    backlash: float = 0.0
    structure: Structure = "command"
    rate_limit_back: float = 0.0
    slew: float = 0.0

    def __post_init__(self) -> None:
        for name in ("rate_limit", "dead_band", "backlash", "rate_limit_back", "slew"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ModelFileError(f"{name} is {value:g}; it must be finite and ≥ 0")
        if self.structure not in STRUCTURES:
            raise ModelFileError(
                f"structure is {self.structure!r}; there are {', '.join(STRUCTURES)}"
            )

    @property
    def limits(self) -> tuple[float, float, float]:
        """Fastest speed up, down, and of the set point [rad/s]; infinite where it is off."""
        up = self.rate_limit or np.inf
        return up, self.rate_limit_back or up, self.slew or np.inf


def shaped_commands(commands: Array, dt: float, rate_limit: float, dead_band: float) -> Array:
    """Commands (n, k) as they reach the linear part [rad].

    A rate-limited command is a ramp; each step carries the ramp's mean over that step, so that the
    held value leaves the linear part where the ramp would to second order in `dt`.
    """
    held, reached = np.zeros(commands.shape[1]), np.zeros(commands.shape[1])
    out = np.empty_like(commands)
    for k, command in enumerate(commands):
        held = np.where(np.abs(command - held) > dead_band, command, held)
        if rate_limit == 0.0:
            out[k] = held
            continue
        missing = held - reached
        reach = rate_limit * dt
        arrived = np.abs(missing) <= reach
        short = np.sign(missing) * reach
        mean = np.where(
            arrived, held - missing * np.abs(missing) / (2.0 * reach), reached + 0.5 * short
        )
        reached = np.where(arrived, held, reached + short)
        out[k] = mean
    return out


def play(drive: Array, backlash: float) -> Array:
    """Output (n, k) behind play of total width `backlash` [rad] that starts centred."""
    if backlash == 0.0:
        return drive
    out = np.empty_like(drive)
    z = np.zeros(drive.shape[1])
    for k, y in enumerate(drive):
        z = np.clip(z, y - 0.5 * backlash, y + 0.5 * backlash)
        out[k] = z
    return out


def speed_loop(num: Sequence[float], den: Sequence[float]) -> tuple[float, float, float]:
    """Gain, k [1/s] and w [1/s] of a speed-bounded servo whose linear motion is num/den.

    k·w/(s² + w·s + k·w) times the gain, or k/(s + k) with w = 0.

    Raises
    ------
    ModelFileError : the channel has another form
    """
    a = [c / den[0] for c in den]
    if len(num) != 1 or len(a) not in (2, 3) or min(a) <= 0.0:
        raise ModelFileError(
            "a servo whose own speed is bounded has stable channels of first or second"
            f" order without zeros, not of {len(num) - 1} zeros and {len(a) - 1} poles"
        )
    gain = num[0] / den[0] / a[-1]
    return (gain, a[1], 0.0) if len(a) == 2 else (gain, a[2] / a[1], a[1])
