"""A Raspberry Pi as a rig: the firmware's behaviour over its PWM and buses, on a TCP port."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hardware.device import LOOP_US, Device, Inbox, Port, Sample
from hardware.protocol import Board, Flags, constants
from hardware.raspberry_pi.pwm import KernelPwm
from hardware.raspberry_pi.sensors import Bus, Imu, Mcp3008, Sampler

PORT = 5555
BUILD = 0x5249_0100  # "RI", version 1.0: Python has no image to hash
_CENTRE = constants.ADC_LEVELS // 2
_SLEEPLESS_US = 200_000  # after a longer pause the deadlines restart
_IMUS_S = 20e-3  # both take 1 to 4 ms; the potentiometers do not wait longer
_HELD_US = 50_000  # a sample that takes longer is given up
_CHANNELS = 6  # of the ADC: four potentiometers, two axes of the joystick


@dataclass(frozen=True, slots=True)
class _Motion:
    """Readings of the IMUs: counts (12,), time of each [µs], and whether it answered."""

    counts: tuple[int, ...]
    read_us: tuple[int, int]
    fresh: tuple[bool, bool]


@dataclass(frozen=True, slots=True)
class _Codes:
    """Codes of the ADC, None where it failed, and their time [µs]."""

    code: tuple[int | None, ...]
    read_us: int


_CHIP, _SYSTEM = Path("/proc/cpuinfo"), Path("/etc/machine-id")


def serial_number(chip: Path = _CHIP, system: Path = _SYSTEM) -> int:
    """Return the Pi's serial number, u32: its chip's, else its system's, 0 without either.

    The lower half of the number in the file.
    """
    for path, pattern in ((chip, r"^Serial\s*:\s*([0-9a-fA-F]{1,16})\s*$"), (system, r"^(\w+)$")):
        try:
            text = path.read_text(encoding="ascii", errors="replace")
            match = re.search(pattern, text, re.MULTILINE)
            number = int(match[1], 16) & constants.SERIAL_BLANK if match else 0
        except (OSError, ValueError):
            continue
        if number not in (constants.SERIAL_NONE, constants.SERIAL_BLANK):
            return number
    return constants.SERIAL_NONE


class Gateway:
    """Serves one host at a time; slow or stuck sensors delay neither servos nor timeout.

    Parameters
    ----------
    pwm : servo outputs
    bus : I²C bus with the IMUs
    port : port for the host
    adc : potentiometers and joystick; None reads as open wires
    clock : monotonic nanoseconds
    serial : serial number, u32; 0 without one
    """

    def __init__(
        self,
        pwm: KernelPwm,
        bus: Bus,
        port: Port,
        adc: Mcp3008 | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        serial: int = constants.SERIAL_NONE,
    ) -> None:
        self.pwm, self.port, self.adc = pwm, port, adc
        self.inbox = Inbox()
        self.device = Device(Board.RASPBERRY_PI, BUILD, serial=serial)
        self.device.flags |= Flags.PULSE_UNTIMED  # the kernel does not say when a pulse begins
        self._imus = [Imu(bus, address) for address in constants.IMU_ADDRESSES]
        self._motion = Sampler(self._read_imus, _Motion((0,) * 12, (0, 0), (False, False)))
        self._codes = Sampler(self._read_adc, _Codes((None,) * _CHANNELS, 0))
        self._clock = clock
        self._start = clock()
        self._report_us = 0
        self._reading = False  # a report waits for its sensors
        self._asked_us = 0  # when they were started
        self._awaits_imus = True
        self._stepped_us = 0
        self._stopped = False
        self.pwm.set(self.device.pulse)
        self.device.boot()

    def now_us(self) -> int:
        """Return the device's clock [µs]."""
        return (self._clock() - self._start) // 1000

    def step(self) -> None:
        """Process the host's bytes, drive the servos, and report when due."""
        self._listen()
        self.pwm.set(self.device.pulse)
        self._sense()
        if self.device.transmit:
            self.port.write(bytes(self.device.transmit))
            self.device.transmit.clear()

    def _listen(self) -> None:
        self.inbox.add(self.port.read())
        now = self.now_us()
        pause, self._stepped_us = now - self._stepped_us, now
        self.device.update(now)
        if data := self.inbox.take(max(pause, LOOP_US)):
            self.device.receive(data, now, now)
            # It may have waited in the socket since the step before: a command that timed out
            # during a long pause must not drive the servos.
            self.device.update(now + pause)

    def _sense(self) -> None:
        """Start a sample when due, and report it when complete."""
        self._hand_over()
        now = self.now_us()
        if now < self._report_us:
            return
        if self._reading and now - self._asked_us < _HELD_US:
            return  # a slow bus: reported when complete, at a lower rate
        period = 1000 * self.device.config.telemetry_period_ms
        self._report_us = max(self._report_us + period, now - period)
        self._reading = self._codes.ready
        if not self._reading:  # the ADC is stuck: report without it
            self._report(now)
        self._awaits_imus = self._motion.ready
        self._motion.ask()
        if self._reading:
            self._asked_us = now
            self._codes.ask()
            self._hand_over()

    def _hand_over(self) -> None:
        if self._reading and self._codes.ready:
            self._reading = False
            self._report(self._codes.latest.read_us)

    def _report(self, sample_us: int) -> None:
        motion = self._motion.latest
        fresh = motion.fresh if self._motion.ready else (False, False)
        code = self._codes.latest.code if self._codes.ready else (None,) * _CHANNELS
        wired = [c or 0 for c in code]
        holder, base = self._imus
        self.device.imu_identity = (holder.identity, base.identity)
        age = [min(max(sample_us - t, 0), 0xFFFF) for t in motion.read_us]
        self.device.report(
            Sample(
                device_us=sample_us,
                frame_us=0,
                potentiometer=(wired[0], wired[1], wired[2], wired[3]),
                imu=list(motion.counts),
                imu_age_us=(age[0], age[1]),
                imu_fresh=fresh,
                pulse=self.device.pulse,
                switches=0,
                joystick=(
                    _CENTRE if code[4] is None else code[4],
                    _CENTRE if code[5] is None else code[5],
                ),
            )
        )

    def _read_imus(self) -> _Motion:
        last = self._motion.latest
        counts, read_us, fresh = list(last.counts), list(last.read_us), [False, False]
        for k, imu in enumerate(self._imus):
            began = self.now_us()  # the age of a reading counts from here, as the firmware's
            answer = imu.read(self.device.config.dlpf)
            if answer is not None:
                counts[6 * k : 6 * k + 6] = answer
                read_us[k], fresh[k] = began, True
        return _Motion(tuple(counts), (read_us[0], read_us[1]), (fresh[0], fresh[1]))

    def _read_adc(self) -> _Codes:
        if self._awaits_imus:
            self._motion.wait(_IMUS_S)
        now = self.now_us()
        if self.adc is None:
            return _Codes((None,) * _CHANNELS, now)
        return _Codes(tuple(self.adc.read(channel) for channel in range(_CHANNELS)), now)

    def stop(self) -> None:
        """End `run` after the current step; for another thread or a signal."""
        self._stopped = True

    def run(self) -> None:
        """Serve until `stop`; then servos go to neutral, pulses end, and the port closes.

        Raises
        ------
        PwmError : the kernel refuses a pulse width
        """
        samplers = self._motion, self._codes
        for sampler in samplers:
            sampler.start()
        deadline = self.now_us()
        try:
            while not self._stopped:
                self.step()
                deadline += LOOP_US
                wait = deadline - self.now_us()
                if wait < -_SLEEPLESS_US:
                    deadline = self.now_us()
                elif wait > 0:
                    time.sleep(wait * 1e-6)
        finally:
            for sampler in samplers:
                sampler.stop()
            self.pwm.close(self.device.config.neutral)
            self.port.close()
