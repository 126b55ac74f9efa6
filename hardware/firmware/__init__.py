"""The Nano's firmware: its sources, and how they are built and kept in step with the protocol."""

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
