"""A campaign on a cluster of Ray: the rows of this machine's processes, whatever dies meanwhile."""

import os
import signal
import socket
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests.twin.campaigns import study
from twin.campaigns.campaign import campaign
from twin.campaigns.runs import Runs
from twin.campaigns.store import Store
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


def test_an_address_that_does_not_answer_is_one_line(tmp_path):
    pytest.importorskip("ray", reason="the extra cluster is not installed")
    s = study(tmp_path, SHORT.format(n=8))
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # and does not listen
        address = f"127.0.0.1:{closed.getsockname()[1]}"
        with pytest.raises(TwinError, match=f"--ray {address}: no cluster of Ray answers there"):
            campaign(Campaign("run", s.place, ray=address, out=tmp_path / "out"))


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
