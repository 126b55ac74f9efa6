"""One simulated hour on the emulated rig: the memory of the process stays flat."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil

from tests.abuse.attempt import Row

HOUR = 3600.0  # s of experiment time
MIRROR = ["-m", "twin", "mirror", "--gimbal", "emulator"]
FLAT = 20.0  # MB that the last tenth may lie above the second
PERIOD = 0.2  # s between looks at the memory


def row(folder: Path, seconds: float = HOUR) -> Row:
    """Mirror an emulated rig in lockstep for a simulated time; one attempt."""
    command = [sys.executable, *MIRROR, "--clock", "lockstep", "--duration-s", f"{seconds:g}"]
    out, sizes, began = folder / "hour.rrd", [], time.monotonic()
    with subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        watched = psutil.Process(process.pid)
        try:
            while process.poll() is None:
                sizes.append(watched.memory_info().rss / 1e6)
                time.sleep(PERIOD)
        except BaseException:  # interrupted
            process.kill()
            raise
        assert process.stderr is not None
        errors = process.stderr.read()
    found = Row("simulated hour", 1, time.monotonic() - began)
    fault = errors if process.returncode else grown(sizes)
    if fault:
        found.failed.append((" ".join(command[3:]), b"", fault))
    return found


def grown(sizes: list[float]) -> str:
    """What is wrong with memory [MB] over a run; "" if it is flat after the first tenth."""
    early, late = (float(np.median(part)) for part in np.array_split(sizes, 10)[1::8])
    print(f"memory {early:.0f} MB in the second tenth, {late:.0f} MB in the last", file=sys.stderr)
    return f"memory grew from {early:.0f} to {late:.0f} MB" if late - early > FLAT else ""


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        print(row(Path(place), float(sys.argv[1]) if sys.argv[1:] else HOUR))
