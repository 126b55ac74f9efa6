"""Faults of servos, slow faults and false alarms over many seeded rigs; see `rig_studies`."""

from dataclasses import replace
from math import degrees, radians

import numpy as np

from hardware.calibration import nominal
from hardware.emulator import parse, sample_rig
from hardware.emulator.truth import exact_calibration
from hardware.faults.states import UNNAMED
from tests.hardware.trial import random_steps, run

LIMIT = 0.3  # s; for the safe state
NAMING = 0.35  # s after the safe state, within which a servo's fault has its name

REST, DEGREE = 1.6, radians(1.0)  # s until motion begins; from it a servo's delay is counted
ONSET, LENGTH = 3.1, 2.0  # s; of a fault while moving, and for which it is watched
SERVOS = {  # fault → (names that are right, whether it begins while moving)
    "reversed": (("reversed",), False),
    "jammed": (("stuck",), True),
    "dead": (("stuck", "not following"), True),
    "hard_over:60": (("stuck", "not following"), True),
    "slipped:9": (("offset",), True),
    "swapped": (("swapped",), False),
}


def flown(seed):
    """Motion as in a flight: five sines of 0.15 to 1.5 Hz, 4° in all, after a rest."""
    random = np.random.default_rng([seed, 9])
    f, phase = random.uniform(0.15, 1.5, (2, 5)), random.uniform(0, 2 * np.pi, (2, 5))
    size = random.uniform(0.3, 1.0, (2, 5))
    size *= radians(4.0) * 1.3 / size.sum(axis=1, keepdims=True)

    def command(time):
        t = time - REST
        if t < 0:
            return 0.0, 0.0
        x, y = (size * (np.sin(2 * np.pi * f * t + phase) - np.sin(phase))).sum(axis=1)
        return float(x), float(y)

    return command


def measured(parameters):
    """Exact maps with play and dead band, as a calibration measures them."""
    ratio = np.diag(parameters.plant.linkage)
    pairs = zip(parameters.plant.servos[:2], ratio, strict=True)
    play = [(s.backlash + 2 * s.dead_band) * float(r) for s, r in pairs]
    return replace(exact_calibration(parameters), hysteresis=(play[0], play[1]))


def _first_degree(command, axis, begin, length):
    """Time at which a command has moved by a degree; of either axis if `axis` is None."""
    times = np.arange(begin, begin + length, 2e-3)
    moved = np.abs(np.array([command(t) for t in times]) - command(begin))
    moved = moved.max(axis=1) if axis is None else moved[:, axis]
    return times[np.argmax(moved > DEGREE)] if (moved > DEGREE).any() else np.inf


def _trial(seed, command, duration, fault):
    unit = sample_rig(seed)
    return run(
        unit,
        command,
        duration,
        injections=(parse(fault),),
        seed=seed,
        calibration=measured(unit),
        safe=NAMING,
    )


def _named(trial):
    return [(c.time, c.sensor, c.kind) for c in trial.changes if c.new == "faulty"]


def servos(rigs=20, first=0):
    """Servo faults by the name after the safe state, in flight-like motion on the bench."""
    report(lambda *arguments: _named(_trial(*arguments)), rigs, first)


def report(fly, rigs, first):
    """Print names and delays; `fly(seed, command, duration, fault)` gives times and names."""
    print(f"faults of servos, {rigs} rigs and both axes; delay from the first commanded degree")
    for fault, (kinds, moving) in SERVOS.items():
        delays, right, swapped = [], 0, fault == "swapped"
        begin = ONSET if moving else REST
        for seed in range(first, first + rigs):
            for axis in (0, 1):  # plugs are swapped in two motions
                command = flown(seed + 1000 * (swapped and axis))
                name = "servos:swapped" if swapped else f"servo_{'xy'[axis]}:{fault}"
                onset = f"{name}@{begin}" if moving else name
                named = fly(seed, command, begin + LENGTH, onset)
                last = [kind for _, sensor, kind in named if sensor == named[0][1]]
                good = bool(named) and (swapped or named[0][1] == f"servo_{'xy'[axis]}")
                good = good and named[0][1].startswith("servo") and _best(last).startswith(kinds)
                at_once = fault.startswith(("hard", "slip"))
                degree = _first_degree(command, None if swapped else axis, begin, LENGTH)
                delays.append(named[0][0] - (begin if at_once else degree) if named else np.inf)
                right += good
                if not good or delays[-1] > LIMIT:
                    print(f"    rig {seed} {name}: {delays[-1]:.2f} s, {named}", flush=True)
        _print_delays(fault, np.array(delays), right)


def _best(kinds):
    """The first of the names of a servo that says more than that it does not follow."""
    return next((k for k in kinds if k != UNNAMED), UNNAMED)


def _print_delays(name, delays, right):
    seen = np.isfinite(delays)
    if not seen.any():
        print(f"  {name:32s} never noticed")
        return
    print(
        f"  {name:32s} named rightly {right}/{len(delays)}, noticed {seen.sum()}, after "
        f"{np.median(delays[seen]):.2f} s median, {delays[seen].max():.2f} s worst, "
        f"{(delays <= LIMIT).sum()} within {LIMIT:g} s",
        flush=True,
    )


SLOW = {  # fault → (first sensor named, seconds)
    "potentiometers_x:slipped:5": ("potentiometers_x", 2.0),
    "potentiometers_x:stuck": ("potentiometers_x", 2.0),
    "potentiometers_x:drift:0.3": ("potentiometers_x", 12.0),
    "potentiometer_x_a:drift:0.05": ("potentiometer_x_a", 20.0),
    "potentiometer_x_a:gain:0.05": ("potentiometer_x_a", 10.0),
    "supply:droop:0.01": ("supply", 3.0),
    "gyro:bias:20": ("gyro", 2.0),
    "gyro:gain:0.05": ("gyro", 10.0),
    "servo_x:contact:1": ("servo_x", 4.0),
    "servo_x:slow:0.05": ("servo_x", 4.0),
}


def table(rigs=20, first=0):
    """Slow and common faults: what is named first, when, and how far off the estimate is then."""
    print(f"faults on {rigs} rigs in flight-like motion; delay from their beginning")
    for fault, (sensor, length) in SLOW.items():
        delays, off, right = [], [], 0
        for seed in range(first, first + rigs):
            trial = _trial(seed, flown(seed), 4.0 + length, f"{fault}@4")
            named = _named(trial)
            right += bool(named) and named[0][1] == sensor
            delays.append(named[0][0] - 4.0 if named else np.inf)
            until = trial.time <= (named[0][0] if named else np.inf)
            off.append(np.abs(trial.angle - trial.true_angle)[until & (trial.time > 3.0)].max())
        _print_delays(fault, np.array(delays), right)
        print(f"  {'':32s} estimate off by {degrees(max(off)):.2f}° at worst until then")


def quiet(duration=20, rigs=20, first=0):
    """False alarms of healthy rigs in flight-like motion and slews, calibrated and not."""
    alarms, seconds = [], 0.0
    for seed in range(first, first + rigs):
        for command in (flown(seed), random_steps(seed, radians(8.0))):
            for calibration in (measured(sample_rig(seed)), nominal()):
                trial = run(sample_rig(seed), command, duration, seed=seed, calibration=calibration)
                alarms += [(seed, c) for c in trial.changes if c.new == "faulty"]
                seconds += duration
    print(f"false alarms: {len(alarms)} in {seconds / 3600:.2f} h of {rigs} healthy rigs {alarms}")
