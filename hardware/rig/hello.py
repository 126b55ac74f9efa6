"""What a HELLO must be: of this version, of the wanted board, with usable scales."""

from hardware.frames import HardwareError
from hardware.protocol import LAYOUT, PROTOCOL, Config, Hello


class RigError(HardwareError):
    """The device behind the port is not a rig of this version, or does not answer."""


def settings(hello: Hello) -> Config:
    """Return the settings in force at a HELLO."""
    return Config(
        telemetry_period_ms=hello.telemetry_period_ms,
        dlpf=hello.dlpf,
        neutral=hello.neutral,
        minimum=hello.minimum,
        maximum=hello.maximum,
    )


def check(hello: Hello, serial: int) -> None:
    """Refuse a HELLO of another protocol, of another board, or with a zero scale.

    Parameters
    ----------
    serial : number of the board to accept; 0 accepts any

    Raises
    ------
    RigError : in one line, what is wrong
    """
    if hello.protocol != PROTOCOL or hello.layout != LAYOUT:
        major, minor, patch = hello.firmware
        raise RigError(
            f"the rig speaks protocol {hello.protocol} (layout {hello.layout:04x}, firmware "
            f"{major}.{minor}.{patch}), this program protocol {PROTOCOL} (layout "
            f"{LAYOUT:04x}); flash the firmware in hardware/firmware"
        )
    if serial not in (0, hello.serial):
        this = f"{hello.serial:08x}" if hello.serial else "without a number"
        raise RigError(
            f"the calibration is of rig {serial:08x}, this one is {this}; run"
            " `twin calibrate` on it"
        )
    if 0 in (hello.tick_ns, hello.adc_levels, hello.gyro_range_dps):
        raise RigError("the rig's HELLO has a scale of zero; flash the firmware in hardware/")
