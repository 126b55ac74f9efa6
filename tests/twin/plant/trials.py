"""What a process with limits may be asked to do; `python -m tests.twin.plant.trials`."""

import ctypes
import os
import sys
import tempfile
import time
from pathlib import Path

from analysis import limited


def main() -> None:
    asked = sys.stdin.read()
    if os.sep in asked:  # before the limits, since they allow no file
        Path(asked).write_text(str(os.getpid()))
    limited.confine()
    if asked == "crash":
        ctypes.string_at(0)
    elif asked == "spin":
        while True:
            pass
    elif asked == "memory":
        bytearray(10**9)
    elif asked == "write":
        with tempfile.TemporaryFile() as file:
            file.write(b"x")
    elif asked == "refuse":
        limited.refuse("no good")
    elif asked == "echo":
        print(asked, end="")
    else:
        time.sleep(60)


if __name__ == "__main__":
    main()
