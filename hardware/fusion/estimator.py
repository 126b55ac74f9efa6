"""Sensor frames in, gimbal states out; knows which sensor is wrong and goes on without it."""

from collections.abc import Mapping
from dataclasses import replace
from math import cos, radians, sin, sqrt
from typing import Any

import numpy as np

from hardware.calibration.result import Calibration
from hardware.faults import POTENTIOMETERS, Monitor, Prediction, Reading, Remedy
from hardware.faults.memory import number
from hardware.frames import GimbalState, HardwareError, Pair, SensorFrame, Triple
from hardware.fusion.axis import (
    ANGLE,
    BIAS,
    LONGEST_STEP_US,
    RATE,
    Array,
    Noise,
    predict,
    process_noise,
    transition,
)
from hardware.fusion.axis import update as take_in
from hardware.fusion.base import BaseMap
from hardware.protocol import Flags

LARGEST, SLACK = 1e6, 1e-9  # of a remembered state, and of a covariance's negative eigenvalue
_KEPT_STEPS = 256
_MAP_ANGLE = radians(5.0)  # where a calibration's uncertainty is quoted


class Fusion:
    """Estimates both axes from one rig's frames.

    Parameters
    ----------
    calibration : maps from readings to angles
    noise : assumptions on sensors and motion
    base : map of the base's IMU where the base turns: its rate is then taken out of the holder's

    Attributes
    ----------
    x, P : states (2, 4) and covariances (2, 4, 4); see `axis`
    monitor : health of the sensors
    """

    def __init__(
        self,
        calibration: Calibration,
        noise: Noise | None = None,
        base: BaseMap | None = None,
    ) -> None:
        self.calibration = calibration
        self.base = base
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

    def snapshot(self) -> dict[str, object]:
        """Return everything this estimator remembers, as JSON values.

        With the frames that come after it, a fresh estimator that takes it up gives the same
        states to the last bit.
        """
        return {
            "gyro_delay": self.noise.gyro_delay,
            "last_us": self._last_us,
            "x": self.x.tolist(),
            "P": self.P.tolist(),
            "monitor": self.monitor.snapshot(),
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Take up what `snapshot` gave.

        Raises
        ------
        HardwareError : it is no such memory
        """
        try:
            x, P = (np.array(memory[k], dtype=np.float64) for k in ("x", "P"))
            if x.shape != (2, 4) or P.shape != (2, 4, 4):
                raise ValueError("states or covariances of another shape")
            if not (np.abs(x) < LARGEST).all() or not (np.abs(P) < LARGEST).all():
                raise ValueError("states or covariances that no filter has")
            if not all(np.linalg.eigvalsh(p + p.T)[0] > -SLACK * np.trace(p) for p in P):
                raise ValueError("a covariance that is none")
            last = memory["last_us"]
            self.set_gyro_delay(number(memory["gyro_delay"]))
            self._last_us = None if last is None else int(number(last))
            self.x[:], self.P[:] = x, P
            self.monitor.restore(memory["monitor"])
        except (KeyError, TypeError, ValueError, ArithmeticError) as error:
            raise HardwareError(f"no memory of a sensor fusion: {error}") from None

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
        return self.state(frame.time_ns)

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
            rate=self._rate(frame),
            fresh=bool(frame.flags & Flags.HOLDER_IMU),
        )

    def _rate(self, frame: SensorFrame) -> Pair:
        """What the holder's gyro says of the gimbal alone: x rate · cos y, and y rate [rad/s]."""
        x, y = self.calibration.gyro.rates(frame.gyro)
        if self.base is None:
            return x, y
        u, v = _on_holder(self.base.rate(frame.base_gyro), self.x[0, ANGLE], self.x[1, ANGLE])
        return x - u, y - v

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

    def state(self, time_ns: int) -> GimbalState:
        """Return the present estimate under a time stamp of the caller's [ns]."""
        (x, y), v = self.x.tolist(), self.P[:, ANGLE, ANGLE].tolist()
        sigma: Pair = (sqrt(v[0] + self._map_variance[0]), sqrt(v[1] + self._map_variance[1]))
        return GimbalState(
            time_ns=time_ns,
            angle=(x[ANGLE], y[ANGLE]),
            rate=(x[RATE], y[RATE]),
            sigma=sigma,
            healthy=self.monitor.healthy,
        )


def _on_holder(base: Triple, x: float, y: float) -> Pair:
    """Components along the holder's x and y of a rate of the base, gimbal at x, then y [rad]."""
    a, b, c = base
    across, along = cos(x) * b + sin(x) * c, cos(x) * c - sin(x) * b
    return cos(y) * a - sin(y) * along, across
