"""Flights with a rig in a process of its own, in real time: what a killed one leaves behind."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest

from analysis.recording import reader as recording
from tests.conftest import ROOT
from twin import viewer

TWIN = [sys.executable, "-m", "twin"]
PORTS = [
    pytest.param(
        [],
        id="pty",
        marks=[
            pytest.mark.skipif(os.name != "posix", reason="ptys are POSIX only"),
            pytest.mark.slow,
        ],
    ),
    pytest.param(["--port", "0"], id="tcp"),
]
STOPWATCH = """
from twin.cli.main import main
from twin.experiments import session
run = session.run
def timed(*args, each_tick=(), **kwargs):
    return run(*args, each_tick=(*each_tick, lambda ns: print(ns, flush=True)), **kwargs)
session.run = timed
main()
"""


@contextmanager
def served(*options):
    command = [*TWIN, "rig", "--json", *options]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as rig:
        try:
            yield json.loads(rig.stdout.readline())["port"]
        finally:
            rig.terminate()


@pytest.mark.parametrize("options", PORTS)
@pytest.mark.realtime
def test_a_killed_flight_loses_less_than_a_fifth_of_a_second_and_can_be_viewed(tmp_path, options):
    out = tmp_path / "fly.rrd"
    with served(*options) as url:
        flight = subprocess.Popen(
            [sys.executable, "-c", STOPWATCH, "fly", "--gimbal", url, "--out", str(out)],
            cwd=ROOT, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        last = 0
        while last < 2_500_000_000:
            last = int(flight.stdout.readline())
        os.kill(flight.pid, signal.SIGKILL)
        # every tick that was flown has told its time, those too that nobody had read yet
        last = max([last, *map(int, re.findall(r"(\d+)\n", flight.stdout.read()))])
        flight.wait()
        flight.stdout.close()
    # at once, as somebody would who saw it die; the file is being completed meanwhile
    run = recording.read(viewer.repaired(out.with_name("fly.rrd.partial")))
    assert last - run["gimbal/command"].time_ns[-1] <= 200_000_000
    # frames come 500 times a second, 2 ms of device and at most a few of wire and loop old
    assert last - run["gimbal/measured"].time_ns[-1] <= 200_000_000
    assert "ended unexpectedly" in run.events[-1].text
    steps = np.diff(run["gimbal/command"].time_ns)
    assert (steps == 4_000_000).all()  # nothing is missing before the end either
