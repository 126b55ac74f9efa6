"""Texts of the events of a rig, as logs and recordings show them."""

import pytest

from hardware.events import (
    HealthChanged,
    MonitoringLimited,
    RigBack,
    RigLost,
    SensorFault,
    SensorRecovered,
)


@pytest.mark.parametrize(
    ("event", "level", "text"),
    [
        (RigLost("it fell\n silent"), "WARN", "rig lost: it fell silent"),
        (RigBack(0.516), "INFO", "rig back after 0.52 s"),
        (
            RigBack(2.0, "after a brown-out"),
            "INFO",
            "rig back after 2.00 s; it started again after a brown-out",
        ),
        (SensorFault("gyro", "frozen"), "WARN", "sensor fault: gyro frozen"),
        (SensorRecovered("gyro"), "INFO", "sensor recovered: gyro"),
        (HealthChanged("gyro frozen"), "INFO", "gyro frozen"),
        (MonitoringLimited("not calibrated"), "INFO", "not calibrated"),
    ],
)
def test_an_event_is_one_line_with_a_level(event, level, text):
    assert (event.level, event.text) == (level, text)
