"""What to look at for a fault."""

import pytest

from hardware.faults import SENSORS
from hardware.faults.advice import advice


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("potentiometer_x_a open", "wire and plug"),
        ("potentiometer_x_a open, servo_x stuck at 3.1°", "wire and plug"),
        ("potentiometers_y deviating", "ring"),
        ("gyro frozen", "holder IMU"),
        ("servo_y stuck at 3.1°", "horn"),
        ("rig lost: read failed: socket disconnected", "cable"),
        ("no readings for 0.1 s", "cable"),
        ("readings are 5.4 s old", "busy"),
    ],
)
def test_the_first_fault_decides(fault, says):
    assert says in advice(fault)


def test_every_sensor_has_an_advice_and_other_text_none():
    kinds = ("open", "glitch", "deviating", "frozen", "bias", "sag")
    assert all(any(advice(f"{name} {kind}") for kind in kinds) for name in SENSORS)
    assert advice("potentiometers of x disagree") == ""
    assert advice("the ground") == ""
