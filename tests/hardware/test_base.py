"""Attitude of a turning base from gyro and gravity: the textbook, a known motion, bad maps."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest

from hardware.calibration import nominal
from hardware.emulator.plant import AnalyticPlant
from hardware.frames import HardwareError, SensorFrame
from hardware.fusion import BaseAttitude, BaseMap, Fusion
from hardware.fusion.base import BaseNoise, tilt
from hardware.protocol import Flags

STILL = SensorFrame(
    time_ns=0, device_us=0, potentiometer=(0.5, 0.5, 0.5, 0.5), gyro=(0, 0, 0),
    accelerometer=(0, 0, -9.81), base_gyro=(0, 0, 0), base_accelerometer=(0, 0, -9.81),
    pulse=(1.5e-3,) * 3, switches=(False,) * 4, joystick=(0, 0),
    flags=int(Flags.BASE_IMU | Flags.HOLDER_IMU),
)  # fmt: skip


def frame(k, turn, rate, accelerometer_noise=0.0):
    seen = turn + accelerometer_noise
    return replace(
        STILL, device_us=2000 * k, base_gyro=(rate, 0.0, 0.0),
        base_accelerometer=(0.0, -9.80665 * sin(seen), -9.80665 * cos(seen)),
    )  # fmt: skip


def test_tilt_has_the_sign_of_the_turntables_angle():
    plant = AnalyticPlant()
    for _ in range(800):
        plant.advance(1e-3, (0.0, 0.0, 0.3))
    # dead band and backlash keep the servo within a degree of what it was asked
    assert tilt(plant.base_imu()[1]) == pytest.approx(0.3, abs=radians(1.0))


def test_it_is_the_textbook_filter():
    """With the rate as input, written out in NumPy: same angle and deviation to rounding."""
    n, rng = BaseNoise(), np.random.default_rng(3)
    ours = BaseAttitude(BaseMap(), n)
    x, P = np.zeros(2), np.diag([radians(0.1) ** 2, n.bias_sigma**2])
    H, dt = np.array([1.0, 0.0]), 0.002
    rates = rng.normal(0, 0.5, 300)
    for k, rate in enumerate(rates):
        now = replace(frame(k, 0.0, rate, rng.normal(0, 0.01)))
        if k:
            mean = 0.5 * (rate + rates[k - 1])
            walk = n.gyro**2 + (n.scale * mean) ** 2 * n.move
            F = np.array([[1.0, -dt], [0.0, 1.0]])
            x = F @ x + [mean * dt, 0.0]
            P = F @ P @ F.T + np.diag([walk * dt, n.bias**2 * dt])
        K = P @ H / (H @ P @ H + (n.tilt + n.lever * abs(rate)) ** 2)
        x = x + K * (tilt(now.base_accelerometer) - H @ x)
        P = (np.eye(2) - np.outer(K, H)) @ P
        ours.update(now)
        assert ours.angle == pytest.approx(x[0], abs=1e-12)
        assert ours.sigma**2 == pytest.approx(P[0, 0], rel=1e-9)


def test_a_known_motion_through_noise_and_bias_is_followed():
    rng = np.random.default_rng(1)
    filter_, errors, sigmas = BaseAttitude(BaseMap(gyro_bias=(0.05, 0, 0))), [], []
    for k in range(7500):
        t = 0.002 * k
        turn, rate = 0.2 * sin(1.5 * t), 0.3 * cos(1.5 * t)
        gyro = rate + 0.05 + radians(0.1) + rng.normal(0, radians(0.08))  # bias has moved since
        filter_.update(frame(k, turn, gyro, rng.normal(0, radians(0.4))))
        errors.append(filter_.angle - turn)
        sigmas.append(filter_.sigma)
    late = np.degrees(np.array(errors)[1000:])
    # gravity alone scatters by 0.4°, the gyro alone would be off by 1.5° after 15 s
    assert np.sqrt(np.mean(late**2)) < 0.1
    assert (abs(late) < 3 * np.degrees(np.array(sigmas)[1000:])).mean() > 0.9


def test_after_a_gap_gravity_alone_decides():
    filter_ = BaseAttitude(BaseMap())
    for k in range(50):
        filter_.update(frame(k, 0.0, 0.0))
    for k in range(300, 400):  # half a second of silence, and the base stands elsewhere
        filter_.update(frame(k, 0.3, 0.0))
    assert filter_.angle == pytest.approx(0.3, abs=radians(0.3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tilt": 0.5}, "tilt at neutral"),
        ({"tilt": float("nan")}, "tilt at neutral"),
        ({"gyro_bias": (0.0, 1.0, 0.0)}, "gyro bias"),
        ({"gyro_scale": 1.3}, "a scale of 1.30"),
        ({"tilt_scale": float("nan")}, "a scale of nan"),
        ({"gyro_bias": (0.0, 0.0, float("nan"))}, "gyro bias"),
        ({"travel": 0.0}, "is not a servo"),
        ({"travel": 1e-308}, "is not a servo"),
        ({"centre": float("inf")}, "is not a servo"),
    ],
)
def test_an_implausible_map_is_refused_in_one_line(change, message):
    with pytest.raises(HardwareError, match=message) as caught:
        replace(BaseMap(), **change)
    assert "\n" not in str(caught.value)


def rotation(x, y):
    rx = np.array([[1, 0, 0], [0, cos(x), -sin(x)], [0, sin(x), cos(x)]])
    ry = np.array([[cos(y), 0, sin(y)], [0, 1, 0], [-sin(y), 0, cos(y)]])
    return rx @ ry


def test_a_turning_base_is_taken_out_of_the_holders_gyro():
    """Rates by rotation matrices, the filter's gimbal standing at an angle while all turns."""
    fusion = Fusion(nominal(), base=BaseMap())
    x, y = 0.1, -0.15
    for axis, angle in enumerate((x, y)):
        fusion.filter.set_axis(axis, np.array([angle, 0, 0, 0]), np.eye(4))
    base, gimbal = np.array([0.4, -0.2, 0.3]), (0.7, -0.5)
    ring = rotation(0, y).T @ [gimbal[0], 0, 0]
    seen = rotation(x, y).T @ base + ring + [0, gimbal[1], 0]
    reading = replace(STILL, gyro=tuple(seen), base_gyro=tuple(base))
    rates, carried = fusion._rates(reading)
    np.testing.assert_allclose(rates, (gimbal[0] * cos(y), gimbal[1]), atol=1e-12)
    np.testing.assert_allclose(carried, (rotation(x, y).T @ base)[:2], atol=1e-12)


class TestSnapshot:
    def trained(self, frames=400):
        rng, fusion = np.random.default_rng(5), Fusion(nominal())
        for k in range(frames):
            fusion.update(self.reading(k, rng))
        return fusion, rng

    def reading(self, k, rng):
        pots = 0.5 + 0.01 * sin(0.01 * k) * np.array([1, -1, 1, -1]) + rng.normal(0, 5e-4, 4)
        return replace(
            STILL, device_us=2000 * k, potentiometer=tuple(pots.tolist()),
            gyro=tuple(rng.normal(0, 0.1, 3).tolist()),
        )  # fmt: skip

    def test_a_restored_estimator_continues_to_the_last_bit(self):
        import json

        fusion, rng = self.trained()
        other = Fusion(nominal())
        other.restore(json.loads(json.dumps(fusion.snapshot())))
        for k in range(400, 900):
            reading = self.reading(k, rng)
            assert fusion.update(reading) == other.update(reading)
        assert fusion.snapshot() == other.snapshot()

    def test_a_snapshot_of_an_earlier_version_is_restored(self):
        whole = self.trained(20)[0].snapshot()
        memory = self.trained(20)[0].snapshot()
        for axis in memory["monitor"]["axes"]:
            del axis["wandering"]
        fusion = Fusion(nominal())
        fusion.restore(memory)
        assert fusion.snapshot() == whole

    @pytest.mark.parametrize(
        "change",
        [
            lambda m: m.pop("x"),
            lambda m: m.update(x=[[0.0] * 4]),
            lambda m: m.update(P="no"),
            lambda m: m.update(last_us="soon"),
            lambda m: m.update(gyro_delay=None),
            lambda m: m["monitor"].update(time=float("nan")),
            lambda m: m["monitor"]["tracks"].pop(),
            lambda m: m["monitor"]["tracks"][0].update(state="happy"),
            lambda m: m["monitor"]["tracks"][0].update(kind="x" * 1000),
            lambda m: m["monitor"]["axes"][0].update(distance=[0.0]),
            lambda m: m["monitor"].update(axes=[]),
            lambda m: m.update(monitor=None),
            lambda m: m.update(last_us=10**400),
            lambda m: m.update(last_us=10**300),
            lambda m: m["monitor"]["tracks"][0].update(score=10**400),
            lambda m: m["monitor"]["axes"][0].update(free=1e200),
            lambda m: m.update(x=[[10**400] * 4] * 2),
            lambda m: m.update(P=(-np.array(m["P"])).tolist()),
            lambda m: m.update(P=(1e308 * np.sign(m["P"])).tolist()),
        ],
    )
    def test_an_invalid_snapshot_is_refused_in_one_line(self, change):
        memory = self.trained(20)[0].snapshot()
        change(memory)
        with pytest.raises(HardwareError, match="not a snapshot") as caught:
            Fusion(nominal()).restore(memory)
        assert "\n" not in str(caught.value)
