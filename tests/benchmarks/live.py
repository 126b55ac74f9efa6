"""Is a gimbal known sooner with chosen signals than with the default steps, and do intervals hold?

python -m tests.benchmarks.live [SEEDS [FIRST SEED]]

The gimbals are linear and of known parameters (closed form), behind pulse frames of 20 ms that take
up a command 0 to 20 ms late, with potentiometers of 0.05° noise.
"""

import sys
from collections.abc import Callable, Iterator

import numpy as np

from analysis.identify import FIGURES, IdentifiedModel, Wish, identify_gimbal
from analysis.recording import Measurement, measurement
from hardware.protocol import constants
from tests.benchmarks.identification import Gimbal, moved
from twin.cli.live.measurement import half_widths, until_known
from twin.cli.live.pieces import TICK, Piece

ASKED = (Wish("delay", 2.5e-3), Wish("bandwidth", 0.04))
LARGEST, NOISE = np.radians(5.0), np.radians(0.05)
LONGEST = 600.0  # s


def unit(seed: int) -> tuple[list[Gimbal], Callable[[Piece], Measurement]]:
    """True parameters of both axes, and a function that measures a piece."""
    rng = np.random.default_rng(seed)
    axes = [Gimbal(*rng.uniform([30, 0.5, 0.004, 0.95], [70, 0.9, 0.015, 1.05])) for _ in range(2)]

    def measure(piece: Piece) -> Measurement:
        plan = piece.excitation(float(LARGEST)).plan(TICK)
        frame, phase = constants.PWM_PERIOD, rng.uniform(0.0, constants.PWM_PERIOD)
        taken = phase + np.ceil((plan.times - phase) / frame) * frame
        last = np.append(np.diff(taken) > 0.0, [True])  # of two commands in a frame the later
        time = np.arange(0.0, plan.duration, 4.0 * TICK)
        columns = []
        for k, g in enumerate(axes):
            alone = plan.angles[last, k : k + 1]
            changes = np.append([True], np.any(np.diff(alone, axis=0) != 0.0, axis=1))
            angle, _ = moved([g], time, taken[last][changes], alone[changes])
            columns.append(angle + NOISE * rng.normal(size=len(time)))
        return measurement(
            time, plan.angles, command_time=plan.times, before=[0.0, 0.0], angle=np.array(columns).T
        )

    return axes, measure


def scored(model: IdentifiedModel, axes: list[Gimbal]) -> list[float]:
    """Errors over half widths, against the mean answer: a wait evenly spread over a frame."""
    found, frame = [], constants.PWM_PERIOD
    w = np.linspace(5.0, 150.0, 20_000)
    for k, g in enumerate(axes):
        s, channel = 1j * w, model.channels[k][k]
        H = g.frequency**2 / (s**2 + 2.0 * g.damping * g.frequency * s + g.frequency**2)
        mean = np.abs(H) * np.sinc(w * frame / (2.0 * np.pi))
        bandwidth = float(w[np.flatnonzero(mean < np.sqrt(0.5))[0]])
        p = channel.parameters
        delay = FIGURES["delay"](p) - g.delay - 0.5 * frame
        relative = FIGURES["bandwidth"](p) / bandwidth - 1.0
        found.append(abs(delay) / ASKED[0].now(channel))
        found.append(abs(relative) / ASKED[1].now(channel))
    return found


def default_steps(measure: Callable[[Piece], Measurement]) -> tuple[float, IdentifiedModel]:
    """Motion [s] until the default steps of `twin step` reach the same, and the model."""
    runs, motion = [], 0.0
    while True:
        piece = Piece("steps", 1.0, 0.8, 1, len(runs))
        runs.append(measure(piece))
        motion += piece.excitation(float(LARGEST)).plan(TICK).duration
        if len(runs) in (2, 3, 4) or len(runs) % 3 == 0:  # fits are slow
            model = identify_gimbal(runs, coupling="none")
            halves = half_widths(model, ASKED)
            if motion > LONGEST or all(halves[w.name] <= w.half for w in ASKED):
                return motion, model


def known(seed: int) -> tuple[float, float, list[float], list[float]]:
    """Motion [s] with chosen signals and with default steps; errors over half widths of both."""
    axes, measure = unit(seed)
    fits = []

    def fit(runs):
        fits.append(identify_gimbal(runs, coupling="none"))
        return fits[-1]

    _, motion, _ = until_known(measure, ASKED, float(LARGEST), LONGEST, fit)
    steps, model = default_steps(measure)
    return motion, steps, scored(fits[-1], axes), scored(model, axes)


def table(seeds: int = 30, first: int = 0) -> Iterator[str]:
    """A line for each gimbal, and the median."""
    ratios, scores, others = [], [], []
    for seed in range(first, first + seeds):
        chosen, steps, found, other = known(seed)
        ratios.append(chosen / steps)
        scores += found
        others += other
        worst = " ".join(f"{s:.2f}" for s in found + other)
        yield f"seed {seed}: {chosen:.0f} s chosen, {steps:.0f} s default steps; errors {worst}"
    held, before = (100.0 * np.mean(np.array(s) <= 1.0) for s in (scores, others))
    yield f"median ratio {np.median(ratios):.2f} over {seeds} gimbals"
    yield f"intervals hold {held:.0f} % (default steps: {before:.0f} %)"


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:3])):
        print(text, flush=True)
