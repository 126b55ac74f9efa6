"""Sensor frames to gimbal states; leaves out sensors that the fault monitor has named."""

from collections.abc import Mapping
from math import cos, hypot, radians, sin, sqrt
from typing import Any

import numpy as np

from hardware.calibration.result import Calibration
from hardware.faults import (
    POTENTIOMETERS,
    Actuation,
    Monitor,
    Prediction,
    Reading,
    Remedy,
    ServoLimits,
)
from hardware.faults.memory import number
from hardware.frames import GimbalState, HardwareError, Pair, SensorFrame, Triple
from hardware.fusion.base import BaseMap
from hardware.fusion.commands import Commands, tolerances
from hardware.fusion.kalman import (
    ANGLE,
    BIAS,
    LONGEST_STEP_US,
    RATE,
    STATES,
    GimbalFilter,
    Noise,
)
from hardware.parts import GYRO_SCALE_ERROR, tilts
from hardware.protocol import Flags

LARGEST, SLACK = 1e6, 1e-9  # of a restored state, and of a covariance's negative eigenvalue
_HOLDER_IMU = int(Flags.HOLDER_IMU)  # an enum's `&` takes 1 µs
# Of a rig without potentiometers: 0.28° by the data sheet's 400 µg/√Hz behind the low-pass, twice,
# because the low-pass correlates readings; in motion the holder accelerates as well
RESTING, TRAVELLING = radians(0.5), radians(20.0)
MOVING, SETTLED, GATE = radians(4.0), 0.06, 3.0  # rad/s, s, σ
# Of the base's gyro: the mean of two scales, each uniform within its tolerance, see `measure_base`.
BASE_SCALE = GYRO_SCALE_ERROR / sqrt(6.0)
_MAP_ANGLE = radians(5.0)  # at which a calibration's uncertainty is evaluated


class Fusion:
    """Estimates both axes from one rig's frames.

    Parameters
    ----------
    calibration : maps from readings to angles
    noise : assumptions on sensors and motion
    base : map of the base's IMU where the base turns: its rate is then taken out of the holder's
    servos : limits of the servos; those of hobby servos if omitted

    Attributes
    ----------
    filter : states and covariances of both axes
    monitor : health of sensors and servos
    """

    def __init__(
        self,
        calibration: Calibration,
        noise: Noise | None = None,
        base: BaseMap | None = None,
        servos: ServoLimits | None = None,
    ) -> None:
        self.calibration = calibration
        self.base = base
        self.filter = GimbalFilter(noise or Noise())
        limits = servos or ServoLimits()
        actuation = Actuation(tolerances(calibration, limits), limits)
        self.monitor = Monitor(actuation=actuation, minimal=calibration.minimal)
        self._moved = 0.0  # s since the gimbal moved, of a rig without potentiometers
        self._commands = Commands(calibration)
        self._last_us: int | None = None
        sigmas = [calibration.potentiometer_sigma(i, _MAP_ANGLE) for i in range(POTENTIOMETERS)]
        self._tolerance = (3 * sigmas[0], 3 * sigmas[1], 3 * sigmas[2], 3 * sigmas[3])
        a, b, c, d = (
            3 * m.covariance[1][1] ** 0.5 / abs(m.gain) for m in calibration.potentiometers
        )
        self._slope = (a, b, c, d)
        self._gyro_scale = 3 * hypot(calibration.gyro.sigma, BASE_SCALE) if base else 0.0
        self._own_variance = [s * s for s in sigmas]
        self._map_variance = (sigmas[0] * sigmas[1], sigmas[2] * sigmas[3])
        gains = [m.gain for m in calibration.potentiometers]
        self._gains = (gains[0], gains[1], gains[2], gains[3])
        self._electrical = [(self.noise.potentiometer * g) ** 2 for g in gains]

    @property
    def noise(self) -> Noise:
        """Assumptions on sensors and motion."""
        return self.filter.noise

    def set_gyro_delay(self, delay: float) -> None:
        """Set the delay of the gyro's low-pass plus the age of its reading in a frame [s]."""
        self.filter.set_gyro_delay(delay)

    def restart(self) -> None:
        """Restart the filter with the next frame."""
        self._last_us = None

    def snapshot(self) -> dict[str, object]:
        """Return the whole state of this estimator, as JSON values.

        A new estimator that restores it gives the same states for the following frames, to the
        last bit.
        """
        return {
            "gyro_delay": self.noise.gyro_delay,
            "last_us": self._last_us,
            "moved": self._moved,
            "x": self.filter.x.tolist(),
            "P": self.filter.P.tolist(),
            "monitor": self.monitor.snapshot(),
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Restore the state from a `snapshot`.

        Raises
        ------
        HardwareError : it is not a snapshot
        """
        try:
            x, P = (np.array(memory[k], dtype=np.float64) for k in ("x", "P"))
            if x.shape != (2, 4) or P.shape != (2, 4, 4):
                raise ValueError("states or covariances of another shape")
            if not (np.abs(x) < LARGEST).all() or not (np.abs(P) < LARGEST).all():
                raise ValueError("states or covariances out of range")
            if not all(np.linalg.eigvalsh(p + p.T)[0] > -SLACK * np.trace(p) for p in P):
                raise ValueError("a matrix that is not a covariance")
            last = memory["last_us"]
            self.set_gyro_delay(number(memory["gyro_delay"]))
            self._last_us = None if last is None else int(number(last))
            self._moved = number(memory.get("moved", 0.0))
            for k in range(2):
                self.filter.set_axis(k, x[k], P[k])
            self.monitor.restore(memory["monitor"])
        except (KeyError, TypeError, ValueError, ArithmeticError) as error:
            raise HardwareError(f"not a snapshot of a sensor fusion: {error}") from None

    def update(self, frame: SensorFrame) -> GimbalState:
        """Return the gimbal's state at the frame's time stamp."""
        dt_us = 0 if self._last_us is None else frame.device_us - self._last_us
        reading = self._reading(frame, dt_us)
        if self._last_us is None or not 0 < dt_us <= LONGEST_STEP_US:
            self._start(reading)
        else:
            self.filter.predict(dt_us)
        self._last_us = frame.device_us
        self._absorb(reading, self.monitor.inspect(reading, self._prediction(reading)))
        return self.state(frame.time_ns)

    def _reading(self, frame: SensorFrame, dt_us: int) -> Reading:
        a, b, c, d = self.calibration.potentiometers
        f = frame.potentiometer
        if self.calibration.minimal:
            x, y = tilts(frame.accelerometer)
            f = x, x, y, y
        rate, carried = self._rates(frame)
        return Reading(
            dt_us * 1e-6,
            f,
            (a.angle(f[0]), b.angle(f[1]), c.angle(f[2]), d.angle(f[3])),
            self._gains,
            frame.gyro,
            rate,
            bool(frame.flags & _HOLDER_IMU),
            self._commands.angles(frame),
            frame.switches,
            frame.accelerometer,
            frame.base_accelerometer,
            carried,
            self.base.turn(frame.base_accelerometer) if self.base else 0.0,
        )

    def _rates(self, frame: SensorFrame) -> tuple[Pair, Pair]:
        """The gimbal's own rates by the holder's gyro, x · cos y and y, and the base's [rad/s]."""
        x, y = self.calibration.gyro.rates(frame.gyro)
        if self.base is None:
            return (x, y), (0.0, 0.0)
        state = self.filter.state
        u, v = _on_holder(self.base.rate(frame.base_gyro), state[ANGLE], state[STATES + ANGLE])
        return (x - u, y - v), (u, v)

    def _start(self, reading: Reading) -> None:
        wired = self.monitor.begin(reading)
        self._moved = -reading.dt  # `_tilt` adds it: a gap is no rest
        rate = radians(300.0)
        for k in range(2):
            angles = [reading.angle[i] for i in (2 * k, 2 * k + 1) if wired[i]]
            sigma = radians(0.5) if angles else radians(10.0)
            if self.calibration.minimal:
                sigma = radians(10.0)  # it may be moving
            angle = sum(angles) / len(angles) if angles else 0.0
            bias = self.calibration.gyro.bias_sigma
            P = np.diag([sigma**2, rate**2, bias**2, rate**2])
            self.filter.set_axis(k, np.array([angle, 0.0, 0.0, 0.0]), P)

    def _prediction(self, reading: Reading) -> Prediction:
        x, n = self.filter.state, self.noise
        px, py = self.filter.angle_variance()
        s2 = n.supply**2
        v = [
            e + s2 * (f * g) ** 2 + own
            for e, f, g, own in zip(
                self._electrical, reading.fraction, self._gains, self._own_variance, strict=True
            )
        ]
        return Prediction(
            (x[ANGLE], x[STATES + ANGLE]),
            (x[RATE], x[STATES + RATE]),
            (x[BIAS], x[STATES + BIAS]),
            (v[0] + px, v[1] + px, v[2] + py, v[3] + py),
            self._tolerance,
            self._slope,
            n.gyro_delay,
            self._gyro_scale,
        )

    def _absorb(self, reading: Reading, remedy: Remedy) -> None:
        n, x = self.noise, self.filter.state
        for k, forget in enumerate(remedy.forget):
            if forget is not None:
                self.filter.widen(k, *forget)
        supply = remedy.supply_sigma if remedy.supply_sigma > 0 else n.supply
        # A supply error ε turns a reading f into (1+ε)f: both potentiometers err together.
        a, b, c, d = [supply * f * g for f, g in zip(reading.fraction, self._gains, strict=True)]
        va, vb, vc, vd = self._electrical
        if self.calibration.minimal:
            a = b = c = d = 0.0
            va = vc = self._tilt(reading)
        scale, walk = self.calibration.gyro.sigma, n.gyro**2 / max(reading.dt, 1e-3)
        p, q = reading.carried  # the holder's gyro turns with the base as well
        vx = walk + (scale * (x[RATE] + p)) ** 2 + (BASE_SCALE * p) ** 2
        vy = walk + (scale * (x[STATES + RATE] + q)) ** 2 + (BASE_SCALE * q) ** 2
        angle, rate, use, gyro = reading.angle, reading.rate, remedy.use, remedy.use_gyro
        self.filter.update(
            z=(angle[0], angle[1], rate[0], angle[2], angle[3], rate[1]),
            variance=(va + a * a, vb + b * b, vx, vc + c * c, vd + d * d, vy),
            covariance=(a * b, c * d),
            gyro_gain=cos(x[STATES + ANGLE]),
            use=(use[0], use[1], gyro[0], use[2], use[3], gyro[1]),
        )

    def _tilt(self, reading: Reading) -> float:
        """Variance of the accelerometer's tilt [rad²]: in motion it shows the motion as well.

        A beginning motion shows there before the gyro's low-pass has passed it.
        """
        x = self.filter.state
        pace = max(abs(v) for v in x[RATE::STATES])
        away = max(abs(reading.angle[2 * k] - x[STATES * k + ANGLE]) for k in range(2))
        bound = GATE * sqrt(RESTING**2 + max(self.filter.angle_variance()))
        still = pace < MOVING and away < bound
        self._moved = self._moved + reading.dt if still else 0.0
        sigma = RESTING if self._moved > SETTLED else TRAVELLING
        return sigma * sigma

    def state(self, time_ns: int) -> GimbalState:
        """Return the present estimate with a time stamp [ns]."""
        x, v = self.filter.state, self.filter.angle_variance()
        sigma: Pair = (sqrt(v[0] + self._map_variance[0]), sqrt(v[1] + self._map_variance[1]))
        return GimbalState(
            time_ns=time_ns,
            angle=(x[ANGLE], x[STATES + ANGLE]),
            rate=(x[RATE], x[STATES + RATE]),
            sigma=sigma,
            healthy=self.monitor.healthy,
        )


def _on_holder(base: Triple, x: float, y: float) -> Pair:
    """Components along the holder's x and y of a rate of the base, gimbal at x, then y [rad]."""
    a, b, c = base
    across, along = cos(x) * b + sin(x) * c, cos(x) * c - sin(x) * b
    return cos(y) * a - sin(y) * along, across
