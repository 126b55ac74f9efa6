"""`twin doctor --port`: what a maker reads after flashing."""

from hardware.emulator import Emulator, Injection, reference_rig
from hardware.frames import POTENTIOMETER_NAMES
from hardware.rig import in_process
from hardware.rig.examination import answers


def rows(*faults):
    device = Emulator(reference_rig(), injections=faults)
    rig = in_process(device, arm=False, fuse=False)
    found = {row[0]: row[1:] for row in answers(rig, lambda: device.advance_us(5000))}
    assert device.bench.plant.angles() == (0.0, 0.0)  # nothing was driven
    return found


def test_a_board_that_was_flashed_and_wired_is_found_in_order():
    found = rows()
    assert {row[0] for row in found.values()} == {"ok"}
    assert found["readings"][1] == "500 a second"  # a telemetry period of 2 ms
    assert found["IMU holder"][1] == "answers at 0x68, MPU6050"
    assert found["potentiometers"][1].startswith("0.5")
    assert found["limit switches"][1] == "closed: none"
    assert found["board"][1].startswith("firmware ")


def test_what_is_not_wired_is_named():
    found = rows(
        Injection("imu", "unplug", 2.0, 0.0, 60.0),
        Injection("potentiometer_y_a", "open", 0.0, -1.0),
    )
    assert found["IMU holder"] == (
        "missing", "no answer at 0x68", "check SDA, SCL, AD0 and its supply"
    )  # fmt: skip
    assert found["potentiometers"][0] == "missing"
    assert found["potentiometers"][2] == "check potentiometer_y_a"
    base = rows(Injection("base_imu", "unplug", 2.0, 0.0, 60.0))["IMU base"]
    assert base[0] == "note"
    assert base[2].startswith("only needed for the turntable")
    none = rows(*(Injection(name, "open", 0.0, -1.0) for name in POTENTIOMETER_NAMES))
    assert "--minimal" in none["potentiometers"][2]


def test_a_chip_that_does_not_say_what_it_is_is_a_note_with_a_remedy(monkeypatch):
    monkeypatch.setattr("hardware.emulator.emulator.MPU6050", 0)  # its WHO_AM_I
    level, state, remedy = rows()["IMU holder"]
    assert (level, state) == ("note", "answers at 0x68, WHO_AM_I 0x0")
    assert "reset the board" in remedy
