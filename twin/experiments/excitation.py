"""Test signals for a gimbal: one description, evaluated at the control ticks of any gimbal.

Every signal is a list of levels held from tick to tick, so the same description commands servos in
MuJoCo, an identified model and a rig on a line, and the recording holds the commands of each.

A rig applies commands when its next pulse frame begins, 50 times a second, so a command waits 0 to
20 ms. Levels held for a multiple of the frame would all wait equally long, and a delay
identified from them would be that of one phase. Changes are therefore spread evenly over the phases
of a frame: the identified delay is the mean, and repeats of one step have different waits.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.config import Signal
from twin.errors import TwinError
from twin.experiments import waveforms
from twin.experiments.waveforms import frame_of, ticks_of

Array = NDArray[np.float64]

Axis = Literal["x", "y", "both"]

LONGEST = 3600.0  # s of one test


@dataclass(frozen=True)
class Excitation:
    """One test signal.

    Attributes
    ----------
    signal : kind of signal
    amplitude : largest angle either way from zero [rad]; `twin step` compares it with the stops
    axis : axis excited; `both` takes one after the other
    repeats : steps per direction, with one of half the size after every three; periods; sweeps
    hold : rest before and after, and at least between steps [s]; each is up to a pulse frame
        longer, to spread them over its phases
    duration : of one sweep of a chirp, one period of triangle or dog-leg [s]
    band : lowest and highest frequency of chirp, prbs and multisine [Hz]
    smallest : last step of a staircase [rad]
    rate_limit : fastest the command may change [rad/s]; None leaves jumps as they are
    seed : of the random signals' phases, and of the phases of the pulse frame

    Raises
    ------
    TwinError : a value out of range, with its flag
    """

    signal: Signal = "steps"
    amplitude: float = math.radians(5.0)
    axis: Axis = "both"
    repeats: int = 3
    hold: float = 0.8
    duration: float = 20.0
    band: tuple[float, float] = (0.2, 10.0)
    smallest: float = math.radians(0.05)
    rate_limit: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.signal not in get_args(Signal):
            valid = ", ".join(get_args(Signal))
            raise TwinError(f"--signal {self.signal}: must be one of {valid}")
        if not self.amplitude > 0:
            raise TwinError(
                f"--amplitude-deg {math.degrees(self.amplitude):g}: must be greater than zero"
            )
        if not 0.01 <= self.hold <= 100:
            raise TwinError(f"--hold-s {self.hold:g}: must lie in 0.01 to 100")
        if not 1 <= self.repeats <= 10_000:
            raise TwinError(f"--repeats {self.repeats}: must lie in 1 to 10000")
        if not 0.1 <= self.duration <= 600:
            raise TwinError(f"--duration-s {self.duration:g}: must lie in 0.1 to 600")
        low, high = self.band
        if not 0.01 <= low < high <= 1000:
            raise TwinError(
                f"--band-hz {low:g} {high:g}: the lower frequency first, from 0.01 to 1000"
            )
        least = 1e-3 * self.amplitude
        if self.signal == "staircase" and not least <= self.smallest <= self.amplitude:
            raise TwinError(
                f"--smallest-deg {math.degrees(self.smallest):g}: must lie between a thousandth of"
                f" the amplitude and the amplitude, {math.degrees(self.amplitude):g}"
            )
        if self.rate_limit is not None and not self.rate_limit > 0:
            limit = math.degrees(self.rate_limit)
            raise TwinError(f"--rate-limit-deg-s {limit:g}: must be greater than zero")
        if not 0 <= self.seed < 2**63:
            raise TwinError(f"--seed {self.seed}: must be a whole number from 0 to 2⁶³ − 1")

    def plan(self, tick: float) -> "Plan":
        """Commands for a gimbal that takes a new angle every `tick` [s].

        Raises
        ------
        TwinError : a frequency too high for the ticks, or more than an hour of commands
        """
        if self.signal in ("chirp", "prbs", "multisine") and self.band[1] > 0.25 / tick:
            raise TwinError(
                f"--band-hz {self.band[0]:g} {self.band[1]:g}: at {1.0 / tick:g} commands a second"
                f" the upper one must be at most {0.25 / tick:g}"
            )
        chosen = (0, 1) if self.axis == "both" else (AXES.index(self.axis),)
        if self.signal in _LEVELS:
            turns = self._held(_LEVELS[self.signal](self), tick, len(chosen))
        else:
            turns = self._repeated(tick, len(chosen))
        if self.rate_limit is not None:
            turns = [_limited(t, self.rate_limit * tick) for t in turns]
        angles = np.zeros((sum(map(len, turns)), 2))
        begin = 0
        for axis, levels in zip(chosen, turns, strict=True):
            end = begin + len(levels)
            angles[begin:end, axis] = np.clip(levels, -self.amplitude, self.amplitude)
            begin = end
        changes = np.flatnonzero(np.any(np.diff(angles, axis=0) != 0.0, axis=1)) + 1
        rows = np.concatenate([[0], changes])
        return Plan(rows * tick, angles[rows], len(angles) * tick)

    def _repeated(self, tick: float, axes: int) -> list[Array]:
        """Rest, whole periods and rest for every axis, one level a tick."""
        rest = np.zeros(ticks_of(self.hold, tick))
        period = _PERIODS[self.signal](self, tick)
        self._check((2 * len(rest) + self.repeats * len(period)) * axes * tick)
        return [np.concatenate([rest, np.tile(period, self.repeats), rest])] * axes

    def _held(self, levels: Array, tick: float, axes: int) -> list[Array]:
        """The same for levels (repeats, moves), each begun at another phase of a pulse frame."""
        hold, frame = ticks_of(self.hold, tick), frame_of(tick)
        self._check((levels.size + 2) * (hold + frame) * axes * tick)
        sequence = np.concatenate([[0.0], levels.ravel()])
        turns, now = [], 0
        for axis in range(axes):
            repeats, moves = levels.shape
            phases = _phases(repeats, moves, np.random.default_rng([self.seed, axis]))
            counts = []
            for phase in (phases * frame).astype(int):
                # no hold is shorter than asked for; it ends when the frame next has that phase
                counts.append(hold + int(phase - now - hold) % frame)
                now += counts[-1]
            counts.append(2 * hold)  # the last level and the rest, both zero
            now += counts[-1]
            turns.append(np.repeat(sequence, counts))
        return turns

    def _check(self, seconds: float) -> None:
        if seconds > LONGEST:
            raise TwinError(
                f"--signal {self.signal}: takes {seconds:.0f} s with these settings; must be"
                f" at most {LONGEST:.0f} s"
            )


@dataclass(frozen=True)
class Plan:
    """A sequence of commanded gimbal angles, read-only.

    Attributes
    ----------
    times : (n,) when each angle begins [s], ascending from 0
    angles : (n, 2) [rad]
    duration : end of the last hold [s]
    """

    times: Array
    angles: Array
    duration: float

    def __post_init__(self) -> None:
        self.times.setflags(write=False)
        self.angles.setflags(write=False)


def _phases(repeats: int, moves: int, rng: np.random.Generator) -> Array:
    """Phases (repeats · moves,) in 0…1 at which moves begin, spread evenly twice over.

    All of them stand at equal distances, and so do those of the repeats of every one move.
    """
    coarse = np.argsort(rng.random((repeats, moves)), axis=0)
    fine = (rng.permutation(moves) + 0.5) / moves
    return np.asarray((coarse + fine) / repeats).ravel()


def _limited(levels: Array, most: float) -> Array:
    """Follow the levels, but no further than `most` a tick."""
    out = np.empty_like(levels)
    now = 0.0
    for k, level in enumerate(levels):
        now += min(max(level - now, -most), most)
        out[k] = now
    return out


# Levels that are held, and signals that are given tick by tick.
_LEVELS: Mapping[str, Callable[[Excitation], Array]] = MappingProxyType(
    {
        "steps": lambda e: waveforms.steps(e.amplitude, e.repeats),
        "staircase": lambda e: waveforms.staircase(e.amplitude, e.smallest, e.repeats),
    }
)
_PERIODS: Mapping[str, Callable[[Excitation, float], Array]] = MappingProxyType(
    {
        "chirp": lambda e, tick: waveforms.chirp(e.amplitude, e.band, e.duration, tick),
        "prbs": lambda e, tick: waveforms.prbs(e.amplitude, e.band, e.seed, tick),
        "multisine": lambda e, tick: waveforms.multisine(e.amplitude, e.band, e.seed, tick),
        "triangle": lambda e, tick: waveforms.triangle(e.amplitude, e.duration, tick),
        "dog-leg": lambda e, tick: waveforms.dog_leg(e.amplitude, e.duration, tick),
    }
)
