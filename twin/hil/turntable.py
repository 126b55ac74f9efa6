"""A turntable that reproduces the vehicle's rotation, and the attitude measured by its IMU.

One servo turns the base of the rig by the simulated rotation about the x axis of the launch. For
that rotation the controller gets the estimate from gyro and accelerometer on the base; for the
other axes it gets the simulated values.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hardware.events import Event, Level
from hardware.frames import GimbalCommand, HardwareError, Pair, SensorFrame, Triple
from hardware.fusion import BaseAttitude, BaseMap
from hardware.fusion.base import tilt
from hardware.protocol import Flags, constants
from twin.hil.gimbal import COMMAND_NS, SILENT_S, RigGimbal
from twin.plant.plant import Plant

Array = NDArray[np.float64]

SWING_S = 200e-6  # s of pulse either way, 19° of a hobby servo
STOPS = (0.0, SWING_S, -SWING_S, 0.0)
HOLD_NS, SAMPLE_NS = 800_000_000, 300_000_000  # at a stop, and the last part of it that counts
NEUTRAL_S = constants.PULSE_NEUTRAL * constants.TICK
FROZEN = 25  # equal gyro readings in a row; noise changes the last digit of a working one
OFF_TARGET, OFF_TARGET_S = math.radians(10.0), 0.3  # from the commanded angle, and for how long
LEAST_TURN = 0.4  # of the rotation that the pulses command of a nominal servo
FEWEST = 20  # frames of a sample


def measure_base(seat: RigGimbal) -> BaseMap:
    """Turn the base to three angles and fit the map of its servo and its IMU; blocks for 3 s.

    Raises
    ------
    HardwareError : no readings, or the base does not turn; says what to check
    """
    samples, turned = [], []
    before: list[SensorFrame] = []
    for stop in STOPS:
        frames = _held(seat, NEUTRAL_S + stop)
        sample = [f for f in frames if f.time_ns > frames[-1].time_ns - SAMPLE_NS] if frames else []
        if len(sample) < FEWEST:
            raise HardwareError("the rig sends no readings while its turntable is measured")
        samples.append(sample)
        turned.append(before + frames)
        before = sample
    tilts = np.array([np.mean([tilt(f.base_accelerometer) for f in sample]) for sample in samples])
    still = np.array([f.base_gyro for sample in samples for f in sample]).mean(axis=0)
    usual = BaseMap().travel
    if np.ptp(tilts) < LEAST_TURN * 2 * SWING_S * usual:
        raise HardwareError(
            f"the base turned {math.degrees(float(np.ptp(tilts))):.1f}° of the"
            f" {math.degrees(2 * SWING_S * usual):.0f}° commanded; check pin and power of the"
            " turntable servo, and that the base IMU at 0x69 is mounted on the base"
        )
    by_gyro = np.array([_turn(frames, float(still[0])) for frames in turned[1:]])
    by_gravity = np.diff(tilts)
    ratio = float(by_gravity @ by_gyro / (by_gyro @ by_gyro))
    # Both scales are accurate to 3 % (product specification 6.1, 6.2): their mean is taken as true.
    tilt_scale = 0.5 * (1.0 + 1.0 / ratio)
    slope, zero = np.polyfit(np.array(STOPS), tilts, 1)
    a, b, c = still.tolist()
    return BaseMap(
        tilt=float(zero),
        gyro_bias=(a, b, c),
        gyro_scale=0.5 * (1.0 + ratio),
        tilt_scale=tilt_scale,
        centre=NEUTRAL_S,
        travel=float(slope) * tilt_scale,
    )


def _held(seat: RigGimbal, pulse: float) -> list[SensorFrame]:
    """Frames while the base is held at a pulse width and the gimbal at zero."""
    frames: list[SensorFrame] = []
    begin = seat.now_ns()
    while (now := seat.now_ns()) - begin < HOLD_NS:
        seat.rig.send(GimbalCommand(now, (0.0, 0.0)), pulse)
        seat.wait(COMMAND_NS)
        frames += seat.rig.poll()
    return frames


def _turn(frames: Sequence[SensorFrame], bias: float) -> float:
    """Rotation about x by the gyro from the first sample to the last, mean of each [rad]."""
    time = np.array([f.device_us for f in frames]) * 1e-6
    rate = np.array([f.base_gyro[0] for f in frames]) - bias
    turned = np.concatenate([[0.0], np.cumsum(np.diff(time) * 0.5 * (rate[1:] + rate[:-1]))])
    sample = SAMPLE_NS * 1e-9
    first, last = time <= time[0] + sample, time >= time[-1] - sample
    return float(turned[last].mean() - turned[first].mean())


@dataclass(frozen=True)
class TurntableLimit(Event):
    """The vehicle has turned further than the turntable reaches.

    Attributes
    ----------
    turn, reach : turn of the vehicle, and the largest of the turntable [rad]
    """

    level: ClassVar[Level] = "WARN"
    turn: float
    reach: float

    @property
    def text(self) -> str:
        """Both angles in degrees."""
        turn, reach = math.degrees(self.turn), math.degrees(self.reach)
        return f"{turn:.0f}° requested of the turntable, which reaches {reach:.0f}°"


class Turntable:
    """The attitude seat of a rig on a turntable; `update` is called once a tick after the poll.

    Parameters
    ----------
    plant : of the vehicle whose rotation is reproduced
    seat : the rig
    base : map of its base
    lead : feed-forward per rate [s] and per acceleration [s²], for the lag of the servo
    period : between two updates [s]

    Attributes
    ----------
    attitude, rate : of the vehicle as estimated, (4,) wxyz and (3,) in body axes [rad/s]
    simulated, measured, sigma : (1,) rotation about the launch's x axis of the vehicle, that of the
        base by its IMU, and the standard deviation of the latter [rad]
    signals : these three, by their names in `analysis.schema`
    reach : largest rotation of the servo either way [rad]
    fault : of base or servo, in one line; None without one
    events : since the last update
    counting : whether the difference counts in `rms`; without thrust the vehicle turns further
        than the servo reaches
    """

    def __init__(
        self, plant: Plant, seat: RigGimbal, base: BaseMap, lead: Pair, period: float
    ) -> None:
        self._plant, self._seat, self._base, self._lead = plant, seat, base, lead
        self._period, self._speed = period, 0.0
        self._filter = BaseAttitude(base)
        self._launch = [float(c) for c in plant.attitude]
        self._axis = _column_x(*self._launch)
        self.attitude: Array = plant.attitude.copy()
        self.rate: Array = plant.rate.copy()
        self.simulated: Array = np.zeros(1)
        self.measured: Array = np.zeros(1)
        self.sigma: Array = np.zeros(1)
        self.signals: Mapping[str, Array] = {
            "turntable/simulated": self.simulated,
            "turntable/measured": self.measured,
            "turntable/sigma": self.sigma,
        }
        self._square, self._count = 0.0, 0
        low, high = seat.rig.turntable_limits
        ends = (abs(low - base.centre), abs(high - base.centre))
        self.reach = min(ends) * abs(base.travel)
        self.fault: str | None = None
        self.events: list[Event] = []
        self.counting = True
        self._beyond = self._stopped = False
        self._last_turn = self._unwound = 0.0
        self._silent = self._off_target = 0.0  # s
        self._reading: Triple | None = None
        self._equal = 0

    @property
    def rms(self) -> float:
        """Rms difference between measured and simulated rotation so far [rad]."""
        return math.sqrt(self._square / self._count) if self._count else math.nan

    def update(self) -> None:
        """Process the frames of this tick, command the servo, update the estimate."""
        self.events.clear()
        self._silent += self._period
        for frame in self._seat.readings.frames:
            self._filter.update(frame)
            self._check_imu(frame)
        attitude, rate = self._plant.attitude.tolist(), self._plant.rate.tolist()
        turn, speed = _twist(self._launch, attitude, rate)
        acceleration = (speed - self._speed) / self._period
        self._speed = speed
        # past 180° the angle continues, since the base must not jump to the other stop
        self._unwound += math.remainder(turn - self._last_turn, 2.0 * math.pi)
        self._last_turn = turn
        self._drive(self._unwound + self._lead[0] * speed + self._lead[1] * acceleration)
        seen = self._filter
        off, faster = seen.angle - turn, seen.rate - speed
        self.simulated[0], self.measured[0], self.sigma[0] = turn, seen.angle, seen.sigma
        if self.counting:
            self._square += off * off
            self._count += 1
        self._estimate(attitude, rate, off, faster)
        self._check_base()

    def stop(self) -> None:
        """Send the base to neutral and keep it there."""
        self._stopped = True
        self._seat.turntable = 0.0

    def _check_imu(self, frame: SensorFrame) -> None:
        if not frame.flags & Flags.BASE_IMU:
            return
        self._silent = 0.0
        self._equal = self._equal + 1 if frame.base_gyro == self._reading else 0
        self._reading = frame.base_gyro

    def _check_base(self) -> None:
        """Check that the base follows its command and that its IMU works."""
        sent = min(max(self._unwound, -self.reach), self.reach)
        astray = not self._stopped and abs(float(self.measured[0]) - sent) > OFF_TARGET
        self._off_target = self._off_target + self._period if astray else 0.0
        if self._silent > SILENT_S:
            self.fault = f"no reading of the base IMU for {SILENT_S:g} s"
        elif self._equal >= FROZEN:
            self.fault = "base IMU frozen"
        elif self._off_target > OFF_TARGET_S:
            angle = math.degrees(float(self.measured[0]))
            self.fault = f"the base is at {angle:.0f}°, commanded to {math.degrees(sent):.0f}°"
        else:
            self.fault = None

    def _drive(self, turn: float) -> None:
        if self._stopped:
            return
        beyond = abs(turn) > self.reach
        if beyond and not self._beyond:
            self.events.append(TurntableLimit(turn, self.reach))
        self._beyond = beyond
        self._seat.turntable = self._base.pulse(min(max(turn, -self.reach), self.reach))

    def _estimate(self, q: list[float], rate: list[float], off: float, faster: float) -> None:
        """Attitude q rotated by `off` about the launch's x axis, and its rate."""
        u, v, w = self._axis
        half = 0.5 * off
        c, s = math.cos(half), math.sin(half)
        a, b, d, e = q
        x, y, z = s * u, s * v, s * w
        self.attitude[0] = c * a - x * b - y * d - z * e
        self.attitude[1] = c * b + x * a + y * e - z * d
        self.attitude[2] = c * d - x * e + y * a + z * b
        self.attitude[3] = c * e + x * d - y * b + z * a
        # that axis in body axes: rows of the transposed rotation matrix
        bx = (1 - 2 * (d * d + e * e)) * u + 2 * (b * d + a * e) * v + 2 * (b * e - a * d) * w
        by = 2 * (b * d - a * e) * u + (1 - 2 * (b * b + e * e)) * v + 2 * (d * e + a * b) * w
        bz = 2 * (b * e + a * d) * u + 2 * (d * e - a * b) * v + (1 - 2 * (b * b + d * d)) * w
        self.rate[0] = rate[0] + faster * bx
        self.rate[1] = rate[1] + faster * by
        self.rate[2] = rate[2] + faster * bz


def _column_x(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The body's x axis in the world."""
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)


def _twist(launch: list[float], q: list[float], rate: list[float]) -> tuple[float, float]:
    """Turn about the launch's x axis, and its time derivative, of an attitude and a body rate.

    The swing-twist decomposition of what has been turned since the launch (P. Dobrowolski,
    Swing-twist decomposition in Clifford algebra, 2015): twist about x, then a swing without any.
    """
    a, b, c, d = launch
    e, f, g, h = q
    w, x = a * e + b * f + c * g + d * h, a * f - b * e - c * h + d * g
    y, z = a * g + b * h - c * e - d * f, a * h - b * g + c * f - d * e
    p, r, t = rate
    dw, dx = -0.5 * (x * p + y * r + z * t), 0.5 * (w * p + y * t - z * r)
    square = w * w + x * x
    if square < 1e-12:  # turned by 180° about another axis: the twist is undefined
        return 0.0, 0.0
    turn = 2.0 * math.atan2(x, w)
    if turn > math.pi:
        turn -= 2.0 * math.pi
    elif turn < -math.pi:
        turn += 2.0 * math.pi
    return turn, 2.0 * (dx * w - x * dw) / square
