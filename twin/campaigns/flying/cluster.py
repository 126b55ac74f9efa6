"""Flies the fragments of a campaign on a cluster of machines with Ray, extra `cluster`."""

import functools
import os
import socket
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from twin.campaigns.flying.runs import Runs, flown
from twin.campaigns.flying.store import Store
from twin.campaigns.sampling.parameters import Binding, binding
from twin.campaigns.sampling.study import Study, read
from twin.errors import TwinError
from twin.plant.compiled import compiled

Rows = list[dict[str, Any]]
LOCAL = "local"
ANSWERS_S = 5.0  # for a connection to the cluster
# what a client of HTTP/2, and so of gRPC, says first, with empty SETTINGS (RFC 9113, 3.4)
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
SETTINGS = 4  # type of the frame that a server answers with
RETRIES = 3  # of a fragment whose worker or machine died, before its runs are flown one by one
AHEAD = 2  # fragments given to each processor at a time


@dataclass
class Cluster:
    """Flies what is missing of a campaign in tasks of Ray; this process alone writes fragments.

    A fragment whose worker or machine dies is flown again elsewhere. A run that ends its worker
    also when it is flown alone gets the row of `lost`.

    Parameters
    ----------
    address : HOST:PORT of a running cluster, or `local` to start one on this machine
    workers : processes of a local cluster; one for each processor if omitted
    lost, flown : as of `Engine`
    """

    study: Study
    store: Store
    address: str
    workers: int | None
    lost: Callable[[int], Mapping[str, Any]]
    flown: Callable[[], None] = lambda: None

    def fragments(self) -> Generator[int, None, None]:
        """Fly; yields the fragments in order, each when it and all before it are complete.

        Raises
        ------
        TwinError : Ray is not installed, the cluster does not answer, fails or has another study,
            or rows cannot be written
        """
        ray = _connected(self.address, self.workers)
        try:
            yield from self._fragments(ray)
        except ray.exceptions.RayError as error:
            text = " ".join(str(error).split())[:300]
            raise TwinError(
                f"--ray {self.address}: {text or type(error).__name__};"
                " `twin campaign resume` continues"
            ) from None
        finally:
            ray.shutdown()

    def _fragments(self, ray: Any) -> Generator[int, None, None]:  # noqa: ANN401  a module
        fly = ray.remote(num_cpus=1, max_retries=RETRIES)(rows_of)
        place = self.study.place
        given = str(Path(place).resolve()) if Path(place).suffix else place
        waiting = self.store.prepare()[::-1]
        present = set(range(self.store.parts)) - set(waiting)
        at_work: dict[Any, int] = {}
        for part in range(self.store.parts):
            while part not in present:
                most = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
                while waiting and len(at_work) < most:
                    now = waiting.pop()
                    task = fly.remote(given, self.study.digest, list(self.store.runs_of(now)))
                    at_work[task] = now
                for task in ray.wait(list(at_work))[0]:
                    done = at_work.pop(task)
                    self._write(done, self._got(ray, fly, given, done, task))
                    present.add(done)
            yield part

    def _got(self, ray: Any, fly: Any, given: str, part: int, task: Any) -> Rows:  # noqa: ANN401
        """Rows of a fragment; where its worker kept dying its runs are flown one by one."""
        of_ray = ray.exceptions
        died = (
            of_ray.WorkerCrashedError, of_ray.NodeDiedError, of_ray.ObjectLostError,
            of_ray.OutOfMemoryError, of_ray.LocalRayletDiedError,
        )  # fmt: skip
        with suppress(*died):
            return self._answer(ray, task)
        rows: Rows = []
        for run in self.store.runs_of(part):
            try:
                rows += self._answer(ray, fly.remote(given, self.study.digest, [run]))
            except died:
                rows.append(dict(self.lost(run)))
        return rows

    def _answer(self, ray: Any, task: Any) -> Rows:  # noqa: ANN401
        try:
            answer: Rows | str = ray.get(task)
        except ray.exceptions.RayTaskError as error:
            text = " ".join(str(error.cause).split())
            raise TwinError(f"--ray {self.address}: a worker failed: {text[:300]}") from None
        if isinstance(answer, str):
            raise TwinError(f"--ray {self.address}: {answer}")
        return answer

    def _write(self, part: int, rows: Rows) -> None:
        try:
            self.store.write(part, rows)
        except OSError as error:
            raise TwinError(
                f"cannot write {self.store.file(part)}: {error.strerror or error};"
                " `twin campaign resume` continues"
            ) from None
        for _ in rows:
            self.flown()


def rows_of(place: str, digest: str, runs: list[int]) -> Rows | str:
    """Rows of runs, on the worker; a text where it cannot fly this study."""
    try:
        study, of_study, bound = _prepared(place, digest)
        with TemporaryDirectory(prefix="tvc-twin-") as scratch, compiled():
            work = flown(study, of_study, bound, Path(scratch))
            return [work(run) for run in runs]
    except TwinError as error:
        return f"on {socket.gethostname()}: {error}"


@functools.lru_cache(maxsize=1)
def _prepared(place: str, digest: str) -> tuple[Study, Runs, Binding]:
    study = read(place)
    if study.digest != digest:
        raise TwinError(f"{place}: differs from the study here, or its files or versions do")
    return study, Runs(study), binding(study.fly, study.vary, study.folder)


def _connected(address: str, workers: int | None) -> Any:  # noqa: ANN401  a module
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise TwinError(
            "--ray: needs Ray; run `pip install '.[cluster]'` in the project's folder"
        ) from None
    quiet = {"log_to_driver": False, "logging_level": "ERROR", "ignore_reinit_error": True}
    if address == LOCAL:
        processors = workers or os.cpu_count()
        ray.init(num_cpus=processors, include_dashboard=False, _node_ip_address="127.0.0.1",
                 **quiet)  # fmt: skip
        return ray
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        _check_answers(host, int(port))
        ray.init(address, **quiet)
    except (OSError, ValueError, OverflowError, RuntimeError) as error:
        text = " ".join(str(error).split())[:160]
        raise TwinError(f"--ray {address}: no cluster of Ray answers there: {text}") from None
    return ray


def _check_answers(host: str, port: int) -> None:
    """Raise OSError where no server of gRPC answers: Ray waits for minutes where one is silent."""
    with socket.create_connection((host, port), ANSWERS_S) as connection:
        if os.environ.get("RAY_USE_TLS", "0") != "0":
            return
        connection.sendall(PREFACE)
        answer = connection.recv(9)
    if len(answer) < 4 or answer[3] != SETTINGS:
        raise OSError("another program listens there")
