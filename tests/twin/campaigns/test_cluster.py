"""A campaign on a cluster of Ray: the rows of this machine's processes, whatever dies meanwhile."""

import os
import re
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tests.twin.campaigns.studies import HIT, linear, place, study
from twin.campaigns.campaign import campaign, flying
from twin.campaigns.flying import cluster as cluster_module
from twin.campaigns.flying.cluster import rows_of
from twin.campaigns.flying.runs import Runs
from twin.campaigns.flying.runs import flown as real
from twin.campaigns.flying.store import Store
from twin.campaigns.sampling.parameters import binding
from twin.cli.command import run
from twin.config.campaign import Campaign
from twin.errors import TwinError

SHORT = """
[fly]
gimbal = "transfer-function"
duration_s = 0.5

[vary.wind_speed]
distribution = "normal"
mean = 3
sd = 1

[design]
n = {n}
"""


# an empty SETTINGS frame, with which a server of gRPC begins (RFC 9113, 3.4)
SETTINGS = bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))


@dataclass(frozen=True, eq=False)
class Task:
    """A call that is made later."""

    function: Any
    given: tuple[Any, ...]


class FakeRay(ModuleType):
    """Ray as the campaign uses it: tasks run when their answer is asked for, the last one first.

    Parameters
    ----------
    deaths : how often the worker of a task with this run dies, by run
    fails : calls of `get` or `wait` that raise: name, number of the call, error
    """

    def __init__(self, deaths=None, fails=None):
        super().__init__("ray")
        base = type("RayError", (Exception,), {})
        died = ("WorkerCrashedError", "NodeDiedError", "ObjectLostError", "OutOfMemoryError",
                "LocalRayletDiedError", "RaySystemError")  # fmt: skip
        self.exceptions = SimpleNamespace(RayError=base)
        for name in died:
            setattr(self.exceptions, name, type(name, (base,), {}))
        self.exceptions.RayTaskError = type("RayTaskError", (base,), {"cause": OSError("no room")})
        self.deaths, self.fails = dict(deaths or {}), dict(fails or {})
        self.submitted, self.flown, self.open, self.most = [], [], 0, 0
        self.calls = {"get": 0, "wait": 0}
        self.down = False

    def init(self, *_, **__):
        pass

    def shutdown(self):
        self.down = True

    def cluster_resources(self):
        return {"CPU": 2.0}

    def remote(self, **_):
        def of(function):
            return SimpleNamespace(remote=lambda *given: self._task(function, *given))

        return of

    def _task(self, function, *given):
        self.submitted.append(given[2])
        self.open += 1
        self.most = max(self.most, self.open)
        return Task(function, given)

    def _failing(self, call):
        self.calls[call] += 1
        if self.calls[call] == self.fails.get(call, (0, ""))[0]:
            raise getattr(self.exceptions, self.fails[call][1])("the cluster\nis gone")

    def wait(self, tasks):
        self._failing("wait")
        return tasks[-1:], tasks[:-1]

    def get(self, task):
        self._failing("get")
        self.open -= 1
        for number in task.given[2]:
            if self.deaths.get(number, 0):
                self.deaths[number] -= 1
                raise self.exceptions.WorkerCrashedError
        answer = task.function(*task.given)
        self.flown += task.given[2]
        return answer


@pytest.fixture
def cluster(tmp_path, monkeypatch):
    """A function that flies a study of the stand-in on a fake cluster that answers."""
    s = study(tmp_path, linear(48, HIT))
    runs = Runs(s)
    work = place(s, runs)
    monkeypatch.setattr(cluster_module, "rows_of", lambda *given: [work(r) for r in given[2]])
    kinds = dict.fromkeys(runs.columns, float)
    store, alone = (Store(tmp_path / name, s, runs.count, kinds) for name in ("out", "alone"))
    store.begin(force=False)
    alone.prepare()
    for part in range(alone.parts):
        alone.write(part, [work(r) for r in alone.runs_of(part)])

    monkeypatch.setattr(cluster_module, "_check_answers", lambda *_: None)

    def fly(ray):
        monkeypatch.setitem(sys.modules, "ray", ray)
        flying(s, runs, store, work, None, "127.0.0.1:6379")
        return store.table()

    fly.alone = alone.table()
    return fly


def test_fragments_flown_in_tasks_in_any_order_are_those_of_this_machine(cluster):
    table = cluster(ray := FakeRay())
    assert table.equals(cluster.alone)
    assert sorted(ray.flown) == list(range(48))
    assert len(ray.submitted) == 6
    assert ray.most == 2 * cluster_module.AHEAD
    assert ray.down


def test_runs_of_a_dead_worker_are_flown_again_one_by_one_and_nothing_twice(cluster):
    """Run 20 ends its worker once, run 35 every time."""
    table = cluster(ray := FakeRay(deaths={20: 1, 35: 9}))
    assert sorted(ray.flown) == [r for r in range(48) if r != 35]
    again = [runs for runs in ray.submitted if len(runs) == 1]
    assert sorted(again) == [[r] for r in (*range(16, 24), *range(32, 40))]
    outcomes = table["outcome"].to_pylist()
    assert [r for r, o in enumerate(outcomes) if o == "crashed"] == [35]
    rest = [r for r in range(48) if r != 35]
    assert table.take(rest).equals(cluster.alone.take(rest))


@pytest.mark.parametrize(
    ("fails", "message"),
    [({"get": (3, "RaySystemError")}, "the cluster is gone; `twin campaign resume` continues"),
     ({"wait": (3, "RaySystemError")}, "the cluster is gone; `twin campaign resume` continues"),
     ({"get": (3, "RayTaskError")}, "a worker failed: no room")],
)  # fmt: skip
def test_a_cluster_that_fails_is_one_line_and_the_campaign_is_resumed(cluster, fails, message):
    with pytest.raises(TwinError, match=rf"--ray 127.0.0.1:\d+: {message}") as refused:
        cluster(broken := FakeRay(fails=fails))
    assert "\n" not in str(refused.value)
    assert broken.down
    assert cluster(after := FakeRay()).equals(cluster.alone)
    assert sorted(broken.flown + after.flown) == list(range(48))


def test_a_machine_with_another_study_is_refused(cluster, monkeypatch):
    monkeypatch.setattr(cluster_module, "rows_of", lambda *_: "on b: differs from the study here")
    with pytest.raises(TwinError, match=r"--ray 127.0.0.1:\d+: on b: differs from the study here"):
        cluster(FakeRay())


def test_a_worker_flies_the_rows_of_this_machine_or_says_why_not(tmp_path):
    s = study(tmp_path, SHORT.format(n=8).replace("0.5", "0.05"))
    runs = Runs(s)
    work = real(s, runs, binding(s.fly, s.vary, s.folder), tmp_path)
    assert rows_of(s.place, s.digest, [1, 3]) == [work(1), work(3)]
    assert re.match(r"on \S+: .*differs from the study here", rows_of(s.place, "other", [1]))


@pytest.mark.parametrize(
    ("answer", "error", "says"),
    [(None, None, "refused"), (b"", None, "timed out"), (b"HTTP/1.1 400", None, "another program"),
     (SETTINGS, ConnectionError("no GCS"), "no GCS"), (SETTINGS, RuntimeError("a\nb"), "a b")],
)  # fmt: skip
def test_an_address_without_a_cluster_is_one_line_with_exit_2(
    tmp_path, monkeypatch, capsys, answer, error, says
):
    """Nobody listens, a silent program, a server of the web, and one of gRPC that is not Ray's."""
    s = study(tmp_path, SHORT.format(n=8))
    monkeypatch.setitem(sys.modules, "ray", ray := FakeRay())
    monkeypatch.setattr(ray, "init", lambda *_, **__: raised(error))
    monkeypatch.setattr(cluster_module, "ANSWERS_S", 0.2 if answer == b"" else 5.0)
    monkeypatch.setattr("twin.campaigns.campaign._warm_up", lambda _: None)
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        if answer is None:
            other.close()
        elif answer:
            Thread(target=lambda: other.accept()[0].sendall(answer), daemon=True).start()
        with pytest.raises(SystemExit) as end:
            run(["campaign", "run", s.place, "--ray", address, "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err.strip().splitlines()
    assert end.value.code == 2
    assert said[-1].startswith(f"twin: --ray {address}: no cluster of Ray answers there: ")
    assert says in said[-1]


def raised(error):
    raise error


def test_a_report_needs_no_cluster():
    with pytest.raises(TwinError, match="--ray local: is for `twin campaign run` and `resume`"):
        Campaign("report", "dispersion", ray="local").validate()


@pytest.mark.slow
def test_a_node_and_a_worker_killed_lose_nothing_and_fly_nothing_twice(tmp_path, monkeypatch):
    """Three nodes; the first rows that arrive end a worker, later ones a whole node."""
    pytest.importorskip("ray", reason="the extra cluster is not installed")
    cluster_utils = pytest.importorskip("ray.cluster_utils")
    s = study(tmp_path, SHORT.format(n=96))
    alone = campaign(Campaign("run", s.place, out=tmp_path / "alone"))
    nodes = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    extra = [nodes.add_node(num_cpus=1) for _ in range(2)]
    nodes.wait_for_nodes()
    written, ended = [], []
    write = Store.write

    def watched(self, part, rows):
        write(self, part, rows)
        written.append(part)
        if len(written) == 2:
            ended.append(_end_a_worker(extra[1]))
        if len(written) == 4:
            nodes.remove_node(extra[0], allow_graceful=False)
            ended.append("node")

    monkeypatch.setattr(Store, "write", watched)
    try:
        result = campaign(Campaign("run", s.place, ray=nodes.address, out=tmp_path / "out"))
    finally:
        nodes.shutdown()
    assert len(ended) == 2
    assert sorted(written) == list(range(12))  # each once
    assert (result.new, result.answers.outcomes) == (96, alone.answers.outcomes)
    runs = Runs(s)
    kinds = dict.fromkeys(runs.columns, float)
    flown, here = (Store(tmp_path / f, s, runs.count, kinds).table() for f in ("out", "alone"))
    assert flown.equals(here)


def _end_a_worker(node) -> int:
    """End a process of a node that flies, by force."""
    raylet = node.all_processes["raylet"][0].process.pid
    for _ in range(500):
        for folder in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                if parent == raylet and b"rows_of" in (folder / "cmdline").read_bytes():
                    os.kill(int(folder.name), signal.SIGKILL)
                    return int(folder.name)
        time.sleep(0.02)
    raise AssertionError("no worker flies on the node")
