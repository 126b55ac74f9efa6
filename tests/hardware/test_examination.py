"""`twin doctor --port`: what a maker reads after flashing, against the rig that was sampled."""

import numpy as np
import pytest

from hardware.emulator import Emulator, Injection, identity, sample_rig
from hardware.frames import POTENTIOMETER_NAMES
from hardware.protocol import constants
from hardware.rig import in_process
from hardware.rig.examination import answers

RIG = sample_rig(5)


def rows(*faults):
    device = Emulator(RIG, injections=faults)
    rig = in_process(device, arm=False, fuse=False)
    shown = {row[0]: row[1:] for row in answers(rig, lambda: device.advance_us(5000))}
    assert set(device.device.pulse) == {constants.PULSE_NEUTRAL}  # nothing was driven
    return shown, device


def test_a_board_that_was_flashed_and_wired_shows_its_own_parameters():
    shown, device = rows()
    assert {row[0] for row in shown.values()} == {"ok"}
    assert f"{identity(RIG):08x}" in shown["board"][1]
    # a telemetry period of 2 ms by the board's own clock, which the frames are stamped with
    assert shown["readings"][1] == "500 a second"
    assert shown["IMU holder"][1] == "answers at 0x68, MPU6050"
    x, y = device.truth()[0]
    sensors = zip(RIG.sensors.potentiometers, (x, x, y, y), strict=True)
    true = [p.fraction(angle) - 0.5 / 1024 for p, angle in sensors]  # the ADC rounds down
    read = [float(v) for v in shown["potentiometers"][1].split(", ")]
    # means of 250 readings of 0.6 LSB, printed to 0.001; the gimbal has not moved by 0.1°
    np.testing.assert_allclose(read, true, atol=1.2e-3)


@pytest.mark.parametrize(
    ("faults", "topic", "level", "remedy"),
    [
        ([("imu", "unplug")], "IMU holder", "missing", "check SDA, SCL, AD0 and its supply"),
        ([("base_imu", "unplug")], "IMU base", "note", "only needed for the turntable"),
        ([("potentiometer_y_a", "open")], "potentiometers", "missing", "check potentiometer_y_a"),
        ([(n, "open") for n in POTENTIOMETER_NAMES], "potentiometers", "note", "--minimal"),
    ],
)
def test_what_is_not_wired_is_named(faults, topic, level, remedy):
    row = rows(*(Injection(target, kind, 2.0, -1.0) for target, kind in faults))[0][topic]
    assert row[0] == level
    assert remedy in row[2]


def test_a_chip_that_does_not_say_what_it_is_is_a_note_with_a_remedy(monkeypatch):
    monkeypatch.setattr("hardware.emulator.emulator.MPU6050", 0)  # its WHO_AM_I
    level, state, remedy = rows()[0]["IMU holder"]
    assert (level, state) == ("note", "answers at 0x68, WHO_AM_I 0x0")
    assert "reset the board" in remedy
