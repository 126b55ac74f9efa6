"""The filter against the textbook, against its own covariance, and against the better sensor."""

import time
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from hardware.calibration import nominal
from hardware.emulator import Emulator, sample_rig
from hardware.emulator.truth import exact_calibration
from hardware.faults.evidence import Reading, Remedy
from hardware.fusion import Fusion, Noise
from hardware.fusion.kalman import GimbalFilter, process_noise, transition
from hardware.rig import in_process
from tests.hardware.matched import run_matched
from tests.hardware.trial import random_steps, run


def _joseph(x, P, z, R, H):
    """Update of a Kalman filter in Joseph form, written out in NumPy."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    keep = np.eye(len(x)) - K @ H
    return x + K @ (z - H @ x), keep @ P @ keep.T + K @ R @ K.T


@pytest.mark.parametrize(
    "use",
    [
        (True,) * 6,
        (True, False, True, False, True, True),
        (False, False, True, True, True, False),
        (False, True, False, False, False, False),
        (False,) * 6,
    ],
)
def test_each_axis_equals_the_textbook_filter_over_many_frames(use):
    rng, noise, gain = np.random.default_rng(1), Noise(), (0.97, 1.0)
    kalman, rows = GimbalFilter(noise), np.array(use).reshape(2, 3)
    x, P = rng.standard_normal((2, 4)), np.stack([np.diag(rng.uniform(0.1, 1, 4)) for _ in "xy"])
    for k in (0, 1):
        kalman.set_axis(k, x[k], P[k])
    for _ in range(50):
        z, sigma, common = rng.standard_normal((2, 3)), rng.uniform(0.1, 1, (2, 3)), (0.009, -0.004)
        kalman.predict(2000)
        kalman.update(z.ravel(), (sigma**2).ravel(), common, gain[0], use)
        F, Q = transition(0.002, noise.gyro_delay), process_noise(0.002, noise)
        for k in (0, 1):
            x[k], P[k] = F @ x[k], F @ P[k] @ F.T + Q
            R = np.diag(sigma[k] ** 2)
            R[0, 1] = R[1, 0] = common[k]
            H = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, gain[k]]])[rows[k]]
            if rows[k].any():
                x[k], P[k] = _joseph(x[k], P[k], z[k][rows[k]], R[np.ix_(rows[k], rows[k])], H)
    # The same sums in another order; values are of order 1, and 50 frames of gyro rounding add up.
    np.testing.assert_allclose(kalman.x, x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(kalman.P, P, rtol=0, atol=1e-12)


def test_axes_stay_independent_to_the_last_bit():
    rng = np.random.default_rng(2)
    both, alone = GimbalFilter(Noise()), GimbalFilter(Noise())
    for f in (both, alone):
        for k in (0, 1):
            f.set_axis(k, np.zeros(4), np.eye(4))
    for _ in range(200):
        z = rng.standard_normal(6)
        both.predict(2000)
        both.update(z, (0.1,) * 6, (0.01, 0.02), 0.9, (True,) * 6)
        alone.predict(2000)
        alone.update(z * [1, 1, 1, 9, 9, 9], (0.1,) * 6, (0.01, 0.02), 0.9, (True,) * 6)
    np.testing.assert_array_equal(both.x[0], alone.x[0])
    assert not both._kalman.P[:4, 4:].any()


@pytest.mark.parametrize("dt", [0.0005, 0.002, 0.02])
def test_discretisation_equals_van_loans_matrix_exponential(dt):
    noise = Noise()
    tau, q = noise.gyro_delay, noise.acceleration
    A = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 1 / tau, 0, -1 / tau]], dtype=float)
    W = np.diag([0, q**2, noise.bias**2, 0])
    block = expm(np.block([[-A, W], [np.zeros((4, 4)), A.T]]) * dt)
    F = block[4:, 4:].T
    np.testing.assert_allclose(transition(dt, tau), F, atol=1e-12)
    np.testing.assert_allclose(process_noise(dt, noise), F @ block[:4, 4:], rtol=1e-8, atol=1e-12)


def test_no_delay_is_the_limit_of_a_short_one():
    noise, short = Noise(gyro_delay=0.0), Noise(gyro_delay=1e-9)
    np.testing.assert_allclose(
        process_noise(0.002, noise), process_noise(0.002, short), rtol=1e-5, atol=1e-12
    )


@pytest.mark.thorough
def test_nees_stays_in_its_band_over_100_seeds():
    seeds = 100
    mean = run_matched(seeds).mean(axis=0)
    low, high = chi2.ppf([0.025, 0.975], 3 * seeds) / seeds
    inside = ((mean > low) & (mean < high)).mean()
    # 95 % is expected; neighbouring instants are correlated, so 400 of them scatter by about 3 %.
    assert inside > 0.88
    assert mean.mean() == pytest.approx(3.0, abs=0.15)


@pytest.fixture(scope="module")
def healthy():
    return run(sample_rig(11), random_steps(11), 8.0, seed=11)


@pytest.mark.thorough
def test_fused_angle_is_twice_as_good_as_the_better_potentiometer(healthy):
    late = healthy.time > 2
    for axis in (0, 1):
        truth = healthy.true_angle[late, axis, None]
        pots = healthy.potentiometer[late][:, 2 * axis : 2 * axis + 2]
        better = np.sqrt(((pots - truth) ** 2).mean(axis=0)).min()
        assert healthy.error(2.0)[axis] < better / 2


def test_rate_follows_the_truth(healthy):
    late = healthy.time > 2
    error = np.sqrt(((healthy.rate - healthy.true_rate)[late] ** 2).mean())
    assert error < radians(4.0)  # of slews of 300 °/s: a delay of 2.8 ms left in would be 12 °/s


def test_bias_of_the_gyro_is_estimated(healthy):
    rest = (healthy.state[-1, :, 2] - healthy.true_bias[-1]) / np.sqrt(
        healthy.covariance[-1, :, 2, 2]
    )
    # Waviness of the potentiometers and the gyro's scale add to the stated deviation.
    assert np.abs(rest).max() < 6


def test_stated_sigma_is_of_the_order_of_the_error(healthy):
    ratio = healthy.error(2.0) / healthy.sigma[-1]
    assert (ratio > 0.2).all()
    assert (ratio < 4).all()


def test_a_healthy_rig_raises_no_alarm(healthy):
    assert healthy.changes == ()


def test_uncalibrated_rig_is_uncertain_but_not_faulty():
    trial = run(sample_rig(12), random_steps(12), 4.0, seed=12, calibration=nominal())
    assert trial.changes == ()
    assert trial.sigma.min() > radians(2.0)
    assert trial.error(1.0).max() < 3 * trial.sigma.max()


@pytest.fixture
def watched(monkeypatch):
    """A fusion of a sampled rig, the last frame it has taken, and what it gives its filter."""
    parameters = sample_rig(5)
    device = Emulator(parameters, seed=5)
    rig = in_process(device, exact_calibration(parameters))
    rig.connect()
    frames = []
    for _ in range(60):
        device.advance_us(1000)
        frames += rig.poll()
    given = {}
    monkeypatch.setattr(rig.fusion.filter, "update", lambda **values: given.update(values))
    return rig.fusion, frames[-1], given


def test_a_supply_error_moves_both_potentiometers_of_an_axis_by_their_stated_covariance(watched):
    """Against the covariance of angles read with 20 000 random errors of the common supply."""
    fusion, frame, given = watched
    after = replace(frame, device_us=frame.device_us + 2000)
    fusion.update(after)
    fraction = np.array(after.potentiometer)
    error = fusion.noise.supply * np.random.default_rng(0).standard_normal((20_000, 1))
    read = (1 + error) * fraction
    maps = fusion.calibration.potentiometers
    angles = np.array([[m.angle(f) for m, f in zip(maps, row, strict=True)] for row in read])
    for k in (0, 1):
        of_axis = np.cov(angles[:, 2 * k : 2 * k + 2], rowvar=False)
        # the variance of 20 000 scatters by 1 %
        assert given["covariance"][k] == pytest.approx(of_axis[0, 1], rel=0.05)
        assert of_axis[0, 1] < 0.0  # they turn in opposite senses
        apart = np.array(fusion._electrical[2 * k : 2 * k + 2])  # noise of each by itself
        stated = np.array(given["variance"][3 * k : 3 * k + 2])
        np.testing.assert_allclose(stated - apart, np.diag(of_axis), rtol=0.05)


@pytest.mark.parametrize("angle", [0.0, 0.15, -0.15])
def test_the_ring_turns_the_tilted_gyro_by_the_cosine_of_the_tilt(watched, angle):
    fusion, frame, given = watched
    fusion.filter.set_axis(1, np.array([angle, 0.0, 0.0, 0.0]), fusion.filter.P[1])
    fusion.update(replace(frame, device_us=frame.device_us + 2000))
    of_ring = Rotation.from_euler("y", angle).inv().apply([1.0, 0.0, 0.0])
    assert given["gyro_gain"] == pytest.approx(of_ring[0], abs=1e-9)


def test_gap_restarts_the_filter():
    parameters = sample_rig(2)
    device = Emulator(parameters, seed=2)
    rig = in_process(device, exact_calibration(parameters))
    rig.connect()
    for _ in range(500):
        device.advance_us(1000)
        rig.poll()
    device.advance_us(600_000)
    device.read()  # half a second is lost
    for _ in range(400):
        device.advance_us(1000)
        rig.poll()
    truth, _ = device.truth()
    assert rig.state is not None
    # 0.3 s of fresh potentiometers: 0.16°/√150, waviness 0.05°, bias still unknown
    assert np.abs(np.subtract(rig.state.angle, truth)).max() < radians(0.15)


@pytest.mark.bench
def test_fusion_of_a_frame_costs_less_than_75_microseconds():
    parameters = sample_rig(0)
    device = Emulator(parameters)
    rig = in_process(device)
    rig.connect()
    frames = []
    while len(frames) < 1500:
        device.advance_us(2000)
        frames += rig.poll()
    fusion = Fusion(exact_calibration(parameters))
    spent = []
    for frame in frames:
        start = time.perf_counter()
        fusion.update(frame)
        spent.append(time.perf_counter() - start)
    assert np.median(spent) < 75e-6


@pytest.mark.parametrize("sensor", range(6))
def test_a_sensor_left_out_does_not_move_the_estimate_and_every_other_does(sensor):
    """`sensor` is one of both potentiometers and the gyro of x, then those of y."""
    axis, kind = divmod(sensor, 3)
    used = [k != (2 * axis + kind) for k in range(4)] if kind < 2 else [True] * 4
    gyro = [kind < 2 or k != axis for k in range(2)]
    moved = []
    for remedy in (Remedy((True,) * 4, (True,) * 2), Remedy(tuple(used), tuple(gyro))):
        fusion = Fusion(nominal())
        for k in range(2):
            fusion.filter.set_axis(k, np.zeros(4), np.diag([1e-4, 1.0, 1e-6, 1.0]))
        angle, rate = [0.0] * 4, [0.0] * 2
        if kind < 2:
            angle[2 * axis + kind] = 0.01
        else:
            rate[axis] = 0.1
        fusion._absorb(_reading(tuple(angle), tuple(rate)), remedy)
        moved.append(float(np.abs(np.asarray(fusion.filter.x)).max()))
    assert moved[0] > 1e-4
    assert moved[1] == 0.0


def test_a_tilt_that_an_uncertain_estimate_does_not_contradict_counts_as_rest():
    fusion = Fusion(replace(nominal(), minimal=True))
    for k in range(2):
        fusion.filter.set_axis(k, np.zeros(4), np.diag([radians(2.0) ** 2, 1.0, 1e-6, 1.0]))
    far = _reading((radians(4.0),) * 4, (0.0, 0.0))  # 3 σ of both together are 6.2 degrees
    for _ in range(40):
        variance = fusion._tilt(far)
    assert variance == pytest.approx(radians(0.5) ** 2)
    for k in range(2):
        fusion.filter.set_axis(k, np.zeros(4), np.diag([radians(0.1) ** 2, 1.0, 1e-6, 1.0]))
    assert fusion._tilt(far) == pytest.approx(radians(20.0) ** 2)


def _reading(angle, rate):
    """A frame of a gimbal at rest but for `angle` [rad] and `rate` [rad/s]."""
    return Reading(0.002, (0.5,) * 4, angle, (1.0,) * 4, (0.0,) * 3, rate)
