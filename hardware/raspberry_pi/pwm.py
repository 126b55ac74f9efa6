"""Two servo outputs of the Pi's PWM block through the kernel's sysfs files.

Layout: Documentation/driver-api/pwm.rst of the Linux kernel. The chip's number changes between
models and kernels (0 on a Pi 3B+; 0, 1 or 2 on a Pi 5), so it is searched for. On the block of two
channels GPIO 18 and 19 are channels 0 and 1. A Pi 5 has two blocks of four (pwm-rp1.c of the
raspberrypi kernel): on PWM0, at 0x98000 of the RP1, GPIO 12, 13, 18 and 19 are channels 0 to 3
("RP1 Peripherals", functions of the GPIOs); the other, at 0x9c000, drives the fan.
"""

import contextlib
import time
from pathlib import Path

from hardware.frames import HardwareError
from hardware.protocol import constants

SYSFS = Path("/sys/class/pwm")
SERVOS = 2
RP1_CHANNELS, RP1_FIRST = 4, 2  # of a block, and that of GPIO 18
RP1_PWM0 = "98000.pwm"  # end of the device's name, such as 1f00098000.pwm
PERIOD_NS = constants.PWM_PERIOD_US * 1000
_EXPORT_WAIT_S = 1.0  # udev sets the group of a fresh channel's files a moment after they appear
_TRAVEL_S = 0.3  # a 9 g servo crosses its whole range meanwhile
_OVERLAY = "add `dtoverlay=pwm-2chan` to /boot/firmware/config.txt and reboot"


class PwmError(HardwareError):
    """The kernel's PWM cannot be used."""


def find_chip(root: Path = SYSFS) -> Path:
    """Return the folder of the PWM chip of GPIO 18 and 19.

    Raises
    ------
    PwmError : no such chip
    """
    for chip in sorted(root.glob("pwmchip*")):
        count = channels(chip)
        # on a Pi 5 without the overlay only the fan's block is there
        rp1 = count == RP1_CHANNELS and (chip / "device").resolve().name.endswith(RP1_PWM0)
        if count == SERVOS or rp1:
            return chip
    raise PwmError(f"no PWM chip for GPIO 18 and 19 under {root}: {_OVERLAY}")


def channels(chip: Path) -> int:
    """Return how many channels a chip has, 0 where that cannot be read."""
    try:
        return int((chip / "npwm").read_text())
    except (OSError, ValueError):
        return 0


def _write(path: Path, value: int) -> None:
    try:
        path.write_text(f"{value}\n")
    except PermissionError:
        raise PwmError(
            f"no permission to write {path}: add the user to group gpio, or run as root"
        ) from None
    except OSError as error:
        raise PwmError(f"cannot write {value} to {path}: {error.strerror}") from None


class KernelPwm:
    """Servo x on GPIO 18, servo y on GPIO 19: channels 0 and 1, on a Pi 5 2 and 3.

    Parameters
    ----------
    chip : folder of the chip; searched for if omitted

    Raises
    ------
    PwmError : no chip, no permission, or the kernel refuses a value
    """

    def __init__(self, chip: Path | None = None) -> None:
        self.chip = chip or find_chip()
        self._first = RP1_FIRST if channels(self.chip) == RP1_CHANNELS else 0
        self._duty = [-1] * SERVOS
        for servo in range(SERVOS):
            self._begin(servo)

    def _folder(self, servo: int) -> Path:
        return self.chip / f"pwm{self._first + servo}"

    def _begin(self, servo: int) -> None:
        folder = self._folder(servo)
        if not folder.exists():
            _write(self.chip / "export", self._first + servo)
        end = time.monotonic() + _EXPORT_WAIT_S
        while not self._writable(folder / "period"):
            if time.monotonic() > end:
                raise PwmError(f"{folder} did not become writable: {_OVERLAY}, or join group gpio")
            time.sleep(0.01)
        # The kernel refuses a period shorter than the present duty cycle: that is set first.
        _write(folder / "duty_cycle", 0)
        _write(folder / "period", PERIOD_NS)

    @staticmethod
    def _writable(path: Path) -> bool:
        try:
            with path.open("a"):
                return True
        except OSError:
            return False

    def set(self, ticks: tuple[int, int, int]) -> None:
        """Set pulse widths [0.5 µs]; the third servo has no output here."""
        for servo in range(SERVOS):
            duty = ticks[servo] * constants.TICK_NS
            if duty == self._duty[servo]:
                continue
            _write(self._folder(servo) / "duty_cycle", duty)
            if self._duty[servo] < 0:
                _write(self._folder(servo) / "enable", 1)
            self._duty[servo] = duty

    def close(self, rest: tuple[int, int, int]) -> None:
        """Send the servos to pulse widths [0.5 µs], then stop the pulses.

        If the kernel refuses one channel, the other is still set.
        """
        for servo in range(SERVOS):
            with contextlib.suppress(PwmError):
                _write(self._folder(servo) / "duty_cycle", rest[servo] * constants.TICK_NS)
        time.sleep(_TRAVEL_S)
        for servo in range(SERVOS):
            with contextlib.suppress(PwmError):
                _write(self._folder(servo) / "enable", 0)
                _write(self.chip / "unexport", self._first + servo)
