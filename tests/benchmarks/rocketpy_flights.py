"""Passive flights beside RocketPy's, one process each, in processor time.

RocketPy is not a dependency: it is used where this interpreter has it, or the one that the
environment variable ROCKETPY_PYTHON names.
"""

import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.timing import Row
from twin.config import Fly
from twin.experiments.flight.fly import fly
from twin.plant.model import reuse
from twin.plant.model.compose import MJCF

PEER = Path(__file__).with_name("rocketpy_peer.py")
VALETUDO = MJCF / "examples" / "flights" / "valetudo.toml"
ROUNDS, FLIGHTS = 5, 3
RATES = (250.0, 50.0)  # Hz
KINDS = ("not recorded", "recorded", "not recorded, its model built anew")
LEAST = (5.0, 1.5, None)


def table() -> Iterator[Row]:
    """Figures of the table: medians of the ratios of rounds that take turns."""
    other = peer(str(FLIGHTS))
    if other is None:
        yield Row("passive flights", None, note="skipped: rocketpy is not installed")
        return
    with tempfile.TemporaryDirectory() as folder:
        for rate in RATES:
            _flown(rate, None)  # compiles
        rounds = [_round(Path(folder, "flight.rrd")) for _ in range(ROUNDS)]
    name = f"RocketPy {other['version']}, build included"
    for rate, kind in itertools.product(RATES, KINDS):
        ratios = [r["peer"] / r[rate, kind] for r in rounds]
        least = LEAST[KINDS.index(kind)] if rate == RATES[-1] else None
        note = f"{min(ratios):.2f} to {max(ratios):.2f}; {name}"
        what = f"passive flights at {rate:g} Hz, {kind}"
        yield Row(what, statistics.median(ratios), "×", least=least, peer=1.0, note=note)
    flown, converged = other["flown"], other["converged"]
    yield Row("apogee, RocketPy to its converged", _percent(flown[0], converged[0]), "%")
    finest = fly(_config(250.0, dt=0.001), recorded=False).figures
    for rate in RATES:
        error = _percent(_flown(rate, None)[1], finest.apogee_m)
        yield Row(f"apogee, twin at {rate:g} Hz to 1 ms", error, "%", most=0.01)
    yield Row("apogee, twin to RocketPy", _percent(finest.apogee_m, converged[0]), "%", most=1.0)


def _percent(value: float, of: float) -> float:
    return 100.0 * abs(value / of - 1.0)


def _round(out: Path) -> dict[object, float]:
    """Processor time of one flight [s], of the peer, and by rate and kind."""
    spent: dict[object, float] = {"peer": float((peer(str(FLIGHTS)) or {})["flight_s"])}
    for rate, kind in itertools.product(RATES, KINDS):
        spent[rate, kind] = min(_spent(rate, kind, out) for _ in range(FLIGHTS))
    return spent


def _spent(rate: float, kind: str, out: Path) -> float:
    if kind == KINDS[2]:
        reuse.forget()
    return _flown(rate, out if kind == KINDS[1] else None)[0]


def _config(rate: float, out: Path | None = None, dt: float | None = None) -> Fly:
    return Fly(vehicle=VALETUDO, control_hz=rate, out=out, dt=dt, force=True)


def _flown(rate: float, out: Path | None) -> tuple[float, float]:
    """Processor time of one flight, build included [s], and its apogee [m]."""
    if out is not None:
        out.unlink(missing_ok=True)
    began = time.process_time()
    result = fly(_config(rate, out), recorded=out is not None)
    return time.process_time() - began, float(result.figures.apogee_m or 0.0)


def peer(*arguments: str) -> dict[str, Any] | None:
    """What the peer prints, or None where no interpreter has RocketPy."""
    python = os.environ.get("ROCKETPY_PYTHON", sys.executable)
    known = subprocess.run(
        [python, "-P", "-c", "import rocketpy"], capture_output=True, check=False
    )
    if known.returncode:
        return None
    command = [python, "-P", str(PEER), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    printed: dict[str, Any] = json.loads(done.stdout)
    return printed


if __name__ == "__main__":
    for figure in table():
        print(figure, flush=True)
