"""Drives the servos to four limit switches and records every sensor there; no I/O.

A procedure takes sensor frames and gives back pulse widths to send. Each switch is approached
outwards until it closes and left inwards until it opens, several times, with the other servo held
at three places, so that both directions and the coupling of the axes are seen.
"""

from collections.abc import Generator

import numpy as np

from hardware.calibration.errors import CalibrationError
from hardware.calibration.imu import ImuWatch
from hardware.calibration.log import SWITCHES, CalibrationRig, Event, Log
from hardware.calibration.result import Calibration
from hardware.calibration.servos import InForce
from hardware.calibration.solve import solve
from hardware.frames import AXES, Pair, SensorFrame
from hardware.parts import RAIL, tilts

ATTEMPTS = 8  # at an approach, of which a busy computer spoils some
Steps = Generator[Pair, SensorFrame, None]


class Procedure:
    """One calibration run: feed it frames, send what it returns, until `done`.

    Parameters
    ----------
    rig : switches and how to drive to them
    identity : of the device, from HELLO
    """

    def __init__(self, rig: CalibrationRig | None = None, identity: int = 0) -> None:
        self.rig = rig or CalibrationRig()
        self.identity = identity
        self.log = Log()
        self.done = False
        self._frame: SensorFrame | None = None
        self._imu, self._force = ImuWatch(), InForce(self.rig)
        self._integral = np.zeros(3)
        self._pulses = list(self.rig.neutral)
        self._direction = [1, 1]  # which way each servo moves its own axis
        self._closed_at = [0.0] * 4  # pulse width at which each switch closed last
        self._came = 0  # direction in which the held axis moved last
        self._random = np.random.default_rng(self.rig.seed)
        self._steps = self._run()
        self._total = 8 + 4 * len(self.rig.offsets) * self.rig.repeats * 2

    @property
    def progress(self) -> float:
        """How much of the run is behind, 0…1."""
        return 1.0 if self.done else min(0.99, len(self.log.events) / self._total)

    def step(self, frame: SensorFrame) -> Pair:
        """Take a frame and return the pulse widths to send [s].

        Raises
        ------
        CalibrationError : a switch or the IMU does not do what it should; the message names it
        """
        first = self._frame is None
        if self._frame is not None:
            dt = max(0.0, min((frame.device_us - self._frame.device_us) * 1e-6, 0.1))
            self._integral += np.array(frame.gyro) * dt
        self._frame = frame
        if not self.done:
            self._imu.check(frame)
            self._force.update(frame, self._pulses)
            try:
                if first:
                    next(self._steps)
                else:
                    self._steps.send(frame)
            except StopIteration:
                self.done = True
        return self._pulses[0], self._pulses[1]

    def result(self) -> Calibration:
        """Return the calibration of a run that is done.

        Raises
        ------
        CalibrationError : implausible; the message names the switch or sensor
        """
        if not self.done:
            raise CalibrationError(f"calibration is not finished ({self.progress:.0%})")
        return solve(self.log, self.rig, self.identity)

    def _run(self) -> Steps:
        yield from self._rest()
        for axis in (0, 1):
            yield from self._search(axis)
        for offset in self.rig.offsets:
            for _ in range(self.rig.repeats):
                for switch in range(4):
                    yield from self._visit(switch, offset)
        yield from self._move(0, self.rig.neutral[0])
        yield from self._move(1, self.rig.neutral[1])

    def _wait(self, duration: float) -> Steps:
        frame = yield self._sent()
        end = frame.device_us + duration * 1e6
        while not self._force.over(frame.device_us, end):
            frame = yield self._sent()

    def _sent(self) -> Pair:
        return self._pulses[0], self._pulses[1]

    def _rest(self) -> Steps:
        """Hold still; the gyro shows its bias, and no switch may be closed."""
        yield from self._wait(0.5)
        readings = []
        frame = yield self._sent()
        end = frame.device_us + 1_000_000
        while frame.device_us < end:
            readings.append(frame.gyro)
            if not self.rig.minimal and max(frame.potentiometer) < RAIL:
                raise CalibrationError(
                    "all four potentiometers read ground: check their 5 V and wipers; a rig"
                    " without potentiometers is calibrated with --minimal"
                )
            for name, closed in zip(SWITCHES, frame.switches, strict=True):
                if closed:
                    raise _closed(name)
            frame = yield self._sent()
        values = np.array(readings)
        x, y, z = values.mean(axis=0).tolist()
        self.log.gyro_bias = (x, y, z)
        self.log.gyro_bias_sigma = float(values.std(axis=0).max() / len(values) ** 0.5)

    def _search(self, axis: int) -> Steps:
        """Find both switches of an axis and which way the servo turns it."""
        names = (2 * axis, 2 * axis + 1)
        hit = names[0]
        for way in (1, -1):
            yield from self._move(axis, self.rig.neutral[axis])
            if way == -1 and self._frame is not None and self._frame.switches[hit]:
                raise _closed(SWITCHES[hit])  # it opens beyond neutral, within its own travel
            hit = yield from self._until_any(axis, way, names)
            if way == 1:
                self._direction[axis] = 1 if hit == names[0] else -1
            elif hit != names[(self._direction[axis] == 1)]:
                raise CalibrationError(
                    f"switch {SWITCHES[hit]} closes at both ends of servo {AXES[axis]}'s travel"
                )
            self._closed_at[hit] = self._pulses[axis]
        yield from self._move(axis, self.rig.neutral[axis])

    def _until_any(
        self, axis: int, way: int, own: tuple[int, int]
    ) -> Generator[Pair, SensorFrame, int]:
        """Step a servo until a switch closes; return which."""
        while True:
            self._step_by(axis, way * self.rig.coarse, own[0] if way > 0 else own[1])
            end = self._now() + self.rig.dwell * 1e6
            while not self._force.over(self._now(), end):
                frame = yield self._sent()
                for index, closed in enumerate(frame.switches):
                    if closed and index not in own:
                        raise CalibrationError(
                            f"switch {SWITCHES[index]} closed while servo {AXES[axis]} moved; "
                            "servos or switches are swapped"
                        )
                    if closed:
                        return index

    def _now(self) -> int:
        assert self._frame is not None
        return self._frame.device_us

    def _step_by(self, axis: int, step: float, switch: int) -> None:
        pulse = self._pulses[axis] + step
        if not self.rig.lowest <= pulse <= self.rig.highest:
            raise CalibrationError(
                f"switch {SWITCHES[switch]} never closed: servo {AXES[axis]} reached "
                f"{self._pulses[axis] * 1e6:.0f} µs; check the switch's wiring and place, and the "
                "servo horn"
            )
        self._pulses[axis] = pulse

    def _move(self, axis: int, pulse: float) -> Steps:
        """Bring a servo to a place, fast but not at once, and let it settle."""
        while abs(pulse - self._pulses[axis]) > 1e-9:
            step = pulse - self._pulses[axis]
            self._pulses[axis] += max(-5 * self.rig.coarse, min(5 * self.rig.coarse, step))
            yield from self._wait(self.rig.dwell / 2)
        yield from self._wait(3 * self.rig.dwell)

    def _visit(self, switch: int, offset: float) -> Steps:
        """Close a switch and open it again, noting both; once more where frames came late."""
        for _ in range(ATTEMPTS):
            noted = len(self.log.events)
            yield from self._approach(switch, offset)
            if not self._force.left:
                return
            del self.log.events[noted:]
        raise CalibrationError(
            f"readings or commands came late in {ATTEMPTS} approaches to switch"
            f" {SWITCHES[switch]}; this computer is too busy for a rig in real time: stop other"
            " programs and try again"
        )

    def _approach(self, switch: int, offset: float) -> Steps:
        axis, other = switch // 2, 1 - switch // 2
        outwards = self._direction[axis] * (1 if switch % 2 == 0 else -1)
        held = self.rig.neutral[other] + offset
        # From a random side, so that the held servo's own play is not always on the same side.
        side = 30e-6 if self._random.random() < 0.5 else -30e-6
        self._came = -self._direction[other] if side > 0 else self._direction[other]
        yield from self._move(other, held + side)
        yield from self._move(other, held)
        start = self._closed_at[switch] - outwards * (
            self.rig.backoff + self._random.random() * 4e-6
        )
        yield from self._move(axis, start)
        yield from self._retreat(switch, axis, outwards)
        self._force.left = False
        yield from self._note(switch, axis, outwards, closing=True)
        if self._force.left:
            return
        self._closed_at[switch] = self._pulses[axis]
        for _ in range(2):
            self._step_by(axis, outwards * self.rig.fine, switch)
            yield from self._wait(self.rig.dwell)
        yield from self._note(switch, axis, -outwards, closing=False)

    def _retreat(self, switch: int, axis: int, outwards: int) -> Steps:
        """Step back until the switch is open, wherever the other servo has left it."""
        for _ in range(20):
            if self._frame is not None and not self._frame.switches[switch]:
                return
            yield from self._move(axis, self._pulses[axis] - outwards * self.rig.backoff)
        raise CalibrationError(f"switch {SWITCHES[switch]} stays closed; it is stuck or shorted")

    def _note(self, switch: int, axis: int, way: int, *, closing: bool) -> Steps:
        limit = int(0.4e-3 / self.rig.fine)
        for _ in range(limit):
            self._step_by(axis, way * self.rig.fine, switch)
            end = self._now() + self.rig.dwell * 1e6
            while not self._force.over(self._now(), end):
                frame = yield self._sent()
                if self._force.left:
                    return
                if frame.switches[switch] == closing:
                    yield from self._record(switch, axis, way, closing, frame)
                    return
        if closing:
            raise CalibrationError(f"switch {SWITCHES[switch]} closed once and then never again")
        raise CalibrationError(f"switch {SWITCHES[switch]} stays closed; it is stuck or shorted")

    def _record(self, switch: int, axis: int, way: int, closing: bool, frame: SensorFrame) -> Steps:
        """Note the pulses that moved the switch, and the sensors once the servo has come to rest.

        A switch moves within the time of a few frames, too short for a potentiometer: its error
        in the switch's differential travel would be the largest error of the matrix.
        """
        pulses = [frame.pulse[0], frame.pulse[1]]
        # The crossing lay anywhere within the step that the servo was taking.
        pulses[axis] -= way * self.rig.fine / 2
        yield from self._wait(self.rig.dwell)
        readings, end = [], self._now() + self.rig.reading * 1e6
        while self._now() < end:
            frame = yield self._sent()
            readings.append(_seen(frame) if self.rig.minimal else frame.potentiometer)
        a, b, c, d = np.mean(readings, axis=0).tolist()
        x, y, z = self._integral.tolist()
        self.log.events.append(
            Event(
                switch=switch,
                closed=closing,
                pulses=(pulses[0], pulses[1]),
                settled=(frame.pulse[0], frame.pulse[1]),
                potentiometer=(a, b, c, d),
                time=frame.device_us * 1e-6,
                gyro=(x, y, z),
                came=self._came,
            )
        )


def _closed(name: str) -> CalibrationError:
    return CalibrationError(
        f"switch {name} is closed at neutral; check its wiring (it must open to ground), that the"
        " gimbal hangs free, and that the horn stands at a right angle at neutral (a tooth is 15°"
        " to 18°)"
    )


def _seen(frame: SensorFrame) -> tuple[float, float, float, float]:
    """Tilts of the holder by its accelerometer, in place of the potentiometers (x, x, y, y)."""
    x, y = tilts(frame.accelerometer)
    return x, x, y, y
