"""Sensor frames in, gimbal states out; knows which sensor is wrong and goes on without it."""

from dataclasses import replace
from math import cos, radians, sqrt

import numpy as np

from hardware.calibration.result import Calibration
from hardware.faults import POTENTIOMETERS, Monitor, Prediction, Reading, Remedy
from hardware.frames import GimbalState, Pair, SensorFrame
from hardware.fusion.axis import ANGLE, BIAS, RATE, Array, Noise, predict, process_noise, transition
from hardware.fusion.axis import update as take_in
from hardware.protocol import Flags

LONGEST_STEP_US = 200_000  # after a longer gap the filter starts afresh
_KEPT_STEPS = 256
_MAP_ANGLE = radians(5.0)  # where a calibration's uncertainty is quoted


class Fusion:
    """Estimates both axes from one rig's frames.

    Parameters
    ----------
    calibration : maps from readings to angles
    noise : assumptions on sensors and motion

    Attributes
    ----------
    x, P : states (2, 4) and covariances (2, 4, 4); see `axis`
    monitor : health of the sensors
    """

    def __init__(self, calibration: Calibration, noise: Noise | None = None) -> None:
        self.calibration = calibration
        self.noise = noise or Noise()
        self.monitor = Monitor()
        self.x, self.P = np.zeros((2, 4)), np.zeros((2, 4, 4))
        self._z, self._R = np.zeros((2, 3)), np.zeros((2, 3, 3))
        self._gain, self._use = np.ones(2), np.ones((2, 3), dtype=bool)
        self._steps: dict[int, tuple[Array, Array]] = {}
        self._last_us: int | None = None
        sigmas = [calibration.potentiometer_sigma(i, _MAP_ANGLE) for i in range(POTENTIOMETERS)]
        self._tolerance = (3 * sigmas[0], 3 * sigmas[1], 3 * sigmas[2], 3 * sigmas[3])
        self._own_variance = [s * s for s in sigmas]
        self._map_variance = (sigmas[0] * sigmas[1], sigmas[2] * sigmas[3])
        gains = [m.gain for m in calibration.potentiometers]
        self._gains = (gains[0], gains[1], gains[2], gains[3])

    def set_gyro_delay(self, delay: float) -> None:
        """Tell the delay of the gyro's low-pass plus the age of its reading in a frame [s]."""
        self.noise = replace(self.noise, gyro_delay=delay)
        self._steps.clear()

    def restart(self) -> None:
        """Forget the past; the next frame begins anew."""
        self._last_us = None

    def update(self, frame: SensorFrame) -> GimbalState:
        """Return the gimbal's state at the frame's time stamp."""
        dt_us = 0 if self._last_us is None else frame.device_us - self._last_us
        reading = self._reading(frame, dt_us)
        if self._last_us is None or not 0 < dt_us <= LONGEST_STEP_US:
            self._start(reading)
        else:
            predict(self.x, self.P, *self._step(dt_us))
        self._last_us = frame.device_us
        self._absorb(reading, self.monitor.inspect(reading, self._prediction(reading)))
        return self._state(frame.time_ns)

    def _step(self, dt_us: int) -> tuple[Array, Array]:
        step = self._steps.get(dt_us)
        if step is None:
            dt = dt_us * 1e-6
            step = transition(dt, self.noise.gyro_delay), process_noise(dt, self.noise)
            if len(self._steps) < _KEPT_STEPS:
                self._steps[dt_us] = step
        return step

    def _reading(self, frame: SensorFrame, dt_us: int) -> Reading:
        a, b, c, d = self.calibration.potentiometers
        f = frame.potentiometer
        return Reading(
            dt=dt_us * 1e-6,
            fraction=f,
            angle=(a.angle(f[0]), b.angle(f[1]), c.angle(f[2]), d.angle(f[3])),
            gain=self._gains,
            gyro=frame.gyro,
            rate=self.calibration.gyro.rates(frame.gyro),
            fresh=bool(frame.flags & Flags.HOLDER_IMU),
        )

    def _start(self, reading: Reading) -> None:
        wired = self.monitor.begin(reading)
        rate = radians(300.0)
        for k in range(2):
            angles = [reading.angle[i] for i in (2 * k, 2 * k + 1) if wired[i]]
            sigma = radians(0.5) if angles else radians(10.0)
            self.x[k] = (sum(angles) / len(angles) if angles else 0.0, 0.0, 0.0, 0.0)
            bias = self.calibration.gyro.bias_sigma
            self.P[k] = np.diag([sigma**2, rate**2, bias**2, rate**2])

    def _prediction(self, reading: Reading) -> Prediction:
        (x, y), n = self.x.tolist(), self.noise
        px, py = self.P[:, ANGLE, ANGLE].tolist()
        v = [
            gain * gain * (n.potentiometer**2 + (n.supply * fraction) ** 2) + own
            for gain, fraction, own in zip(
                reading.gain, reading.fraction, self._own_variance, strict=True
            )
        ]
        return Prediction(
            angle=(x[ANGLE], y[ANGLE]),
            rate=(x[RATE], y[RATE]),
            bias=(x[BIAS], y[BIAS]),
            variance=(v[0] + px, v[1] + px, v[2] + py, v[3] + py),
            tolerance=self._tolerance,
            gyro_delay=n.gyro_delay,
        )

    def _absorb(self, reading: Reading, remedy: Remedy) -> None:
        n = self.noise
        supply = remedy.supply_sigma if remedy.supply_sigma > 0 else n.supply
        walk = n.gyro**2 / max(reading.dt, 1e-3)
        self._gain[0] = cos(self.x[1, ANGLE])
        for k in range(2):
            forget = remedy.forget[k]
            if forget is not None:
                self.P[k, ANGLE, ANGLE] += forget[0] ** 2
                self.P[k, BIAS, BIAS] += forget[1] ** 2
            a, b = 2 * k, 2 * k + 1
            self._z[k] = (reading.angle[a], reading.angle[b], reading.rate[k])
            self._use[k] = (remedy.use[a], remedy.use[b], remedy.use_gyro[k])
            # A supply error ε turns a reading f into (1+ε)f: both potentiometers err together.
            sa = supply * reading.fraction[a] * reading.gain[a]
            sb = supply * reading.fraction[b] * reading.gain[b]
            R = self._R[k]
            R[0, 0] = (n.potentiometer * reading.gain[a]) ** 2 + sa * sa
            R[1, 1] = (n.potentiometer * reading.gain[b]) ** 2 + sb * sb
            R[0, 1] = R[1, 0] = sa * sb
            R[2, 2] = walk + (self.calibration.gyro.sigma * self.x[k, RATE]) ** 2
        take_in(self.x, self.P, self._z, self._R, self._gain, self._use)

    def _state(self, time_ns: int) -> GimbalState:
        (x, y), v = self.x.tolist(), self.P[:, ANGLE, ANGLE].tolist()
        sigma: Pair = (sqrt(v[0] + self._map_variance[0]), sqrt(v[1] + self._map_variance[1]))
        return GimbalState(
            time_ns=time_ns,
            angle=(x[ANGLE], y[ANGLE]),
            rate=(x[RATE], y[RATE]),
            sigma=sigma,
            healthy=self.monitor.healthy,
        )
