"""What a line costs without us: a peer in a process of its own, and a bare pyserial echo."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import serial

from hardware.device import Device
from hardware.protocol import Board, Encoder, Ping
from twin.loop import realtime

FRAME = 64  # bytes, about a telemetry frame
SECONDS = 12.0
PERIOD_S = 0.002


@contextmanager
def served(command: list[str]) -> Iterator[str]:
    """Port of a process that prints it as JSON in its first line."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield json.loads(process.stdout.readline())["port"]
        finally:
            process.terminate()


def peer(mode: str, kind: str) -> list[str]:
    """Command of a peer, see `desk_peer`, on a `pty` or over `tcp`."""
    return [sys.executable, "-m", "tests.benchmarks.desk_peer", mode, kind]


def echo(kind: str) -> tuple[float, float]:
    """Round trip of a frame's bytes to another process and back, median and 99 % [ms]."""
    taken = []
    with (
        served(peer("echo", kind)) as url,
        serial.serial_for_url(url, 500_000, timeout=1.0) as port,
        realtime.requested(),
    ):
        due = time.monotonic()
        for k in range(int(0.5 * SECONDS / PERIOD_S)):
            began = time.perf_counter()
            port.write(bytes(FRAME))
            port.read(FRAME)
            if k > 50:
                taken.append(time.perf_counter() - began)
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))
    p50, p99 = np.percentile(taken, [50, 99]) * 1e3
    return float(p50), float(p99)


def answering() -> float:
    """What the peer that answers at once takes for that, median [ms]; measured apart from it."""
    rig, taken = Device(Board.EMULATOR, 1), []
    encoder = Encoder()
    with realtime.requested():
        for k in range(400):
            time.sleep(5 * PERIOD_S)  # a processor that has done other things meanwhile
            frame = encoder.encode(Ping(k))
            began = time.perf_counter()
            rig.receive(frame, k, k)
            bytes(rig.transmit)
            rig.transmit.clear()
            taken.append(time.perf_counter() - began)
    return float(np.median(taken)) * 1e3
