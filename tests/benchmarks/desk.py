"""The desk: how old a mirrored pose is, what of that is ours, how fast a simulated Nano runs."""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from hardware.simavr.nano import missing
from tests.benchmarks.line import echo, peer, served
from tests.benchmarks.timing import Row
from twin.hil import RigOptions, device
from twin.physics import native

TWIN = [sys.executable, "-m", "twin"]
SECONDS = 12.0
SIMULATED_US = 4_000_000


def table() -> Iterator[Row]:
    """Lines of the table."""
    bare = echo("pty")
    measured = (
        ("mirror: device stamp to pose, 500 Hz pty", [*TWIN, "rig", "--json"], 8.0),
        ("mirror: last byte arrived to pose", peer("rig", "pty"), 1.5),
    )
    for claim, command, most in measured:
        p50, p99 = _mirror(command)
        note = "bare pyserial echo over a pty"
        yield Row(f"{claim}, p50", p50, "ms", peer=bare[0], note=note)
        yield Row(f"{claim}, p99", p99, "ms", most=most, peer=bare[1], note=note)
    for kind, least in (("emulator", None), ("firmware", 4.0)):
        without = missing() if kind == "firmware" else ()
        speed = None if without else max(_speed(kind) for _ in range(3))
        note = f"without {', '.join(without)}" if without else "real time"
        claim = f"{kind} over the MuJoCo bench, times real time"
        yield Row(claim, speed, "×", least=least, peer=1.0, note=note)


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
