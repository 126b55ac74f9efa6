"""Is a gimbal known sooner with chosen signals than with the default steps, and do intervals hold?

python -m tests.benchmarks.live [SEEDS [FIRST SEED]]

The gimbals are linear and of known parameters (closed form), behind pulse frames of 20 ms that take
up a command 0 to 20 ms late and whose clock is up to 0.5 % off, as a Nano's resonator, with
potentiometers of 0.05° noise. Delays count from the commands: true is that of the gimbal plus half
a frame.
"""

import sys
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from analysis.identify import FIGURES, IdentifiedModel, Wish, by_frames, identify_gimbal
from analysis.recording import Measurement, Recording, TimeSeries, measurement_of
from hardware.protocol import constants
from tests.benchmarks.identification import Gimbal, moved
from twin.workflows.live.measurement import half_widths, until_known
from twin.workflows.live.pieces import TICK, Piece

ASKED = (Wish("delay", 0.3e-3), Wish("bandwidth", 0.01))
LARGEST, NOISE = np.radians(5.0), np.radians(0.05)
LONGEST = 600.0  # s
AXES = ("x", "y")


def unit(seed: int) -> tuple[list[Gimbal], Callable[[Piece], Measurement]]:
    """True parameters of both axes, and a function that measures a piece."""
    rng = np.random.default_rng(seed)
    axes = [Gimbal(*rng.uniform([30, 0.5, 0.004, 0.95], [70, 0.9, 0.015, 1.05])) for _ in range(2)]
    pace = 1.0 + rng.uniform(-0.005, 0.005)

    def measure(piece: Piece) -> Measurement:
        plan = piece.excitation(float(LARGEST)).plan(TICK)
        boot = rng.uniform(1.0, 2.0)  # what the device's clock reads at the start
        frame = constants.PWM_PERIOD
        begin = (
            np.arange(np.ceil(boot / frame), 1e3 + plan.duration / frame) * frame - boot
        ) / pace
        begin = begin[begin < plan.duration]
        row = np.searchsorted(plan.times, begin, side="right") - 1
        taken = plan.angles[row]
        time = np.arange(0.0, plan.duration, 4.0 * TICK)
        angle = np.zeros((len(time), 2))
        for k, g in enumerate(axes):
            new = np.flatnonzero(np.diff(taken[:, k], prepend=0.0))
            angle[:, k] = moved([g], time, begin[new], taken[new, k : k + 1])[0]
        angle += NOISE * rng.normal(size=angle.shape)
        seen = np.searchsorted(begin, time + 1e-9, side="right") - 1
        pulse = 1.5e-3 + 1e-3 * np.where(seen[:, None] < 0, 0.0, taken[seen])
        series = [
            TimeSeries("gimbal/command", plan.times, plan.angles, "rad", AXES),
            TimeSeries("gimbal/measured", time, angle, "rad", AXES),
            TimeSeries("sensors/pulse", time, pulse, "s", AXES),
            TimeSeries("sensors/device_time", time, (boot + pace * time)[:, None], "s", ("time",)),
        ]
        return measurement_of(Recording({}, {s.name: s for s in series}))

    return axes, measure


def fitted(runs: Sequence[Measurement]) -> IdentifiedModel:
    """As `twin identify` does."""
    return identify_gimbal(by_frames(runs), coupling="none")


def scored(model: IdentifiedModel, axes: list[Gimbal]) -> list[float]:
    """Errors over half widths: delay and bandwidth of each axis."""
    found = []
    for k, g in enumerate(axes):
        channel = model.channels[k][k]
        p, true = channel.parameters, [2.0 * g.damping * g.frequency, g.frequency**2]
        true = np.array([*np.log(true), g.delay + 0.5 * constants.PWM_PERIOD, g.gain])
        for wish in ASKED:
            figure = FIGURES[wish.name]
            off = abs(figure(p) - figure(true)) / (1.0 if wish.name == "delay" else figure(true))
            found.append(off / wish.now(channel))
    return found


def default_steps(measure: Callable[[Piece], Measurement]) -> tuple[float, IdentifiedModel]:
    """Motion [s] until the default steps of `twin step` reach the same, and the model."""
    runs, motion = [], 0.0
    while True:
        piece = Piece("steps", 1.0, 0.8, 1, len(runs))
        runs.append(measure(piece))
        motion += piece.excitation(float(LARGEST)).plan(TICK).duration
        if len(runs) in (2, 3, 4) or len(runs) % 3 == 0:  # fits are slow
            model = fitted(runs)
            halves = half_widths(model, ASKED)
            if motion > LONGEST or all(halves[w.name] <= w.half for w in ASKED):
                return motion, model


def known(seed: int) -> tuple[float, float, list[float], list[float]]:
    """Motion [s] with chosen signals and with default steps; errors over half widths of both."""
    axes, measure = unit(seed)
    fits = []

    def fit(runs: Sequence[Measurement]) -> IdentifiedModel:
        fits.append(fitted(runs))
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
