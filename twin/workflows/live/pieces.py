"""The stretches of motion that may come next, and which of them is expected to tell most."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.identify import IdentifiedModel, Plant, Wish, remaining
from analysis.recording import Measurement
from twin.experiments.excitation import Excitation

TICK = 0.002  # s; of `twin step`
HOLDS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8)  # s
SETTLED = 4.0  # time constants after which the next command may come
SIZES = (1.0, 0.5)  # of the largest angle


@dataclass(frozen=True)
class Piece:
    """One stretch of motion.

    Attributes
    ----------
    signal : kind of test signal
    size : largest change of the command, over the largest angle: the speed of a servo is bounded,
        and a model of larger jumps is another one
    hold : between two changes, at least [s]
    repeats : chosen for its length
    """

    signal: Any
    size: float
    hold: float
    repeats: int
    seed: int = 0

    def excitation(self, largest: float) -> Excitation:
        """As a signal for the gimbal."""
        return Excitation(
            self.signal, self.amplitude(largest), "both", self.repeats, self.hold,
            band=(0.5, 0.443 / self.hold), smallest=0.2 * self.amplitude(largest), seed=self.seed,
        )  # fmt: skip

    def amplitude(self, largest: float) -> float:
        """Largest angle, in the unit of the largest allowed; a PRBS changes by twice as much."""
        return largest * self.size * (0.5 if self.signal == "prbs" else 1.0)

    def text(self, largest_deg: float) -> str:
        """In words."""
        angle = self.amplitude(largest_deg)
        return f"{self.signal}, {angle:g}°, hold {self.hold:g} s, {self.repeats} repeats"

    def settings(self, largest_deg: float, seed: int) -> dict[str, Any]:
        """As settings of `twin step`, the seed counted from `seed`."""
        found = {
            "signal": self.signal, "amplitude_deg": self.amplitude(largest_deg),
            "hold_s": self.hold, "repeats": self.repeats, "seed": seed + self.seed,
        }  # fmt: skip
        if self.signal == "prbs":
            found["band_hz"] = (0.5, 0.443 / self.hold)
        if self.signal == "staircase":
            found["smallest_deg"] = 0.2 * self.amplitude(largest_deg)
        return found


CANDIDATES = tuple(
    Piece(signal, size, hold, 1)
    for signal in ("steps", "staircase", "prbs")
    for size in SIZES
    for hold in HOLDS
)


Expected = list[tuple[Wish, Any, float]]


def expected(
    model: IdentifiedModel, runs: Sequence[Measurement], asked: Sequence[Wish], largest: float
) -> Iterator[tuple[Piece, Expected]]:
    """Of every candidate: each wish of each axis, its half width over time, and what it needs."""
    plants = [
        Plant(row[k], a.noise[0], a.stamps if np.isfinite(a.stamps) else 0.0, runs[0].period)
        for k, (row, a) in enumerate(zip(model.channels, model.axes, strict=True))
    ]
    had = [
        np.sum([p.information(r.command.time, r.command.values[:, k]) for r in runs], axis=0)
        for k, p in enumerate(plants)
    ]
    # a command given before the last one's answer is over shares its readings, and the scatter of
    # whole steps, which widens intervals where pulse frames are waited for, is then too small
    settled = max(p.answered(SETTLED) for p in plants)
    for piece in (c for c in CANDIDATES if c.hold >= min(settled, max(HOLDS))):
        plan = piece.excitation(largest).plan(TICK)
        yield (
            piece,
            [
                (w, *remaining(w, p, had[k], more, _each(piece, largest)))
                for k, p in enumerate(plants)
                for more in [p.information(plan.times, plan.angles[:, k])]
                for w in asked
            ],
        )


def following(
    model: IdentifiedModel,
    runs: Sequence[Measurement],
    asked: Sequence[Wish],
    largest: float,
    left: float,
) -> tuple[Piece, float, Expected]:
    """The candidate that needs least time, that time [s], and what it is expected to tell."""
    found = [
        (max(t for _, _, t in told), piece, told)
        for piece, told in expected(model, runs, asked, largest)
        if piece.excitation(largest).plan(TICK).duration <= left
    ]
    needed, piece, told = min(found, key=lambda f: f[0])
    return piece, needed, told


def _each(piece: Piece, largest: float) -> float:
    """Length of one repeat [s]."""
    once, twice = (
        replace(piece, repeats=n).excitation(largest).plan(TICK).duration for n in (1, 2)
    )
    return twice - once


def sized(piece: Piece, seconds: float, largest: float) -> Piece:
    """A piece of about this length."""
    each = _each(piece, largest)
    rests = piece.excitation(largest).plan(TICK).duration - each
    return replace(piece, repeats=max(1, math.floor((seconds - rests) / each)))
