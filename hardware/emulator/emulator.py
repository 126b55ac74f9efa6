"""A simulated rig in lockstep: write bytes, advance time, read bytes."""

import hashlib
from collections import deque
from collections.abc import Callable

from hardware.device import BYTE_US, LOOP_US, Device, Sample
from hardware.emulator.bench import RigParameters
from hardware.emulator.injection import Injection
from hardware.emulator.lockstep import LockstepRig
from hardware.emulator.plant import Plant
from hardware.frames import Pair
from hardware.parts import MPU6050
from hardware.protocol import Board, constants

FRAME_TICKS = constants.PWM_PERIOD_US // LOOP_US
BROWN_OUT = 1 << 2  # of MCUSR
IMU_AGE_US = (1090, 570)  # of the firmware: from the beginning of each read to the sample


def identity(parameters: RigParameters) -> int:
    """Return the serial number of an emulated rig, u32: a hash of its parameters."""
    digest = hashlib.sha256(repr(parameters).encode()).digest()
    return 1 + int.from_bytes(digest[:4], "little") % (constants.SERIAL_BLANK - 1)


class Emulator(LockstepRig):
    """The firmware's behaviour over a bench.

    Parameters
    ----------
    parameters : the rig; the reference rig if omitted
    plant : physics; the analytic plant if omitted
    injections : faults, from `injection.parse`
    seed : of the noise
    boot_us : device clock when the world's is zero [µs]

    Attributes
    ----------
    observer : called with every sample's device time [µs], true angles [rad] and rates [rad/s]
    """

    def __init__(
        self,
        parameters: RigParameters | None = None,
        *,
        plant: Plant | None = None,
        injections: tuple[Injection, ...] = (),
        seed: int = 0,
        boot_us: int = 0,
    ) -> None:
        super().__init__(parameters, plant, injections, seed)
        self.device = Device(Board.EMULATOR, build=0, serial=identity(self.parameters))
        self.observer: Callable[[int, Pair, Pair], None] | None = None
        self._boot_us = boot_us
        self._booted = 0  # tick at which the device's clock was at `boot_us`
        holder, base = (age / LOOP_US * self._tick_s for age in IMU_AGE_US)
        self._age_s: Pair = (holder, base)
        self._imu = [0] * 12
        self._read_us = [boot_us, boot_us]
        self._incoming: deque[tuple[float, int]] = deque()
        self._outgoing: deque[tuple[float, bytes]] = deque()
        self._wire_free = [0.0, 0.0]  # when each direction has sent its last byte [µs, world]
        self.device.boot()
        self._latch()

    def write(self, data: bytes) -> None:
        """Send bytes to the rig; they arrive at the speed of the line.

        Raises
        ------
        UnpluggedError : the cable is unplugged
        """
        self._cable.check(self._fault_time)
        at = max(self._wire_free[0], self.time_us)
        for byte in self._cable.carry(data, self._fault_time):
            at += BYTE_US
            self._incoming.append((at, byte))
        self._wire_free[0] = at

    def read(self) -> bytes:
        """Return the bytes that have arrived from the rig.

        Raises
        ------
        UnpluggedError : the cable is unplugged
        """
        pieces = []
        while self._outgoing and self._outgoing[0][0] <= self.time_us:
            pieces.append(self._outgoing.popleft()[1])
        self._cable.check(self._fault_time)
        return self._cable.carry(b"".join(pieces), self._fault_time) if pieces else b""

    def close(self) -> None:
        """Do nothing: there is no port to close."""

    def _advance_tick(self) -> None:
        self.bench.advance(self._tick_s)
        self._tick += 1
        world_us = self._tick * self._tick_s * 1e6
        up = self._tick - self._booted
        device_us = self._boot_us + up * LOOP_US
        self._receive(world_us, device_us)
        self.device.update(device_us)
        if up % FRAME_TICKS == 0:
            self._latch()
        if up % self.device.config.telemetry_period_ms == 0:
            self._report(device_us)
        if self.bench.supply_dipped():
            self._restart()
        self._transmit(world_us)

    def _restart(self) -> None:
        """Boot again with the clock at zero; unsent bytes are lost."""
        self.device = Device(Board.EMULATOR, 0, BROWN_OUT, self.device.serial)
        self._booted, self._boot_us = self._tick, 0
        self._imu, self._read_us = [0] * 12, [0, 0]
        self.device.boot()
        self._latch()

    def _latch(self) -> None:
        """Put the wanted pulse widths into force, as Timer1's double buffering does."""
        self._latched = self.device.pulse
        self._set_pulses(self._latched)

    def _receive(self, world_us: float, device_us: int) -> None:
        piece = bytearray()
        while self._incoming and self._incoming[0][0] <= world_us:
            at, byte = self._incoming.popleft()
            piece.append(byte)
            if byte == 0 or not self._incoming or self._incoming[0][0] > world_us:
                received = device_us - int((world_us - at) * (1 + self.parameters.skew))
                self.device.receive(bytes(piece), received, device_us)
                piece.clear()  # up to a delimiter, which dates its frame, or to the end of the tick
        self.bench.dlpf = self.device.config.dlpf

    def _report(self, device_us: int) -> None:
        bench = self.bench
        fresh = self._read_imus(device_us)
        holder, base = (min(device_us - t, 0xFFFF) for t in self._read_us)
        if self.observer is not None:
            self.observer(device_us, *self.truth())
        self.device.report(
            Sample(
                device_us=device_us,
                frame_us=(self._tick - self._booted) % FRAME_TICKS * LOOP_US,
                potentiometer=bench.potentiometer_codes(),
                imu=self._imu,
                imu_age_us=(holder, base),
                imu_fresh=fresh,
                pulse=self._latched,
                switches=bench.switch_bits(),
                joystick=bench.joystick_codes(),
            )
        )

    def _read_imus(self, device_us: int) -> tuple[bool, bool]:
        """Read the registers of the IMUs that answer; return which did."""
        counts, present = self.bench.imu_counts(self._age_s), self.bench.imu_present()
        for k, answers in enumerate(present):
            if answers:
                self._imu[6 * k : 6 * k + 6] = counts[6 * k : 6 * k + 6]
                self._read_us[k] = device_us - IMU_AGE_US[k]
        if all(present):
            self.device.imu_identity = (MPU6050, MPU6050)
        return present

    def _transmit(self, world_us: float) -> None:
        """Put queued bytes on the wire, as many as it takes in a tick."""
        queue = self.device.transmit
        if not queue:
            return
        start = max(self._wire_free[1], world_us)
        room = int((world_us + LOOP_US - start) / BYTE_US)
        if room <= 0:
            return
        piece = bytes(queue[:room])
        del queue[:room]
        end = start + len(piece) * BYTE_US
        self._wire_free[1] = end
        self._outgoing.append((end, piece))
