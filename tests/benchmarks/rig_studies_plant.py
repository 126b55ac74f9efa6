"""The studies of `rig_studies_servos` without sensors, port and fusion: 30 times as fast.

The monitor of the servos is given the true angles with 0.15° of smoothed noise.
"""

from math import radians

import numpy as np

from hardware.calibration import nominal
from hardware.emulator import parse, sample_rig
from hardware.emulator.actuation import Actuation as Faults
from hardware.emulator.plant import AnalyticPlant
from hardware.emulator.servo import PULSE_CENTRE
from hardware.faults import Actuation, ServoLimits
from hardware.fusion.commands import tolerances
from tests.benchmarks.rig_studies_servos import NAMING, flown, measured, report
from tests.hardware.trial import random_steps

FRAME, PWM = 2, 20  # ms between frames, and between new pulses
OPEN = (False, False, False, False)


def fly(seed, command, duration, fault=None, calibration=None):
    """Return (time, sensor, kind) of every fault; commands are zero from the first one on."""
    unit, limits = sample_rig(seed), ServoLimits()
    calibration = calibration or measured(unit)
    plant, servos = AnalyticPlant(unit.plant), unit.plant.servos
    injected = Faults(plant, (parse(fault),) if fault else ())
    monitor = Actuation(tolerances(calibration, limits), limits)
    noise = np.random.default_rng([seed, 77]).normal(0, radians(0.15), (int(duration * 500) + 1, 2))
    named, kinds, smooth = [], ["", ""], np.zeros(2)
    for i in range(int(duration * 1000)):
        time = i * 1e-3
        if named and time > named[0][0] + NAMING:
            break
        if i % PWM == 0:
            pulses = calibration.pulses((0.0, 0.0) if named else command(time))
            commanded = calibration.angles(pulses)
            wanted = [s.command(p) for s, p in zip(servos, (*pulses, PULSE_CENTRE), strict=True)]
        plant.advance(1e-3, injected.shafts(tuple(wanted), time, 1e-3))
        if i % FRAME or time < 0.02:
            continue
        smooth += 0.1 * (noise[i // FRAME] - smooth)
        x, y = plant.angles()
        angle, rate = (x + float(smooth[0]), y + float(smooth[1])), plant.rates()
        monitor.advance(commanded, angle, 2e-3)
        monitor.inspect(angle, rate, (rate[0] * 2e-3, rate[1] * 2e-3), 2e-3, OPEN)
        for k in (0, 1):
            if monitor.kinds[k] != kinds[k]:
                kinds[k] = monitor.kinds[k]
                if kinds[k]:
                    named.append((time, f"servo_{'xy'[k]}", kinds[k]))
    return named


def plant(rigs=20, first=0):
    """Servo faults as in `servos`."""
    report(fly, rigs, first)


def plant_quiet(duration=90, rigs=20, first=0):
    """False alarms as in `quiet`."""
    alarms, seconds = [], 0.0
    for seed in range(first, first + rigs):
        for command in (flown(seed), random_steps(seed, radians(8.0))):
            for calibration in (None, nominal()):
                alarms += [(seed, n) for n in fly(seed, command, duration, None, calibration)[:1]]
                seconds += duration
    print(f"false alarms: {len(alarms)} in {seconds / 3600:.2f} h of {rigs} healthy rigs {alarms}")
