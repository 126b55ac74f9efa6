"""Cost of a campaign: per run, per simulated second, scaling, memory; what a large one would take.

`python -m tests.benchmarks.campaign` prints all; physics, scaling, scale, prompt: only these.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from analysis.compiled import njit
from tests.benchmarks.timing import Row
from tests.twin.campaigns.studies import flown, linear, place, study
from twin.campaigns.flying.runs import Runs
from twin.config import Fly
from twin.experiments.assembly import make_plant
from twin.experiments.flight.fly import fly
from twin.plant import plant as plants
from twin.plant.compiled import compiled
from twin.plant.steps import stepping
from twin.plant.steps.smooth import Division, part

Floats = NDArray[np.float64]

TWIN = [sys.executable, "-m", "twin"]
LONGEST_S = 12.0  # of the flights compared
STEPS = 4  # of a control tick
SIMS = 4
STEADY_S = 3.0  # for which a vehicle that is not steered flies like one that is
ROUNDS = 7
MACHINES, CORES, FLIGHTS = 100, 2, 10_000_000


def table() -> Iterator[Row]:
    """Lines of the table."""
    for section in SECTIONS.values():
        yield from section()


def physics() -> Iterator[Row]:
    """A row against the bare steps of the same model, in processor time.

    A flight divides its steps where forces change within one, `twin.plant.steps.smooth`; the bare
    steps are whole ones, and the same parts.
    """
    for gimbal in ("linkage", "transfer-function"):
        config = Fly(gimbal=gimbal, programme="point", off_axis_deg=(20, 5), duration_s=LONGEST_S)
        with compiled():
            fly(config, recorded=False)
            plant = make_plant(config)
            plant.advance(1)  # sets the integrator
            model = plant.model
            batch = Batch(model, SIMS, 1)
            ticks = round(LONGEST_S / model.opt.timestep) // STEPS

            def bare(batch: Batch = batch, ticks: int = ticks) -> None:
                batch.reset()
                for _ in range(ticks):
                    batch.step(nstep=STEPS)

            lengths = _parts(config)
            stepped, divided, ticking, whole = [], [], [], []
            for _ in range(ROUNDS):  # taking turns; noise only adds to processor time
                stepped.append(_used(bare) / SIMS)
                divided.append(_stepped(plant, lengths))
                result = fly(config, recorded=False)
                ticking.append(result.physics_s)
                whole.append(result.cpu_s)
        base, note = min(stepped), "bare batch steps"
        claim = f"a simulated second of a row over bare steps of the same parts, {gimbal}"
        parts = "bare steps of the same parts"
        yield Row(claim, min(ticking) / min(divided), "×", most=1.2, peer=1.0, note=parts)
        share = len(lengths) / (ticks * STEPS)
        yield Row(f"parts for a whole step, {gimbal}", share, "", peer=1.0, note="undivided")
        claim = f"a simulated second of a row over bare batch steps, undivided, {gimbal}"
        yield Row(claim, min(ticking) / base, "×", peer=1.0, note=note)
        claim = f"the same with building the model of the row, flight of 12 s, {gimbal}"
        yield Row(claim, min(whole) / base, "×", peer=1.0, note=note)


def _parts(config: Fly) -> Floats:
    """Lengths of all parts of steps of a flight [s]."""
    lengths: list[float] = []

    def noted(division: Division, now: float, end: float) -> float:
        lengths.append(part(division, now, end))
        return lengths[-1]

    with patch.object(plants, "part", noted), patch.object(stepping, "functions", lambda: None):
        fly(config, recorded=False)
    return np.array(lengths)


def _stepped(plant: plants.Plant, lengths: Floats) -> float:
    """Processor time of bare steps of these lengths [s].

    An unsteered vehicle tumbles and its numbers overflow after 5 s: it starts anew before.
    """
    steps, used = plant._native_steps(), 0.0
    assert steps is not None
    for some in np.array_split(lengths, round(lengths.sum() / STEADY_S)):
        plant.reset()
        used += _used(partial(_bare, steps, some))
    return used


@njit(nogil=True)
def _bare(p: stepping.Steps, lengths: Floats) -> None:
    for h in lengths:
        p.clock[0][0] = h
        stepping.call(p.step, p.model, p.data)


def scaling() -> Iterator[Row]:
    """Throughput of two processes over that of one."""
    text = linear(64)

    def busy(run: int) -> dict[str, object]:
        ended = time.thread_time() + 0.05
        while time.thread_time() < ended:
            pass
        return work(run)

    seconds, used = [], []
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            s = study(Path(folder), text)
            work = place(s, Runs(s))
            began, before = time.perf_counter(), _processor()
            flown(s, Path(folder, "out"), busy, workers)
            seconds.append(time.perf_counter() - began)
            used.append(_processor() - before)
    share = seconds[0] / seconds[1] / 2
    claim = "throughput of two processes over twice that of one"
    yield Row(claim, share, least=0.9, peer=1.0, note="one process")
    yield Row("the same by processor time a run", used[0] / used[1], least=0.9, peer=1.0)


def scale() -> Iterator[Row]:
    """Cost of a stand-in run in campaigns of 100 to 100 000, and their memory."""
    sizes, costs = (100, 10_000, 100_000), []
    for n in sizes:
        with tempfile.TemporaryDirectory() as folder:
            s = study(Path(folder), linear(n))
            before = _processor()
            store = flown(s, Path(folder, "out"))
            costs.append((_processor() - before) / n)
            assert len(list(store.present())) == store.parts
    flight = _flight()
    for n, cost in zip(("100", "10⁴", "10⁵"), costs, strict=True):
        note = "a flight to a point 500 m away"
        yield Row(f"engine a run, {n} runs", cost * 1e3, "ms", peer=flight * 1e3, note=note)
    (_, some, many), (_, less, more) = sizes, costs
    added = (more * many - less * some) / (many - some)
    yield Row("engine a further run", added * 1e3, "ms", peer=flight * 1e3, note=note)
    yield Row("engine at the start, once", (less - added) * some, "s")
    spread = (flight + max(costs)) / (flight + min(costs)) - 1.0
    yield Row("spread of a run with its flight, 10² to 10⁵ runs", 100 * spread, "%", most=10)
    own, forked = (
        resource.getrusage(who).ru_maxrss / 1024
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    most = max(own, forked)
    yield Row("memory with 10⁵ runs, largest process", most, "MB", most=1000)
    days = FLIGHTS * (flight + costs[-1]) / MACHINES / CORES / 86_400
    yield Row(f"10⁷ flights, {MACHINES} machines of {CORES} cores, days", days)


def _flight() -> float:
    """Processor time of a flight to a point 500 m away, without a recording [s]."""
    config = Fly(programme="point", off_axis_deg=(20, 5))
    with compiled():
        fly(config, recorded=False)
        return min(_used(lambda: fly(config, recorded=False)) for _ in range(3))


def prompt() -> Iterator[Row]:
    """Thirty judged flights from prompt to prompt."""
    shipped = Path(__file__).parents[2] / "twin" / "campaigns" / "studies" / "dispersion.toml"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "thirty.toml")
        file.write_text(shipped.read_text().replace("n = 1000", "n = 30"))
        seconds = []
        for _ in range(2):
            began = time.perf_counter()
            out = ["--out", str(Path(folder, "out")), "--force", "--fail-if", "hit_rate < 0.5"]
            subprocess.run([*TWIN, "campaign", "run", str(file), *out], check=True,
                           capture_output=True)  # fmt: skip
            seconds.append(time.perf_counter() - began)
    best = min(seconds)
    yield Row("30 judged flights, prompt to prompt", best, "s", most=10)


def _used(action: Callable[[], object]) -> float:
    """Processor time of an action [s], which other processes hardly change."""
    before = time.process_time()
    action()
    return time.process_time() - before


def _processor() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


SECTIONS = {"physics": physics, "scaling": scaling, "scale": scale, "prompt": prompt}

if __name__ == "__main__":
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for name in sys.argv[1:] or SECTIONS:
        for line in SECTIONS[name]():
            print(line, flush=True)
