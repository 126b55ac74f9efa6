"""The Nano's firmware: sources, build, and headers generated from the protocol."""

from hardware.firmware.build import (
    FirmwareError,
    build_elf,
    build_hash,
    generated,
    missing_tools,
    size,
    write_generated,
)

__all__ = [
    "FirmwareError",
    "build_elf",
    "build_hash",
    "generated",
    "missing_tools",
    "size",
    "write_generated",
]
