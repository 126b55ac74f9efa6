"""A rig without potentiometers: one IMU on the holder calibrates and estimates its angles."""

from dataclasses import replace
from math import degrees, radians

import numpy as np
import pytest

from hardware.calibration import CalibrationError, CalibrationRig, Procedure
from hardware.calibration.file import from_dict, to_dict
from hardware.emulator import Injection, parse, sample_rig
from hardware.frames import POTENTIOMETER_NAMES, SensorFrame
from hardware.parts import STANDARD_GRAVITY, tilts
from tests.benchmarks.rig_studies_servos import flown
from tests.hardware.trial import calibrate, run

PARAMETERS = sample_rig(4)
GONE = tuple(Injection(name, "open", 0.0, -1.0) for name in POTENTIOMETER_NAMES)
QUICK = CalibrationRig(repeats=1, offsets=(80e-6, -80e-6), minimal=True)


@pytest.fixture(scope="module")
def calibration():
    return calibrate(PARAMETERS, QUICK, injections=GONE, seed=4)


def test_tilts_are_the_turns_that_bring_gravity_to_the_reading():
    for x, y in np.radians([(5, 0), (0, -7), (8, -8)]):
        turned = [np.cos(x) * np.sin(y), -np.sin(x), -np.cos(x) * np.cos(y)]
        assert tilts(tuple(STANDARD_GRAVITY * np.array(turned))) == pytest.approx((x, y))


@pytest.mark.thorough
def test_offset_and_scale_of_the_accelerometer_are_those_of_the_simulated_chip(calibration):
    chip = PARAMETERS.sensors.imus[0]
    a, b = chip.accelerometer_bias[:2]
    truth = (
        (-b / STANDARD_GRAVITY, chip.accelerometer_scale[1]),
        (a / STANDARD_GRAVITY, chip.accelerometer_scale[0]),
    )
    for line, (zero, scale) in zip(calibration.potentiometers[::2], truth, strict=True):
        sigma = np.sqrt(np.diag(line.covariance))
        # three deviations, and asin of a scaled sine: 0.01° at 9° for 3 %
        assert abs(line.zero - zero) < 3 * sigma[0] + radians(0.02)
        assert abs(line.gain - 1 / scale) < 3 * sigma[1] + 2e-3
        assert degrees(sigma[0]) < 0.1
        assert sigma[1] < 0.01


def test_the_file_of_a_minimal_rig_reads_as_it_was_written(calibration):
    again = from_dict(to_dict(calibration))
    assert again.minimal
    for one, other in zip(again.potentiometers, calibration.potentiometers, strict=True):
        assert (one.zero, one.gain) == pytest.approx((other.zero, other.gain))
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-9)
    broken = to_dict(calibration) | {"accelerometer": {"x": {"zero_deg": 0.0, "scale": 1.5}}}
    with pytest.raises(CalibrationError, match=r"accelerometer\.x\.scale is 1\.5"):
        from_dict(broken)


def test_angles_of_a_minimal_rig_in_steps_are_right_and_no_servo_is_accused(calibration):
    def command(time):
        return (radians(5) if int(time / 0.5) % 2 else 0.0, radians(-4) if time > 1.6 else 0.0)

    trial = run(PARAMETERS, command, 3.0, injections=GONE, seed=5, calibration=calibration)
    assert not trial.changes
    error = np.degrees(trial.error(start=1.0))
    assert error.max() < 0.2  # 0.1° rms is claimed
    inside = np.abs(trial.angle - trial.true_angle) < 3 * trial.sigma
    assert inside[trial.time > 1.0].mean() > 0.9


SERVOS = {
    "servo_x:reversed": "servo_x reversed",
    "servo_y:jammed@3.1": "servo_y stuck",
    "servos:swapped": "swapped with",
    "servo_x:hard_over:-60@3.1": "servo_x stuck",
}


def servo_faults(unit, calibration, fault):
    """What is named in flight-like motion after a rest, and until the servos are neutral again."""
    trial = run(
        sample_rig(unit), flown(unit), 4.6, injections=(*GONE, parse(fault)), seed=unit + 50,
        calibration=calibration, safe=0.35,
    )  # fmt: skip
    return [f"{c.sensor} {c.kind}" for c in trial.changes if c.new == "faulty"]


@pytest.mark.parametrize("fault", list(SERVOS)[:2])
def test_servo_faults_of_a_minimal_rig_are_named(calibration, fault):
    assert SERVOS[fault] in servo_faults(4, calibration, fault)[-1]


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1, 5, 6])
def test_servo_faults_of_other_minimal_rigs_are_named(unit):
    own = calibrate(sample_rig(unit), QUICK, injections=GONE, seed=unit)
    for fault, name in SERVOS.items():
        assert name in servo_faults(unit, own, fault)[-1]


def test_potentiometers_that_all_read_ground_are_named_unless_the_rig_has_none():
    frame = SensorFrame(
        0, 0, (0.0,) * 4, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.5e-3,) * 3,
        (False,) * 4, (0.0, 0.0), 0,
    )  # fmt: skip
    procedure = Procedure(replace(QUICK, minimal=False))
    with pytest.raises(CalibrationError, match=r"all four potentiometers read ground.*--minimal"):
        _feed(procedure, frame, 600)


def _feed(procedure, frame, count):
    for k in range(count):
        procedure.step(replace(frame, device_us=2000 * k))
