"""Data sampled from the filter's own model by independent means: fine steps, a real quantiser."""

from math import exp, radians

import numpy as np

from hardware.fusion.kalman import GimbalFilter, Noise

FINE = 100  # steps per frame: what a step of 20 µs leaves out is 3 % of the gyro's variance
FRAME_US = 2000
FRAME = FRAME_US * 1e-6
LSB = radians(240.0) / 1024


def run_matched(seeds, frames=400, seed=0):
    """Return the NEES of (angle, rate, bias) (seeds, frames).

    Truth is integrated in steps of 20 µs with the rate straight between them, the gyro's low-pass
    exactly for such a rate, and the potentiometers go through a 10-bit quantiser: none of the
    filter's matrices makes the data. The two axes of a filter serve two seeds, an even number.
    """
    n = Noise()
    rng = np.random.default_rng(seed)
    spread = np.array([radians(0.3), 0.5, radians(2.0), 0.5])
    x = spread * rng.standard_normal((seeds, 4))
    filters = [GimbalFilter(n) for _ in range(seeds // 2)]
    for f in filters:
        for axis in (0, 1):
            f.set_axis(axis, np.zeros(4), np.diag(spread**2))
    gyro_sigma = n.gyro / FRAME**0.5
    variance = (np.array([n.potentiometer * radians(240.0)] * 2 + [gyro_sigma]) ** 2).tolist() * 2
    out = np.empty((seeds, frames))
    for k in range(frames):
        _move(x, n, rng)
        volts = x[:, :1] + rng.normal(0, 0.6 * LSB, (seeds, 2))
        pots = (np.floor(volts / LSB) + 0.5) * LSB
        gyro = x[:, 3] + x[:, 2] + rng.normal(0, gyro_sigma, seeds)
        z = np.column_stack([pots, gyro]).reshape(-1, 6).tolist()
        for f, measured in zip(filters, z, strict=True):
            f.predict(FRAME_US)
            f.update(measured, variance, (0.0, 0.0), 1.0, (True,) * 6)
        e = (np.concatenate([f.x for f in filters]) - x)[:, :3]
        P = np.concatenate([f.P for f in filters])[:, :3, :3]
        out[:, k] = np.einsum("ni,ni->n", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])
    return out


def _move(x, n, rng):
    dt = FRAME / FINE
    e = exp(-dt / n.gyro_delay)
    ramp = 1 - (1 - e) * n.gyro_delay / dt
    for kick in n.acceleration * dt**0.5 * rng.standard_normal((FINE, len(x))):
        x[:, 3] = e * x[:, 3] + (1 - e) * x[:, 1] + ramp * kick
        x[:, 0] += dt * (x[:, 1] + kick / 2)
        x[:, 1] += kick
    x[:, 2] += n.bias * FRAME**0.5 * rng.standard_normal(len(x))
