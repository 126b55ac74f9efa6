"""Is a change of a gimbal named rightly and in time, and is an unchanged one left alone?

python -m tests.benchmarks.drift [SEEDS [HOURS [FIRST SEED]]]

The gimbal is the linkage under the commands of a run, its angle that of the rig's potentiometers
and gyro through the estimator's filter with constant gains: 200 times as fast as the emulator.
"""

import sys
from collections.abc import Iterator

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter

from analysis.recording import Recording, TimeSeries
from hardware.fusion.kalman import BIAS, Noise, observation, process_noise, transition
from hardware.parts import POTENTIOMETER_TRAVEL
from hardware.protocol import constants
from twin.evaluation.drift import RunDrift, run_drift
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled

PERIOD_NS = 2_000_000
PERIOD = PERIOD_NS * 1e-9
BEFORE, WITHIN = 8.0, 20.0  # s: of unchanged motion, and in which a change has to be named
CHANGES = {
    "backlash": Variant({"gimbal_backlash": 0.0087 + np.radians(0.5)}),
    "friction": Variant(
        {"gimbal_servo_x.frictionloss": 0.012, "gimbal_servo_y.frictionloss": 0.012}
    ),
    "speed": Variant({"gimbal_servo_voltage": 4.3}),
    "zero": Variant(shaft=np.radians(2.0)),
    "delay": Variant(late=0.010),
}


def commands(seed: int, seconds: float) -> np.ndarray:
    """Ordinary motion: steps of random size, axis and length (n, 2) [rad]."""
    rng = np.random.default_rng(seed)
    out, now, begin = np.zeros((round(seconds / PERIOD), 2)), np.zeros(2), 0
    while begin < len(out):
        end = begin + round(rng.uniform(0.25, 0.8) / PERIOD)
        out[begin:end] = now
        now[rng.integers(2)] = np.radians(rng.uniform(1.0, 5.0)) * rng.choice((-1.0, 1.0))
        begin = end
    return out


def made(angles: np.ndarray, measured: np.ndarray | None = None) -> Recording:
    """A recording of a run with these commands, and what was measured."""
    time = np.arange(len(angles)) * PERIOD
    stamps = time + 1e-6

    def series(name, values, at=time, unit="rad", components=("x", "y")):
        return TimeSeries(name, at, values, unit, components)

    clock = stamps[:, None] + 0.0137  # the device's frames begin anywhere in a tick
    given = {
        "gimbal/command": series("gimbal/command", angles),
        "gimbal/simulated": series("gimbal/simulated", angles),
        "gimbal/measured": series("gimbal/measured", angles if measured is None else measured),
        "sensors/device_time": series("", clock, stamps, "s", ("time",)),
        "sensors/taken": series("", time[:, None] + PERIOD, stamps, "s", ("time",)),
    }
    return Recording({"shadow": {"gimbal": "linkage", "set": {}}}, given)


def gains() -> tuple[np.ndarray, np.ndarray]:
    """State transition and gain of the estimator once it has settled."""
    noise = Noise()
    F, Q = transition(PERIOD, noise.gyro_delay), process_noise(PERIOD, noise)
    H, travel = observation(1.0), POTENTIOMETER_TRAVEL
    own, supply = (noise.potentiometer * travel) ** 2, (noise.supply * 0.5 * travel) ** 2
    R = np.diag([own + supply, own + supply, noise.gyro**2 / PERIOD])
    R[0, 1] = R[1, 0] = -supply
    Q[BIAS, BIAS] += 1e-12
    P = solve_discrete_are(F.T, H.T, Q, R)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    K[BIAS] = 0.0
    return (np.eye(len(F)) - K @ H) @ F, K


def sensed(angle: np.ndarray, seed: int) -> np.ndarray:
    """Angle that a rig estimates of a true one (n,) [rad]."""
    rng, noise, n = np.random.default_rng(seed), Noise(), len(angle)
    supply = 1.0 + 3e-4 * rng.standard_normal(n)
    pots = []
    for sign in (1.0, -1.0):
        code = (0.5 + sign * angle / POTENTIOMETER_TRAVEL) * supply * constants.ADC_LEVELS
        code = np.floor(code + 0.6 * rng.standard_normal(n)) + 0.5
        pots.append(sign * (code / constants.ADC_LEVELS - 0.5) * POTENTIOMETER_TRAVEL)
    keep = np.exp(-PERIOD / noise.gyro_delay)
    # mean rate since the last reading: the rate at its end would answer a half period early
    rate = lfilter([1.0 - keep], [1.0, -keep], np.diff(angle, prepend=angle[0]) / PERIOD)
    rate += noise.gyro / np.sqrt(PERIOD) * rng.standard_normal(n)
    A, K = gains()
    inputs, x, out = np.column_stack([*pots, rate]) @ K.T, np.zeros(4), np.empty(n)
    for k in range(n):
        x = A @ x + inputs[k]
        out[k] = x[0]
    return out


def drifted(angles: np.ndarray, motion: np.ndarray, seed: int) -> RunDrift:
    """Verdict on a run whose gimbal moved like this."""
    measured = np.column_stack([sensed(m, 2 * seed + k) for k, m in enumerate(motion.T)])
    return run_drift(made(angles, measured))


def named(seed: int) -> dict[str, float | None]:
    """By change of y: how long until it was named and nothing else was [s]; None otherwise."""
    angles = commands(seed, BEFORE + WITHIN)
    with compiled():
        motions = Resimulation(made(angles)).motions([Variant(), *CHANGES.values()])
    late = round(BEFORE / PERIOD)
    found: dict[str, float | None] = {}
    for name, motion in zip(CHANGES, motions[1:], strict=True):
        both = motions[0].copy()
        both[late:, 1] = motion[late:, 1]
        changes = drifted(angles, both, seed).changes
        right = [(c.axis, c.what.name) for c in changes] == [("y", name)]
        found[name] = changes[0].noticed - BEFORE if right else None
    return found


def false_alarms(seed: int, seconds: float, noises: int) -> int:
    """Events of an unchanged gimbal: one motion, measured several times."""
    angles = commands(seed, seconds)
    with compiled():
        (motion,) = Resimulation(made(angles)).motions([Variant()])
    return sum(len(drifted(angles, motion, 100 * seed + k).changes) for k in range(noises))


def table(seeds: int = 40, hours: float = 10.0, first: int = 0) -> Iterator[str]:
    """A line for each seed, for each kind of change, and for the unchanged gimbal."""
    results = []
    for seed in range(first, first + seeds):
        results.append(named(seed))
        cells = (f"{n} {'missed' if t is None else f'{t:.1f} s'}" for n, t in results[-1].items())
        yield f"seed {seed}: {', '.join(cells)}"
    for name in CHANGES if results else ():
        times = [r[name] for r in results]
        right = [t for t in times if t is not None]
        after = f"after {np.median(right):.1f} s, at most {max(right):.1f} s" if right else ""
        yield f"{name:<10} named rightly in {len(right)} of {seeds} {after}"
    seconds, noises, events = 300.0, 10, 0
    runs = round(hours * 3600.0 / seconds / noises)
    for k in range(runs):
        events += false_alarms(1000 + first + k, seconds, noises)
        yield f"unchanged: {events} events in {(k + 1) * noises * seconds / 3600.0:.1f} h"


if __name__ == "__main__":
    asked = sys.argv[1:]
    for text in table(*map(int, asked[:1]), *map(float, asked[1:2]), *map(int, asked[2:3])):
        print(text, flush=True)
