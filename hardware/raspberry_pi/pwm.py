"""Two servo outputs of the Pi's PWM block through the kernel's sysfs files.

Layout: Documentation/driver-api/pwm.rst of the Linux kernel. The chip's number changes between
models and kernels (0 on a Pi 3B+, 2 on a Pi 5 before 6.6), so it is searched for.
"""

import contextlib
import time
from pathlib import Path

from hardware.frames import HardwareError
from hardware.protocol import constants

SYSFS = Path("/sys/class/pwm")
CHANNELS = 2
PERIOD_NS = constants.PWM_PERIOD_US * 1000
_EXPORT_WAIT_S = 1.0  # udev sets the group of a fresh channel's files a moment after they appear
_TRAVEL_S = 0.3  # a 9 g servo crosses its whole range meanwhile
_OVERLAY = "add `dtoverlay=pwm-2chan` to /boot/firmware/config.txt and reboot"


class PwmError(HardwareError):
    """The kernel's PWM cannot be used."""


def find_chip(root: Path = SYSFS) -> Path:
    """Return the folder of the first PWM chip with two channels.

    Raises
    ------
    PwmError : no such chip
    """
    for chip in sorted(root.glob("pwmchip*")):
        with contextlib.suppress(OSError, ValueError):
            if int((chip / "npwm").read_text()) >= CHANNELS:
                return chip
    raise PwmError(f"no PWM chip with {CHANNELS} channels under {root}: {_OVERLAY}")


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
    """Servo x on channel 0 (GPIO 18), servo y on channel 1 (GPIO 19).

    Parameters
    ----------
    chip : folder of the chip; searched for if omitted

    Raises
    ------
    PwmError : no chip, no permission, or the kernel refuses a value
    """

    def __init__(self, chip: Path | None = None) -> None:
        self.chip = chip or find_chip()
        self._duty = [-1] * CHANNELS
        for channel in range(CHANNELS):
            self._begin(channel)

    def _folder(self, channel: int) -> Path:
        return self.chip / f"pwm{channel}"

    def _begin(self, channel: int) -> None:
        folder = self._folder(channel)
        if not folder.exists():
            _write(self.chip / "export", channel)
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
        for channel in range(CHANNELS):
            duty = ticks[channel] * constants.TICK_NS
            if duty == self._duty[channel]:
                continue
            _write(self._folder(channel) / "duty_cycle", duty)
            if self._duty[channel] < 0:
                _write(self._folder(channel) / "enable", 1)
            self._duty[channel] = duty

    def close(self, rest: tuple[int, int, int]) -> None:
        """Send the servos to pulse widths [0.5 µs], then stop the pulses.

        If the kernel refuses one channel, the other is still set.
        """
        for channel in range(CHANNELS):
            with contextlib.suppress(PwmError):
                _write(self._folder(channel) / "duty_cycle", rest[channel] * constants.TICK_NS)
        time.sleep(_TRAVEL_S)
        for channel in range(CHANNELS):
            with contextlib.suppress(PwmError):
                _write(self._folder(channel) / "enable", 0)
                _write(self.chip / "unexport", channel)
