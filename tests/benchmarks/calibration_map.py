"""Commanded against true gimbal angle of calibrated emulated rigs, driven by `hardware` alone.

python -m tests.benchmarks.calibration_map [UNITS] [plain]

Each unit stands on the bench in MuJoCo and is calibrated in full. It is then commanded to 25 angles
within ±8° on both axes, each from both sides; the error is that of the mean. `line` is the straight
line through the same switches, `map` the whole calibration. `plain` takes play and dead band out of
the mechanism, so that only the map is left.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from hardware.calibration import CalibrationRig, Procedure
from hardware.calibration.solve import solve
from hardware.frames import GimbalCommand
from hardware.rig import in_process
from tests.hardware.linkage import GRID
from twin.hil import RigOptions, device, mechanism_map
from twin.physics import native
from twin.plant.model.model import ModelConfig, load

PLAIN = {"gimbal_backlash": 0.0, "gimbal_servo_dead_band": 0.0}
SIDE = np.radians(1.5)  # of the approach, on both axes


def _calibrated(options, rig):
    simulated = device(options)
    seat = in_process(simulated, fuse=False)
    procedure, frames = Procedure(rig, seat.connect().serial), 0
    while not procedure.done:
        simulated.advance_us(2000)
        for frame in seat.poll():
            pulses = procedure.step(frame)
            frames += 1
            if frames % 5 == 0:
                seat.send_pulses(*pulses)
    return procedure


def _errors(options, calibration):
    simulated = device(options)
    rig = in_process(simulated, calibration, fuse=False)
    rig.connect()

    def rest(angle, seconds):
        end = simulated.time_us + seconds * 1e6
        while simulated.time_us < end:
            rig.send(GimbalCommand(simulated.time_ns, tuple(angle)))
            simulated.advance_us(10_000)
            rig.poll()
        return np.array(simulated.bench.plant.angles())

    errors = []
    for angle in np.array(GRID):
        sides = []
        for side in (-SIDE, SIDE):
            rest(angle + side, 0.2)
            sides.append(rest(angle, 0.3))
        errors.append(np.mean(sides, axis=0) - angle)
    return np.array(errors)


def _study(unit, overrides):
    with native.installed():
        bench = load(ModelConfig(scene="bench")).mj
        options = RigOptions("emulator", unit=unit, seed=unit, overrides=overrides)
        rig = CalibrationRig(seed=unit, linearisation=mechanism_map(bench).linearisation)
        procedure = _calibrated(options, rig)
        whole = procedure.result()
        line = solve(procedure.log, CalibrationRig(seed=unit), procedure.identity)
        driven = replace(options, seed=unit + 1000)
        error = _errors(driven, whole)
        sigma = np.array([whole.sigma(a) for a in GRID])
        inside = (abs(error) < 2 * sigma).mean()
        return _errors(driven, line), error, inside, max(line.deviation), max(whole.deviation)


def main(arguments):
    units = next((int(a) for a in arguments if a.isdigit()), 20)
    overrides = PLAIN if "plain" in arguments else {}
    with ProcessPoolExecutor(2) as pool:
        results = list(pool.map(partial(_study, overrides=overrides), range(units)))
    for k, name in enumerate(("line", "map")):
        e = np.degrees([r[k] for r in results])
        worst = abs(e).max(axis=(1, 2))
        rms = np.sqrt(np.mean(e**2))
        print(
            f"{name}: worst {worst.max():.3f}°, median unit {np.median(worst):.3f}°, rms {rms:.3f}°"
        )
        largest = np.degrees(max(r[3 + k] for r in results))
        print(f"{name}: potentiometers between the switches at most {largest:.3f}° rms off")
    print(f"map: {np.mean([r[2] for r in results]):.1%} of the errors within 2 sigma")


if __name__ == "__main__":
    main(sys.argv[1:])
