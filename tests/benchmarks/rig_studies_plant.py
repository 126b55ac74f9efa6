"""The studies of `rig_studies_servos` without port and filter: 20 times as fast.

The monitor is given the true angles with 0.15° of smoothed noise, each potentiometer's own noise,
and an accelerometer 41 mm beside the pivot with offset, scale and noise of its data sheet.
"""

from math import cos, radians, sin

import numpy as np

from hardware.calibration import nominal
from hardware.emulator import parse, sample_rig
from hardware.emulator.actuation import Actuation as Faults
from hardware.emulator.plant import AnalyticPlant
from hardware.emulator.servo import PULSE_CENTRE
from hardware.faults import Actuation, Monitor, Prediction, Reading, ServoLimits
from hardware.frames import PAIR_NAMES
from hardware.fusion.commands import tolerances
from hardware.parts import ACCELEROMETER_NOISE
from tests.benchmarks.rig_studies_servos import NAMING, flown, measured, report
from tests.hardware.trial import random_steps

FRAME, PWM = 2, 20  # ms between frames, and between new pulses
LEVER = 0.0411  # m from the pivot to the IMU: site imu of mjcf/mechanism.xml
READING = radians(0.1)  # noise of one potentiometer
GAINS = (4.2, -4.2, 4.2, -4.2)  # rad per supply


class Readings:
    """What the sensors of a rig read of its true motion, frame by frame."""

    def __init__(self, unit, seed, duration, fault):
        random = np.random.default_rng([seed, 77])
        frames = int(duration * 1000) // FRAME + 2
        self.noise = random.normal(0, radians(0.15), (frames, 2))
        self.readings = random.normal(0, READING, (frames, 4))
        sigma = ACCELEROMETER_NOISE * (500 / FRAME) ** 0.5  # white up to half of the frame rate
        self.forces = random.normal(0, sigma, (frames, 3))
        imu = unit.sensors.imus[0]
        self.bias, self.scale = np.array(imu.accelerometer_bias), np.array(imu.accelerometer_scale)
        self.fault = fault if fault and fault.target in PAIR_NAMES else None
        self.smooth, self.last, self.count = np.zeros(2), None, 0

    def slipped(self, time):
        """Angles by which both potentiometers of the axes are displaced [rad]."""
        at = np.zeros(2)
        if self.fault and self.fault.active(time):
            grown = time - self.fault.start if self.fault.kind == "drift" else 1.0
            at[PAIR_NAMES.index(self.fault.target)] = radians(self.fault.value) * grown
        return at

    def next(self, plant, time, command):
        """Return (reading, prediction) of the next frame."""
        i, dt = self.count, FRAME * 1e-3
        self.count += 1
        rates = np.array(plant.rates())
        self.smooth += 0.1 * (self.noise[i] - self.smooth)
        angle = plant.angles() + self.smooth + self.slipped(time)
        pots = np.repeat(angle, 2) + self.readings[i]
        u, v = (rates - (rates if self.last is None else self.last)) / dt
        self.last = rates
        _, force = plant.holder_imu()
        p, q = rates
        added = np.array([v * LEVER, -u * LEVER, -(p * p + q * q) * LEVER])
        felt = self.scale * (force + added) + self.bias + self.forces[i]
        gyro = (p * cos(angle[1]), q, p * sin(angle[1]) + 1e-4 * (i % 2))
        reading = Reading(
            dt, (0.5,) * 4, tuple(pots), GAINS, gyro, gyro[:2], command=command,
            force=tuple(felt), base_force=(0.0, 0.0, -9.8),
        )  # fmt: skip
        variance = (READING**2 + radians(0.05) ** 2,) * 4
        return reading, Prediction(tuple(angle), tuple(rates), (0.0, 0.0), variance)


def fly(seed, command, duration, fault=None, calibration=None):
    """Return (time, sensor, kind) of every fault; commands are zero from the first one on."""
    unit, limits = sample_rig(seed), ServoLimits()
    calibration = calibration or measured(unit)
    plant, servos = AnalyticPlant(unit.plant), unit.plant.servos
    given = parse(fault) if fault else None
    injected = Faults(plant, (given,) if given else ())
    named, sensors = [], Readings(unit, seed, duration, given)
    now = [0.0]

    def listen(sensor, old, new, kind):
        if new == "faulty" and old != "recovering":
            named.append((now[0], sensor, kind))

    monitor = Monitor(listen, Actuation(tolerances(calibration, limits), limits))
    for i in range(int(duration * 1000)):
        now[0] = time = i * 1e-3
        if named and time > named[0][0] + NAMING:
            break
        if i % PWM == 0:
            pulses = calibration.pulses((0.0, 0.0) if named else command(time))
            commanded = calibration.angles(pulses)
            wanted = [s.command(p) for s, p in zip(servos, (*pulses, PULSE_CENTRE), strict=True)]
        plant.advance(1e-3, injected.shafts(tuple(wanted), time, 1e-3))
        if i % FRAME or time < 0.02:
            continue
        reading, prediction = sensors.next(plant, time, commanded)
        if sensors.count == 1:
            monitor.begin(reading)
        monitor.inspect(reading, prediction)
    return named


def plant(rigs=20, first=0):
    """Servo faults as in `servos`."""
    report(fly, rigs, first)


def plant_drift(rigs=20, first=0):
    """Drifts of both potentiometers of an axis, which look like faults of its servo."""
    print(
        f"both potentiometers drift, {rigs} rigs and both axes, flight-like motion and slews of 8°"
    )
    for rate in (0.3, 1, 2):
        for motion in (flown, lambda seed: random_steps(seed, radians(8.0))):
            names, late, moved = [], 0, 0.0
            for seed in range(first, first + rigs):
                for axis in PAIR_NAMES:
                    end = 4.0 + 3.0 / rate
                    named = fly(seed, motion(seed), end, f"{axis}:drift:{rate}@4")
                    names.append(named[0][1].split("_")[0] if named else "nothing")
                    late += any(n == axis for _, n, _ in named[1:])
                    moved = max(moved, (named[0][0] - 4.0 if named else end) * rate)
            counts = ", ".join(f"{n} {names.count(n)}" for n in sorted(set(names)))
            kind = "flight" if motion is flown else "slews"
            print(
                f"  {rate:g} °/s, {kind:6s} first named: {counts}, of {len(names)}; "
                f"potentiometers a little later {late}; drifted by {moved:.1f}° at most until then",
                flush=True,
            )


def plant_quiet(duration=90, rigs=20, first=0):
    """False alarms as in `quiet`."""
    alarms, seconds = [], 0.0
    for seed in range(first, first + rigs):
        for command in (flown(seed), random_steps(seed, radians(8.0))):
            for calibration in (None, nominal()):
                alarms += [(seed, n) for n in fly(seed, command, duration, None, calibration)[:1]]
                seconds += duration
    print(f"false alarms: {len(alarms)} in {seconds / 3600:.2f} h of {rigs} healthy rigs {alarms}")
