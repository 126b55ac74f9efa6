"""One simulated hour on the emulated rig: the memory of the process stays flat.

python -m tests.abuse.endurance         an hour
python -m tests.abuse.endurance 1800    another simulated time [s]

Flat is: after ten minutes, the memory of its own grows by at most 20 MB an hour. Of its own are
anonymous and shared pages (`RssAnon`, `RssShmem`); those of mapped files, which the kernel keeps
and drops as it likes, differ by 80 MB between two runs. Until nine minutes the recorder's writes
grow, to 20 s of signals and 60 s of the scene, and its buffers with them. The growth cannot be
zero: Rerun keeps an index of all chunks of a file until the file is closed, up to 5 kB for each of
4000 chunks an hour.
"""

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.abuse.attempt import Row

HOUR = 3600.0  # s of experiment time
MIRROR = ["-m", "twin", "mirror", "--gimbal", "emulator"]
FLAT = 20.0  # MB an hour
WARM, WINDOW = 600.0, 300.0  # s of experiment time: before the first look, and a look
PERIOD = 0.2  # s between two samples of the memory


def row(folder: Path, seconds: float = HOUR) -> Row:
    """Mirror an emulated rig in lockstep for a simulated time; one attempt."""
    command = [sys.executable, *MIRROR, "--clock", "lockstep", "--duration-s", f"{seconds:g}"]
    out, sizes, began = folder / "hour.rrd", [], time.monotonic()
    with subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            while process.poll() is None:
                sizes += resident(process.pid)
                time.sleep(PERIOD)
        except BaseException:  # interrupted
            process.kill()
            raise
        assert process.stderr is not None
        errors = process.stderr.read()
    found = Row("simulated hour", 1, time.monotonic() - began)
    own, whole = np.transpose(sizes)
    tenths = [f"{part.mean():.0f}" for part in np.array_split(own, 10)]
    print(f"memory of its own in each tenth [MB]: {' '.join(tenths)};", file=sys.stderr, end=" ")
    print(f"at most {whole.max():.0f} with mapped files", file=sys.stderr)
    fault = errors if process.returncode else grown(own.tolist(), seconds)
    if fault:
        found.failed.append((" ".join(command[3:]), b"", fault))
    return found


def resident(process: int) -> list[tuple[float, float]]:
    """Memory of its own and with mapped files [MB] of a process; nothing where it has ended."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return []
    sizes = {
        line.split(":")[0]: line.split()[1] for line in lines if line.startswith(("Vm", "Rss"))
    }
    if "RssAnon" not in sizes:
        return []
    kinds = [1.024e-3 * int(sizes[kind]) for kind in ("RssAnon", "RssShmem", "VmRSS")]
    return [(kinds[0] + kinds[1], kinds[2])]


def grown(sizes: Sequence[float], seconds: float = HOUR) -> str:
    """What is wrong with memory [MB] sampled evenly over a run; "" if it is flat."""
    ends = (WARM, WARM + WINDOW, seconds - WINDOW, seconds)
    places = [round(end / seconds * len(sizes)) for end in ends]
    early, late = (float(np.median(sizes[a:b])) for a, b in (places[:2], places[2:]))
    hourly = (late - early) / ((ends[2] - ends[0]) / HOUR)
    change = f"from {early:.1f} to {late:.1f} MB, {hourly:+.1f} MB an hour"
    print(f"memory after {WARM:g} s: {change}", file=sys.stderr)
    return f"memory grew {change}" if hourly > FLAT else ""


if __name__ == "__main__":
    import tempfile

    length = float(sys.argv[1]) if sys.argv[1:] else HOUR
    if length < WARM + 2 * WINDOW:
        sys.exit(f"{length:g} s are too few: growth is counted after {WARM:g} s")
    with tempfile.TemporaryDirectory() as place:
        print(row(Path(place), length))
