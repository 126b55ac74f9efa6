"""Truth drawn from the filter's own model by independent means: fine steps and a real quantiser."""

from math import exp, radians

import numpy as np

from hardware.fusion.axis import Noise, predict, process_noise, transition, update

FINE = 100  # steps per frame: what a step of 20 µs leaves out is 3 % of the gyro's variance
FRAME = 0.002
LSB = radians(240.0) / 1024


def run_matched(seeds, frames=400, seed=0):
    """Return the NEES of (angle, rate, bias) (seeds, frames).

    Truth is integrated in steps of 20 µs with the rate straight between them, the gyro's low-pass
    exactly for such a rate, and the potentiometers go through a 10-bit quantiser: none of the
    filter's matrices makes the data.
    """
    n = Noise()
    rng = np.random.default_rng(seed)
    spread = np.array([radians(0.3), 0.5, radians(2.0), 0.5])
    x = spread * rng.standard_normal((seeds, 4))
    estimate, P = np.zeros((seeds, 4)), np.tile(np.diag(spread**2), (seeds, 1, 1))
    F, Q = transition(FRAME, n.gyro_delay), process_noise(FRAME, n)
    gyro_sigma = n.gyro / FRAME**0.5
    R = np.diag([n.potentiometer * radians(240.0)] * 2 + [gyro_sigma]) ** 2
    R = np.tile(R, (seeds, 1, 1))
    gain, use = np.ones(seeds), np.ones((seeds, 3), dtype=bool)
    out = np.empty((seeds, frames))
    for k in range(frames):
        _move(x, n, rng)
        predict(estimate, P, F, Q)
        volts = x[:, :1] + rng.normal(0, 0.6 * LSB, (seeds, 2))
        pots = (np.floor(volts / LSB) + 0.5) * LSB
        gyro = x[:, 3] + x[:, 2] + rng.normal(0, gyro_sigma, seeds)
        update(estimate, P, np.column_stack([pots, gyro]), R, gain, use)
        e = (estimate - x)[:, :3]
        out[:, k] = np.einsum("ni,ni->n", e, np.linalg.solve(P[:, :3, :3], e[:, :, None])[:, :, 0])
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
