"""Faults of servos by the true angles of the bench, on emulator and simulated Nano."""

from math import degrees, radians

import numpy as np
import pytest

from hardware.emulator import Emulator, FirmwareRig, parse, reference_rig
from hardware.emulator.truth import exact_calibration
from hardware.frames import GimbalCommand
from hardware.rig import in_process
from hardware.simavr import nano as avr

ONSET, END = 1.0, 1.5
PLAY = 0.5  # °; backlash of 0.8° and dead band of 0.5° of shaft at 0.444 gimbal per shaft
KINDS = [Emulator] if avr.missing() else [Emulator, FirmwareRig]


def driven(fault, kind=Emulator, before=(3.0, -1.0), after=(-4.0, 2.0)):
    """True angles [°] half a second after a command changed and a fault began."""
    device = kind(reference_rig(), injections=(parse(f"{fault}@{ONSET}"),) if fault else ())
    rig = in_process(device, exact_calibration(reference_rig()))
    rig.connect()
    while device.time_us < END * 1e6:
        x, y = after if device.time_us > (ONSET + 0.01) * 1e6 else before
        rig.send(GimbalCommand(device.time_ns, (radians(x), radians(y))))
        device.advance_us(10_000)
        rig.poll()
    angle = np.degrees(device.truth()[0])
    rig.close()
    return angle


@pytest.mark.parametrize(
    ("fault", "angle"),
    [
        ("", (-4.0, 2.0)),
        ("servo_x:reversed", (4.0, 2.0)),
        ("servo_y:reversed", (-4.0, -2.0)),
        ("servos:swapped", (2.0, -4.0)),
        ("servo_x:jammed", (3.0, 2.0)),
        ("servo_y:dead", (-4.0, -1.0)),
        ("servo_x:hard_over:-60", (-10.0, 2.0)),  # the stop
        ("servo_y:slipped:9", (-4.0, 2.0 + 9 * 0.444)),
        ("servo_x:slow:0.02", (3.0 - 0.49 * 12.0 * 0.444, 2.0)),  # 2 % of 600°/s
        ("servo_x:contact:0.5", (3.0, 2.0)),  # the first second without power
    ],
)
def test_a_faulty_servo_goes_where_its_fault_says(fault, angle):
    np.testing.assert_allclose(driven(fault), angle, atol=PLAY)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_the_simulated_nano_has_the_same_faults(kind):
    np.testing.assert_allclose(driven("servo_x:jammed", kind), (3.0, 2.0), atol=PLAY)


@pytest.mark.parametrize(
    ("fault", "moved"),
    [
        ("potentiometers_x:slipped:5", (5.0, 5.0)),
        ("potentiometers_x:drift:-2", (-2.0, -2.0)),
        ("potentiometer_x_b:drift:2", (0.0, -2.0)),  # its own sense of rotation
        ("supply:droop:0.05", (-6.0, 6.0)),  # 5 % of half of 240°
    ],
)
def test_potentiometers_move_by_their_fault_after_a_second(fault, moved):
    device = Emulator(injections=(parse(f"{fault}@1"),))
    rig = in_process(device, exact_calibration(reference_rig()))
    rig.connect()
    angles = {}
    for time in (1.0, 2.0):
        readings = []
        while device.time_us < time * 1e6:
            device.advance_us(2000)
            readings += [f.potentiometer for f in rig.poll()]
        mean = np.mean(readings[-20:], axis=0)
        angles[time] = [rig.calibration.potentiometers[i].angle(mean[i]) for i in (0, 1)]
    # mean of 20 readings of 0.15°; the mean lags by 20 ms
    np.testing.assert_allclose(np.degrees(np.subtract(angles[2.0], angles[1.0])), moved, atol=0.25)


def test_gains_change_what_a_sensor_shows():
    plain, broken = (
        Emulator(injections=faults)
        for faults in ((), (parse("potentiometer_x_a:gain:0.1"), parse("gyro:gain:0.1")))
    )
    for device in (plain, broken):
        device.bench.set_pulses((1.7e-3, 1.5e-3, 1.5e-3))
        for _ in range(40):
            device.bench.advance(1e-3)
    a, b = (d.bench.potentiometer_codes()[0] - 512 for d in (plain, broken))
    assert b / a == pytest.approx(1.1, abs=0.1)  # ±2 codes of noise of 15 to 30
    p, q = (d.bench.imu_counts()[0] for d in (plain, broken))
    assert q / p == pytest.approx(1.1, abs=0.01)
    assert degrees(a / 1024 * radians(240)) > 3
