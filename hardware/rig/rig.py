"""The gimbal seat over a link: commands to pulses, counts to SI, fusion, health, losses."""

import time
from collections.abc import Callable

from hardware.calibration.result import Calibration, nominal
from hardware.faults import Fault
from hardware.frames import GimbalCommand, GimbalState, Pair, SensorFrame
from hardware.fusion import BaseMap, Fusion, Noise
from hardware.parts import GYRO_DELAY_6500_S, GYRO_DELAY_S, GYRO_SAMPLE_S, SUCCESSORS
from hardware.protocol import (
    Command,
    Config,
    Disarm,
    Flags,
    Frame,
    HelloRequest,
    Mode,
    Name,
    Telemetry,
    constants,
)
from hardware.rig.connection import Connection
from hardware.rig.line import Line
from hardware.rig.phases import Phase, RigStatistics

TIMEOUT_MS = 100
PULSES = constants.PULSE_MINIMUM * constants.TICK, constants.PULSE_MAXIMUM * constants.TICK  # s


class Rig(Connection):
    """A gimbal on a line.

    Parameters
    ----------
    line : `hardware.link.Link` or `LockstepLine`
    calibration : of this rig; nominal values where None
    clock : experiment time [ns], the one the line uses
    wait : lets time pass [ns] while `connect` waits; lockstep advances the device here
    noise : assumptions of the fusion
    arm : arm the servos once connected; a mirror that only watches leaves them alone
    fuse : estimate the gimbal's state; a calibration does not use it

    Attributes
    ----------
    state : latest estimate, None before the first frame
    states : estimates of the frames that the latest poll returned
    fusion : the estimator, with the fault monitor in it
    gyro_delay : delay of the holder gyro's readings, from this session's first frame [s]
    """

    def __init__(
        self,
        line: Line,
        calibration: Calibration | None = None,
        *,
        clock: Callable[[], int] = time.monotonic_ns,
        wait: Callable[[int], None] = lambda ns: time.sleep(ns * 1e-9),
        noise: Noise | None = None,
        arm: bool = True,
        fuse: bool = True,
    ) -> None:
        super().__init__(line, calibration.rig if calibration else 0, clock, wait, arm=arm)
        self.calibration = calibration or nominal()
        self._noise = noise
        self._fuse = fuse
        self.fusion = Fusion(self.calibration, noise)
        self.state: GimbalState | None = None
        self.states: list[GimbalState] = []
        self.gyro_delay = self.fusion.noise.gyro_delay
        self._frames = 0
        self._latest: Telemetry | None = None
        self._asked = False  # in this session, for the kind of IMU

    def renew(self, base: BaseMap | None = None) -> None:
        """Reset every estimate to its state before the first frame.

        Parameters
        ----------
        base : map of the base's IMU where the base turns from now on
        """
        self.fusion = Fusion(self.calibration, self._noise, base)
        self._delay_known = False

    def poll(self) -> list[SensorFrame]:
        """Return the sensor frames that have arrived; never blocks.

        Raises
        ------
        RigError : a device of another version has appeared on the line
        """
        self.states = []
        frames = [f for event in self._arrived() if (f := self._take(event)) is not None]
        self._send_due()
        return frames

    def send(self, command: GimbalCommand, turntable: float = 0.0) -> int | None:
        """Send a command; return its sequence number, None when it could not be sent.

        Parameters
        ----------
        command : gimbal angles [rad]
        turntable : pulse width of the third servo, 0 for neutral [s]
        """
        if self.phase is not Phase.READY:
            return None
        x, y = self.calibration.pulses(command.angle)
        return self.send_pulses(x, y, turntable)

    def send_pulses(self, x: float, y: float, turntable: float = 0.0) -> int | None:
        """Send pulse widths [s], held within the limits the device announced."""
        if self._converter is None or self.hello is None:
            return None
        wanted = [self._converter.ticks(p) for p in (x, y, turntable)]
        low, high = self.hello.minimum, self.hello.maximum
        held = [min(max(w, a), b) if w else 0 for w, a, b in zip(wanted, low, high, strict=True)]
        return self.line.send(Command((held[0], held[1], held[2]), TIMEOUT_MS, Mode.DRIVE))

    def neutral(self) -> None:
        """Send the servos to neutral and leave them armed."""
        self.line.send(Command((0, 0, 0), TIMEOUT_MS, Mode.NEUTRAL))

    def name(self, serial: int) -> None:
        """Give a board without a serial number one, and request its HELLO."""
        self.line.send(Name(serial))
        self.line.send(HelloRequest())

    def configure(self, config: Config) -> None:
        """Change the device's settings and request its HELLO, which shows those in force."""
        self.settings = config
        self.line.send(config)
        self.line.send(HelloRequest())

    def close(self) -> None:
        """Disarm, which drives to neutral at once, and close the line."""
        self.line.send(Disarm())
        self.line.close()

    @property
    def turntable_limits(self) -> Pair:
        """Shortest and longest pulse of the third servo, as the device announced them [s]."""
        if self.hello is None:
            return PULSES
        tick = self.hello.tick_ns * 1e-9
        return self.hello.minimum[2] * tick, self.hello.maximum[2] * tick

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults of sensors that have been identified."""
        return self.fusion.monitor.faults

    @property
    def health(self) -> str:
        """Health of connection and sensors in one line, "ok" without a fault."""
        if self.phase is not Phase.READY:
            return f"rig {self.phase}"
        return self.fusion.monitor.describe()

    @property
    def statistics(self) -> RigStatistics:
        """Losses and timing so far."""
        s, t = self.line.statistics, self._latest
        return RigStatistics(
            frames=self._frames,
            lost=s.decoder.lost,
            crc_errors=s.decoder.crc_errors,
            device_lost=t.lost if t else 0,
            device_crc_errors=t.crc_errors if t else 0,
            skipped=t.skipped if t else 0,
            refused=s.refused,
            gaps=s.gaps,
            round_trips=self.estimate.added,
            round_trip_ns=self.estimate.round_trip_ns,
            shortest_ns=self.estimate.shortest_ns,
            skew=self.estimate.skew,
            dropped=s.dropped,
        )

    def _restart(self) -> None:
        self._asked = False
        self.fusion.restart()

    def _take(self, event: Frame) -> SensorFrame | None:
        if isinstance(event.message, Telemetry):
            return self._telemetry(event.message)
        self._handshake(event)
        return None

    def _telemetry(self, t: Telemetry) -> SensorFrame | None:
        self._latest = t
        if self._converter is None or self.phase is not Phase.READY:
            return None
        device_us = self._unwrapped(t.device_us)
        if device_us is None or not self._armed(t.flags):
            return None
        self._set_gyro_delay(t)
        frame = self._converter.frame(t, self.estimate.host_ns(device_us), device_us)
        if self._fuse:
            self.state = self.fusion.update(frame)
            self.states.append(self.state)
        self._frames += 1
        return frame

    def _set_gyro_delay(self, t: Telemetry) -> None:
        """Take the gyro's delay from the first frame of a session that has a holder IMU."""
        if self._delay_known or self.hello is None or not t.flags & Flags.HOLDER_IMU:
            return
        chip = self.hello.imu_identity[0]
        if chip == 0 and not self._asked:  # a HELLO of before the IMUs were set up
            self.line.send(HelloRequest())
            self._asked = True
        delays = GYRO_DELAY_6500_S if chip in SUCCESSORS else GYRO_DELAY_S
        setting = min(self.hello.dlpf, constants.DLPF_HIGHEST)
        held = GYRO_SAMPLE_S[setting] / 2  # on the mean: the chip samples by its own clock
        self.gyro_delay = delays[setting] + held + t.imu_age_us[0] * 1e-6
        self.fusion.set_gyro_delay(self.gyro_delay)
        self._delay_known = True
