"""Who may be named in the gimbal seat; imports nothing, so that the command line stays quick."""

import re

from twin.errors import TwinError

MODELS = ("linkage", "transfer-function")
# how parameters begin that an identified model of the gimbal does not have
OF_SERVOS = ("gimbal_servo_", "gimbal_rod_", "gimbal_play_", "gimbal_backlash")
SIMULATED = ("emulator", "firmware")
_PORT = re.compile(r"/|\\|://|^com\d+$", re.IGNORECASE)

_DEVICE = re.compile(r"(tty|cu\.)\w+$")  # without its folder


def is_port(seat: str) -> bool:
    """Tell whether a seat is a port: a device path, COM3, or a pyserial URL."""
    return seat not in MODELS + SIMULATED and _PORT.search(seat) is not None


def is_rig(seat: str) -> bool:
    """Tell whether a rig sits there, simulated or on a line."""
    return seat in SIMULATED or is_port(seat)


def check_seat(seat: str) -> None:
    """Refuse what can be neither a model nor a rig.

    Raises
    ------
    TwinError : with the valid names
    """
    if seat not in MODELS and not is_rig(seat):
        if _DEVICE.match(seat):
            raise TwinError(f"--gimbal {seat!r}: did you mean /dev/{seat}?")
        raise TwinError(
            f"--gimbal {seat!r}: there are {', '.join(MODELS + SIMULATED)}, or a port such as"
            " /dev/ttyUSB0, COM3 or socket://127.0.0.1:5555"
        )
