"""`python -m hardware.firmware`: write the generated headers, build the ELF, print its size."""

import argparse
import sys
from pathlib import Path

from hardware.firmware.build import (
    FLASH_SIZE,
    RAM_SIZE,
    FirmwareError,
    build_elf,
    size,
    write_generated,
)


def main() -> int:
    """Run the command; 2 if the tools are missing or the sources do not compile."""
    parser = argparse.ArgumentParser(prog="python -m hardware.firmware", description=__doc__)
    parser.add_argument(
        "--headers-only", action="store_true", help="only write the generated headers"
    )
    parser.add_argument("--out", type=Path, help="path of the ELF; default: in the user's cache")
    arguments = parser.parse_args()
    for path in write_generated():
        print(f"wrote {path}")
    if arguments.headers_only:
        return 0
    try:
        elf = build_elf(arguments.out)
        used = size(elf)
    except FirmwareError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{elf}: {used.flash} of {FLASH_SIZE} B flash, {used.ram} of {RAM_SIZE} B RAM")
    return 0


if __name__ == "__main__":
    sys.exit(main())
