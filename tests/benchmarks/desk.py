"""The desk: how old a mirrored pose is, what of that is ours, how fast a simulated Nano runs."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from hardware.simavr.nano import missing
from tests.benchmarks.line import echo, served
from tests.benchmarks.timing import row
from twin.hil import RigOptions, device
from twin.physics import native

TWIN = [sys.executable, "-c", "from twin.cli.main import main; main()"]
SECONDS = 12.0
SIMULATED_US = 4_000_000


def table() -> Iterator[str]:
    """Lines of the table."""
    p50, p99 = echo("pty")
    yield row("bare pyserial echo over a pty, p50", f"{p50:.2f} ms", "(for comparison)", True)
    yield row("the same, p99", f"{p99:.2f} ms", "(for comparison)", True)
    p50, p99 = _mirror([*TWIN, "rig", "--json"])
    yield row("mirror: device stamp to pose, 500 Hz pty, p50", f"{p50:.2f} ms", "", True)
    yield row("the same, p99", f"{p99:.2f} ms", "< 8 ms", p99 < 8)
    p50, p99 = _mirror([sys.executable, "-m", "tests.benchmarks.desk_peer", "rig", "pty"])
    yield row("mirror: last byte arrived to pose, p50", f"{p50:.2f} ms", "", True)
    yield row("the same, p99", f"{p99:.2f} ms", "< 1.5 ms", p99 < 1.5)
    for kind, bound in (("emulator", 0.0), ("firmware", 4.0)):
        if kind == "firmware" and missing():
            yield row(
                "simulated firmware", "not measured", f"without {', '.join(missing())}", False
            )
            continue
        speed = max(_speed(kind) for _ in range(3))
        claim = f"{kind} over the MuJoCo bench, times real time"
        yield row(claim, f"{speed:.1f} ×", f"≥ {bound:g} ×" if bound else "", speed >= bound)


def _mirror(command: list[str]) -> tuple[float, float]:
    """Pose age of a mirror in a process of its own [ms]."""
    with served(command) as url, tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder, "mirror.rrd"))
        asked = ["mirror", "--gimbal", url, "--duration-s", str(SECONDS), "--out", out, "--json"]
        done = subprocess.run([*TWIN, *asked], capture_output=True, text=True, check=True)
    p50, p99 = json.loads(done.stdout)["pose_age_ms"]
    return p50, p99


def _speed(kind: str) -> float:
    """Rig time per processor time in steps of 1 ms; others on this machine do not count."""
    with native.installed():
        rig = device(RigOptions(kind))
        rig.advance_us(200_000)
        began = time.process_time()
        for _ in range(SIMULATED_US // 1000):
            rig.advance_us(1000)
            rig.read()
        taken = time.process_time() - began
        rig.close()
    return SIMULATED_US * 1e-6 / taken


if __name__ == "__main__":
    for line in table():
        print(line, flush=True)
