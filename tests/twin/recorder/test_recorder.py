"""The recorder: nothing lost, nothing different between two runs, nothing in the loop's way."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
import tracemalloc
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import psutil
import pytest
from rerun.chunk import RrdReader

from analysis import schema
from analysis.recording import reader as recording
from tests.benchmarks import long_run
from tests.conftest import ROOT
from tests.twin.recorder import runs
from twin import viewer
from twin.recorder import DetachedRecorder, Recorder, RecorderError, feed
from twin.recorder.feed import Feed
from twin.recorder.process import ring
from twin.recorder.scene import scene, shapes
from twin.recorder.scene.poses import Poses
from twin.viewer import process

pytestmark = pytest.mark.looks


def compare(a, b):
    options = ["rrd", "compare", "--unordered", "--ignore-timeline", schema.WALL_TIME]
    done = subprocess.run([process.binary(), *options, a, b], capture_output=True, text=True)
    print(done.stderr[:2000])
    return done.returncode


def test_two_runs_with_the_same_data_compare_equal(tmp_path):
    for name, offset in (("a.rrd", 0), ("b.rrd", 12345)):
        runs.fly(tmp_path / name, 2.2, wall_offset=offset)
    assert compare(tmp_path / "a.rrd", tmp_path / "b.rrd") == 0


def test_two_runs_with_the_same_data_are_equal_to_the_last_bit(tmp_path):
    read = []
    for name in ("a.rrd", "b.rrd"):
        runs.fly(tmp_path / name, 2.2)
        read.append(recording.read(tmp_path / name))
    # `rrd compare` forgives the last bits of a number; this does not
    for name, series in read[0].series.items():
        assert series.values.tobytes() == read[1][name].values.tobytes(), name
        assert series.time.tobytes() == read[1][name].time.tobytes(), name


def test_a_difference_in_one_row_is_seen(tmp_path):
    for name, last in (("a.rrd", 1.0), ("b.rrd", 1.001)):
        with Recorder(tmp_path / name, signals=["vehicle/mass"], properties={}) as recorder:
            for tick in range(10):
                recorder.row[:] = last if tick == 9 else 1.0
                recorder.commit(tick * runs.PERIOD_NS, tick)
    assert compare(tmp_path / "a.rrd", tmp_path / "b.rrd") == 1


@pytest.mark.thorough
def test_a_minute_takes_at_most_20_megabytes_and_a_second(tmp_path, capsys):
    start = time.perf_counter()
    runs.fly(tmp_path / "minute.rrd", 60.0)
    took, size = time.perf_counter() - start, (tmp_path / "minute.rrd").stat().st_size / 1e6
    width = sum(len(schema.SIGNALS[name].components) for name in runs.SIGNALS)
    with capsys.disabled():
        print(
            f"\n60 s at 250 Hz of {width} scalars and 3 bodies: {size:.1f} MB, {took:.2f} s in all"
        )
    assert size < 20.0
    assert viewer.repaired(tmp_path / "minute.rrd") == tmp_path / "minute.rrd"


def test_committing_allocates_nothing(tmp_path, capsys):
    recorder = Recorder(tmp_path / "a.rrd", signals=list(runs.SIGNALS), properties={})
    commit, ticks = recorder.commit, list(range(3000))
    for tick in ticks[:10]:
        commit(tick, tick)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for tick in ticks:
        commit(tick, tick)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    recorder.drain()
    start = time.perf_counter()
    for tick in ticks:
        commit(tick, tick)
    each = (time.perf_counter() - start) / len(ticks)
    recorder.close()
    with capsys.disabled():
        print(f"\ncommit: {1e6 * each:.2f} µs a row of {len(recorder.row)}")
    assert grown < 200  # the row counter and little else; one float a row would be 72 000


@pytest.mark.thorough
def test_a_recording_written_by_another_process_is_the_same_recording(tmp_path):
    model = mujoco.MjModel.from_xml_string(runs.SCENE)
    for name, make in (("here.rrd", Recorder), ("there.rrd", DetachedRecorder)):
        data = mujoco.MjData(model)
        with make(
            tmp_path / name, signals=runs.SIGNALS, properties={"seed": 7}, model=model,
            drain_ns=200_000_000,
        ) as recorder:  # fmt: skip
            recorder.event(0, "ignition")
            for tick in range(333):  # ends within a drain
                time_ns = tick * runs.PERIOD_NS
                runs.fill(recorder, time_ns * 1e-9, data)
                mujoco.mj_kinematics(model, data)
                recorder.commit(time_ns, runs.EPOCH_NS + time_ns)
                recorder.commit_pose(time_ns, data)
    assert compare(tmp_path / "here.rrd", tmp_path / "there.rrd") == 0


@pytest.mark.thorough
@pytest.mark.parametrize("make", [Recorder, DetachedRecorder])
def test_a_recording_is_read_before_its_end_and_then_told_what_was_found(tmp_path, make):
    with make(tmp_path / "a.rrd", signals=["vehicle/mass"], properties={}) as recorder:
        for tick in range(700):
            recorder.row[:] = tick
            recorder.commit(tick * 4_000_000, 0)
        partial = recorder.flush()
        with pytest.raises(recording.RecordingError, match="its end is missing"):
            recording.read(partial)
        begun = recording.read(partial, growing=True)
        assert begun["vehicle/mass"].values[:, 0].tolist() == list(range(700))
        assert begun.timing == {}
        recorder.attach("timing", {"verdict": "valid", "worst": 0.1})
        recorder.event(2_800_000_000, "judged")
        assert recorder.reached_ns == 699 * 4_000_000
    whole = recording.read(tmp_path / "a.rrd")
    assert whole["vehicle/mass"].values.tobytes() == begun["vehicle/mass"].values.tobytes()
    assert whole.timing == {"verdict": "valid", "worst": 0.1}
    assert [e.text for e in whole.events] == ["judged"]


@pytest.mark.thorough
def test_rows_that_find_no_room_are_counted_told_and_never_waited_for(tmp_path):
    recorder = DetachedRecorder(
        tmp_path / "a.rrd", signals=["vehicle/mass"], properties={}, capacity=8
    )
    os.kill(recorder._process.pid, signal.SIGSTOP)  # a disk that takes nothing
    for tick in range(20):
        recorder.row[:] = tick
        recorder.commit(tick, tick)
    os.kill(recorder._process.pid, signal.SIGCONT)
    with pytest.raises(RecorderError, match=r"a\.rrd lacks 12 rows"):
        recorder.close()
    run = recording.read(tmp_path / "a.rrd")
    assert run["vehicle/mass"].values[:, 0].tolist() == list(range(8))
    assert "12 rows lost" in run.events[-1].text


def test_a_writer_that_died_is_told_at_the_end_and_disturbs_nobody_before(tmp_path):
    recorder = DetachedRecorder(tmp_path / "a.rrd", signals=["vehicle/mass"], properties={})
    recorder._process.kill()
    recorder._process.wait()
    recorder.row[:] = 1.0
    recorder.commit(0, 0)
    recorder.event(0, "nobody hears this")
    with pytest.raises(RecorderError, match="process that writes it has ended"):
        recorder.close()


def test_views_of_the_row_stay_valid(tmp_path):
    with Recorder(tmp_path / "a.rrd", signals=["gimbal/command"], properties={}) as recorder:
        place = recorder.row[recorder.slices["gimbal/command"]]
        for tick in range(600):
            place[:] = tick * 1e-3
            recorder.commit(tick * runs.PERIOD_NS, tick)
    values = recording.read(tmp_path / "a.rrd")["gimbal/command"].values
    np.testing.assert_allclose(values[:, 0], np.arange(600) * 1e-3, rtol=1e-15)


@pytest.mark.parametrize("name", schema.SIGNALS)
def test_every_signal_can_be_recorded_alone(tmp_path, name):
    with Recorder(tmp_path / "a.rrd", signals=[name], properties={}) as recorder:
        recorder.row[:] = 1.0
        recorder.commit(0, 0)
    assert list(recording.read(tmp_path / "a.rrd").series) == [name]


def test_more_rows_than_the_ring_holds_are_all_kept(tmp_path):
    with Recorder(
        tmp_path / "a.rrd", signals=["vehicle/mass"], properties={}, capacity=7
    ) as recorder:
        for tick in range(100):
            recorder.row[:] = tick
            recorder.commit(tick, tick)
    assert recording.read(tmp_path / "a.rrd")["vehicle/mass"].values[:, 0].tolist() == list(
        range(100)
    )


def test_an_exception_keeps_the_run_up_to_there(tmp_path):
    path = tmp_path / "a.rrd"
    with pytest.raises(RuntimeError, match="exploded"):
        runs.fly(path, 5.0, fail_at=2.5)
    run = recording.read(path)
    assert run["gimbal/command"].time[-1] == pytest.approx(2.496)
    assert run.events[-1].level == "ERROR"
    assert "the plant exploded" in run.events[-1].text
    assert not path.with_name("a.rrd.partial").exists()


KILLED = """
import time, sys
from pathlib import Path
from twin.recorder import Recorder
every = int(sys.argv[2])
recorder = Recorder(Path(sys.argv[1]), signals=["vehicle/mass"], properties={}, drain_ns=every)
start = time.time_ns()
while True:
    recorder.row[:] = 1.0
    now = time.time_ns()
    recorder.commit(now - start, now)
    print(now - start, flush=True)
    time.sleep(0.01)
"""


@pytest.mark.realtime
def test_a_killed_process_loses_at_most_one_write(tmp_path):
    path, every = tmp_path / "a.rrd", 100_000_000
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, path, str(every)],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        text=True,
    )
    last = 0
    while last < 1_250_000_000:
        last = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    last = max([last, *map(int, process.stdout.read().split())])
    process.wait()
    process.stdout.close()
    assert not path.exists()
    saved = viewer.repaired(path.with_name("a.rrd.partial"))
    kept = recording.read(saved)["vehicle/mass"].time_ns[-1]
    # one write outstanding, and one tick of Rerun's own batcher (0.2 s) at the very worst
    assert last - kept <= every + 200_000_000


FULL = """
import json, os, resource, signal, sys, traceback
from pathlib import Path
import numpy as np
from tests.twin.recorder.runs import SIGNALS
from twin.recorder import Recorder, RecorderError, checks, feed
feed.FLUSH_SECONDS = 1.0
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
looks = checks._refuse_full

def record(path, sizes):
    for size in sizes:
        checks._refuse_full, signals = looks, ["sensors/gyro"]
        if not size.isdigit():  # a flight's disk, which fills after the check
            checks._refuse_full, signals = (lambda *_: None), SIGNALS
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(size.strip("+")), 10**7))
        noise = np.random.default_rng(1)
        try:
            with Recorder(Path(path), signals=signals, properties={}) as recorder:
                for tick in range(1000):
                    recorder.row[:] = noise.normal(size=recorder.row.size)
                    recorder.commit(tick * 4_000_000, tick)
        except RecorderError as error:
            print(error, flush=True)

for line in sys.stdin:
    if (child := os.fork()) == 0:
        signal.alarm(120)  # Rerun's race between its dead writer and a flush may end in waiting
        try:
            record(*json.loads(line))
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    print("exit", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
ROOM = 10**7  # bytes; more than the recording takes


@pytest.fixture(scope="module")
def on_disks_of():
    """Records on disks of given sizes, in a process forked from one that has all imports."""
    command = [sys.executable, "-c", FULL]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as process:

        def told(path, *sizes):
            print(json.dumps([str(path), [*map(str, sizes)]]), file=process.stdin, flush=True)
            lines = []
            while not (line := process.stdout.readline()).startswith("exit "):
                assert line, lines
                lines.append(line.rstrip("\n"))
            assert line == "exit 0\n", lines
            return lines

        yield told


@pytest.fixture(scope="module")
def whole_size(tmp_path_factory, on_disks_of):
    """Size of the recording on a disk with room for it."""
    path = tmp_path_factory.mktemp("disk") / "whole.rrd"
    assert on_disks_of(path, ROOM) == []
    return path.stat().st_size


@pytest.mark.parametrize(
    "short", [30_000, *(pytest.param(n, marks=pytest.mark.slow) for n in (20_000, 15_000)), 5000]
)
def test_a_full_disk_ends_in_one_line_and_never_in_a_whole_name(
    tmp_path, on_disks_of, whole_size, short
):
    path = tmp_path / "a.rrd"
    (line,) = on_disks_of(path, whole_size - short)
    assert "cannot finish" in line
    assert not path.exists()
    saved = viewer.repaired(path.with_name("a.rrd.partial"))
    assert len(recording.read(saved)["sensors/gyro"].time) > 0


def test_a_disk_that_is_full_at_the_beginning_is_refused_in_one_line(tmp_path, on_disks_of):
    """Also where it fills once it was looked at: `set_sinks` with a blueprint then waits for ever
    in one case of five.
    """
    late = [f"{size}+" for size in (20_000, 40_000, 60_000, 80_000, 100_000) * 2]
    lines = on_disks_of(tmp_path / "a.rrd", 0, 4000, 20_000, *late)
    assert len(lines) == 3 + len(late)
    for line in lines:
        assert "cannot record to" in line
    assert all("File too large" in line for line in lines[:3])
    assert list(tmp_path.iterdir()) == []


def test_a_recording_after_one_that_could_not_be_written_is_whole(tmp_path, on_disks_of):
    path = tmp_path / "a.rrd"
    (line,) = on_disks_of(path, 100_000, ROOM)
    assert "cannot finish" in line
    assert len(recording.read(path)["sensors/gyro"].time_ns) == 1000


def test_at_the_very_edge_of_a_disk_a_whole_name_is_a_whole_file(tmp_path, on_disks_of, whole_size):
    path = tmp_path / "a.rrd"
    # Rerun cuts its chunks by the clock, so the next file may be a few bytes shorter and fit
    told = on_disks_of(path, whole_size - 10)
    assert path.exists() is (told == [])
    if path.exists():
        assert len(recording.read(path)["sensors/gyro"].time) == 1000
    else:
        assert "cannot finish" in told[0]


@pytest.mark.parametrize("name", ["no/such\0name.rrd", "folder.rrd", "run.txt"])
def test_a_path_that_cannot_be_written_is_refused_at_once(tmp_path, name):
    (tmp_path / "folder.rrd").mkdir()
    with pytest.raises(RecorderError, match=r"cannot record|must be a file|must end in \.rrd"):
        Recorder(tmp_path / name, signals=["vehicle/mass"], properties={})


@pytest.mark.skipif(os.name != "posix", reason="no such locks here")
def test_a_file_that_another_run_is_writing_is_left_to_it(tmp_path):
    path = tmp_path / "a.rrd"
    with Recorder(path, signals=["vehicle/mass"], properties={}) as first:
        first.row[:] = 1.0
        first.commit(0, 0)
        with pytest.raises(RecorderError, match="written by another run"):
            Recorder(path, signals=["vehicle/mass"], properties={})
    assert recording.read(path)["vehicle/mass"].values.tolist() == [[1.0]]
    with Recorder(path, signals=["vehicle/mass"], properties={}) as again:  # and free afterwards
        again.row[:] = 2.0
        again.commit(0, 0)
    assert recording.read(path)["vehicle/mass"].values.tolist() == [[2.0]]


def test_a_file_in_the_way_of_the_folder_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecorderError, match=r"cannot record to .*file"):
        Recorder(tmp_path / "file" / "a.rrd", signals=["vehicle/mass"], properties={})
    assert sorted(tmp_path.iterdir()) == [tmp_path / "file"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"signals": ["vehicle/mas"]}, "did you mean 'vehicle/mass'"),
        ({"signals": []}, "at least one signal"),
        ({"properties": {"a": object()}}, "must be JSON"),
        ({"properties": {"a": float("nan")}}, "must be JSON"),
    ],
)
def test_mistakes_are_told_before_anything_is_written(tmp_path, change, message):
    options = {"signals": ["vehicle/mass"], "properties": {}} | change
    with pytest.raises(RecorderError, match=message):
        Recorder(tmp_path / "a.rrd", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_taken_port_is_refused(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(RecorderError, match=str(port)):
            Recorder(tmp_path / "a.rrd", signals=["vehicle/mass"], properties={}, serve=port)
    assert list(tmp_path.iterdir()) == []


def test_the_viewers_server_listens_on_loopback_alone(tmp_path):
    import psutil

    port = process.free_port()
    with Recorder(tmp_path / "a.rrd", signals=["vehicle/mass"], properties={}, serve=port):
        listening = [
            connection.laddr.ip
            for connection in psutil.Process().net_connections("inet")
            if connection.status == psutil.CONN_LISTEN and connection.laddr.port == port
        ]
    assert listening == ["127.0.0.1"]


def test_poses_are_those_of_the_model_with_quaternions_turned_for_rerun(tmp_path):
    runs.fly(tmp_path / "a.rrd", 1.0)
    chunks = RrdReader(tmp_path / "a.rrd").stream().filter(content="/world/vehicle").to_chunks()
    batches = [chunk.to_record_batch() for chunk in chunks if not chunk.is_static]
    place = np.concatenate([b["Transform3D:translation"].flatten().flatten() for b in batches])
    turn = np.concatenate([b["Transform3D:quaternion"].flatten().flatten() for b in batches])
    time = np.arange(len(place) // 3) * 0.02
    tilt = 0.2 + 0.15 * np.sin(0.8 * time)
    zero = np.zeros_like(tilt)
    np.testing.assert_allclose(
        place.reshape(-1, 3),
        np.column_stack([0.3 * time**2, 0.5 * time, 0.3 + 2.0 * time**2]),
        atol=1e-6,  # Rerun keeps single precision
    )
    np.testing.assert_allclose(
        turn.reshape(-1, 4),
        np.column_stack([zero, np.sin(tilt / 2), zero, np.cos(tilt / 2)]),
        atol=1e-6,
    )


@pytest.mark.parametrize(
    ("rows", "poses", "drain_ms", "pose_ms"),
    [(4096, 1024, 32, 8), (7, 1024, 1000, 8), (4096, 3, 1000, 4), (5, 2, 8, 4)],
    ids=["as time is due", "rows are full", "poses are full", "all at once"],
)
def test_many_ticks_at_once_are_written_as_one_after_the_other(
    tmp_path, monkeypatch, rows, poses, drain_ms, pose_ms
):
    writes = []
    drain = Feed.drain

    def noted(self):
        p = self._poses
        arrays = (self._block, self._time, self._wall)
        of_poses = (p._time, p._position, p._attitude, p._qpos, p._jet)
        rows = [a[: self._n].tobytes() for a in arrays]
        writes.append(rows + [a[: p.times.size].tobytes() for a in of_poses])
        drain(self)

    monkeypatch.setattr(Feed, "drain", noted)
    monkeypatch.setattr("twin.recorder.feed.Poses", partial(Poses, capacity=poses))
    model = mujoco.MjModel.from_xml_string(runs.SCENE)
    data, names = mujoco.MjData(model), ("xpos", "xquat", "qpos", "site_xpos", "site_xmat")
    time_ns = np.arange(20) * runs.PERIOD_NS
    found = []
    for chunk in (1, 8):
        with Recorder(
            tmp_path / f"{chunk}.rrd", signals=runs.SIGNALS, properties={}, model=model,
            capacity=rows, drain_ns=drain_ms * 1_000_000, pose_period_ns=pose_ms * 1_000_000,
        ) as recorder:  # fmt: skip
            kept: dict[str, list[np.ndarray]] = {name: [] for name in ("row", *names)}
            for k, t in enumerate(time_ns.tolist()):
                runs.fill(recorder, t * 1e-9, data)
                mujoco.mj_kinematics(model, data)
                if chunk == 1:
                    recorder.commit(t, t)
                    recorder.commit_pose(t, data)
                    continue
                kept["row"].append(recorder.row.copy())
                for name in names:
                    kept[name].append(getattr(data, name).copy())
                if (k + 1) % chunk == 0 or k == len(time_ns) - 1:
                    frames = {name: np.array(values) for name, values in kept.items()}
                    stamps = time_ns[k + 1 - len(kept["row"]) : k + 1]
                    recorder.commit_all(stamps, stamps, frames.pop("row"), frames)
                    kept = {name: [] for name in kept}
        found.append(writes.copy())
        writes.clear()
    assert len(found[0]) > 1
    assert found[0] == found[1]


def test_collision_shapes_are_left_out():
    drawn = {body.name: body for body in scene.bodies(mujoco.MjModel.from_xml_string(runs.SCENE))}
    assert set(drawn) == {"ground", "vehicle", "gimbal_ring", "gimbal_holder"}
    assert not drawn["ground"].moves
    assert drawn["vehicle"].triangles.vertices[:, :2].max() < 0.028  # the capsule has 0.05


SHAPES = {
    "box": ("0.1 0.2 0.3", 8 * 0.1 * 0.2 * 0.3),
    "sphere": ("0.2", 4 / 3 * np.pi * 0.2**3),
    "ellipsoid": ("0.1 0.2 0.3", 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    "cylinder": ("0.1 0.3", np.pi * 0.1**2 * 0.6),
    "capsule": ("0.1 0.3", np.pi * 0.1**2 * 0.6 + 4 / 3 * np.pi * 0.1**3),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_primitive_encloses_its_volume_and_looks_outward(kind):
    size, volume = SHAPES[kind]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="{kind}" size="{size}"/></worldbody></mujoco>'
    )
    mesh = shapes.of_geom(model, 0)
    corners = mesh.vertices[mesh.faces]
    # divergence theorem; 32 sides around enclose 2 % less than the circle, ends as much again
    enclosed = (
        np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    )
    assert enclosed == pytest.approx(volume, rel=0.03)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    assert (np.einsum("ij,ij->i", mesh.vertices, mesh.normals) > 0.0).all()


def test_a_closed_recording_leaves_no_thread_behind(tmp_path):
    """Rerun keeps two threads for a stream and two for its blueprint until both are released."""
    process, threads = psutil.Process(), []
    for k in range(4):
        runs.fly(tmp_path / f"{k}.rrd", 0.1)
        threads.append(process.num_threads())
    assert threads[1:] == threads[:1] * 3


def test_shared_memory_of_a_killed_process_is_deleted_at_the_next_start():
    program = (
        "import os, signal; from twin.recorder.process import ring;"
        "print(ring.make(4, 2).path, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    killed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    left = Path(killed.stdout.strip())
    assert left.exists()
    kept = Path(ring.make(4, 2).path)
    assert not left.exists()
    own = Path(ring.make(4, 2).path)
    assert kept.exists()  # its process is alive
    kept.unlink()
    own.unlink()


def test_rows_are_in_the_file_when_they_have_been_written(tmp_path):
    """Rows that wait for Rerun's thread pile up in a run that is faster than it."""
    with Recorder(
        tmp_path / "a.rrd", signals=list(runs.SIGNALS), properties={}, drain_ns=10**9
    ) as recorder:
        recorder.row[:] = 1.0
        for tick in range(8001):
            recorder.commit(tick * 1_000_000, tick)
            if tick % 1000 == 0 and tick:
                there = recording.read(tmp_path / "a.rrd.partial", growing=True)
                assert there["vehicle/mass"].time[-1] == tick * 1e-3


@pytest.mark.slow
def test_an_hour_takes_at_most_half_a_gigabyte_until_it_is_closed(tmp_path):
    writing, closing = long_run.hour(tmp_path / "hour.rrd", 60.0)
    assert max(writing, closing) < 500


def test_memory_stays_flat(tmp_path):
    import psutil

    with Recorder(
        tmp_path / "a.rrd", signals=list(runs.SIGNALS), properties={}, drain_ns=10**9
    ) as recorder:
        resident = []
        for second in range(240):
            for tick in range(25):
                stamp = second * 10**9 + tick * 40_000_000
                recorder.commit(stamp, stamp)
            if second in (60, 239):
                resident.append(psutil.Process().memory_info().rss)
    # Rerun keeps about 0.7 kB of index for each write of each signal until the file is closed
    assert resident[1] - resident[0] < 12e6


def _writes(path, entity):
    chunks = RrdReader(path).stream().filter(content=entity).to_chunks()
    return sum(not chunk.is_static for chunk in chunks)


def test_the_writes_of_a_long_run_grow_with_it(tmp_path):
    """Each keeps 2 kB in memory until the file is closed."""
    path, seconds = tmp_path / "a.rrd", 2000
    with Recorder(path, signals=["vehicle/mass"], properties={}) as recorder:
        for t in range(10 * seconds):
            recorder.row[0] = t
            recorder.commit(t * 100_000_000, t)
    assert recording.read(path)["vehicle/mass"].values[:, 0].tolist() == list(range(10 * seconds))
    # one a second for 25 s, then each ends 4 % later than the one before, up to 20 s
    expected = 25 + np.log(500 / 25) / np.log(1.04) + (seconds - 500) / 20
    assert _writes(path, "/vehicle/mass") == pytest.approx(expected, rel=0.03)


def test_an_hour_of_a_rig_in_lockstep_has_few_chunks(tmp_path):
    """A signal every 20 s, also at 1500 rows a second, and the scene every minute."""
    path, begin, seconds = tmp_path / "a.rrd", 1000, 200
    model = mujoco.MjModel.from_xml_string(runs.SCENE)
    data = mujoco.MjData(model)
    with Recorder(path, signals=["vehicle/mass"], properties={}, model=model) as recorder:
        for k in range(1500 * seconds):
            at = begin * 10**9 + k * 10**9 // 1500
            recorder.row[0] = k
            recorder.commit(at, at)
            if k % 30 == 0:
                data.xpos[1:, 0] = k
                recorder.commit_pose(at, data)
    assert recording.read(path)["vehicle/mass"].values[:, 0].tolist() == list(range(1500 * seconds))
    # the first row is due at once, before the first pose
    assert _writes(path, "/vehicle/mass") == 1 + seconds // 20
    assert _writes(path, "/world/vehicle") == math.ceil(seconds / 60)
    chunks = RrdReader(path).stream().filter(content="/world/vehicle").to_chunks()
    batches = [chunk.to_record_batch() for chunk in chunks if not chunk.is_static]
    place = np.concatenate([b["Transform3D:translation"].flatten().flatten() for b in batches])
    time = np.concatenate([b["time"].to_numpy(zero_copy_only=False) for b in batches])
    order = np.argsort(time)
    assert place.reshape(-1, 3)[order, 0].tolist() == list(range(0, 1500 * seconds, 30))
    stamps = begin * 10**9 + np.arange(0, 1500 * seconds, 30) * 10**9 // 1500
    assert time[order].astype(np.int64).tolist() == stamps.tolist()


@pytest.mark.thorough
def test_a_scene_that_is_written_seldom_is_that_written_often(tmp_path, monkeypatch):
    found = []
    for name in ("seldom.rrd", "often.rrd"):
        runs.fly(tmp_path / name, 30.0)
        kept, chunks = {}, 0
        for chunk in RrdReader(tmp_path / name).stream().to_chunks():
            if not chunk.is_static:
                batch, chunks = chunk.to_record_batch(), chunks + 1
                for column in set(batch.schema.names) - {"time", "rerun.controls.RowId"}:
                    rows = zip(
                        batch["time"].to_numpy(False), batch[column].to_pylist(), strict=True
                    )
                    kept.setdefault((chunk.entity_path, column), []).extend(rows)
        ordered = {key: sorted(rows, key=lambda row: row[0]) for key, rows in kept.items()}
        found.append((chunks, {key: repr(rows) for key, rows in ordered.items()}))
        monkeypatch.setattr(feed, "SCENE_NS", 0)
    assert found[0][0] < 0.8 * found[1][0]
    assert {path for path, _ in found[0][1]} > {"/world/vehicle", "/world/trail", "/view/residual"}
    assert found[0][1] == found[1][1]


def test_what_is_asked_for_is_written_with_the_scene(tmp_path):
    path, model = tmp_path / "a.rrd", mujoco.MjModel.from_xml_string(runs.SCENE)
    data = mujoco.MjData(model)
    with Recorder(path, signals=["vehicle/mass"], properties={}, model=model) as recorder:
        for second in range(1000, 1010):
            recorder.row[0] = second
            recorder.commit(second * 10**9, second)
            recorder.commit_pose(second * 10**9, data)
            if second == 1005:
                saved = viewer.repaired(recorder.flush())
                assert _rows(saved, "/vehicle/mass") == _rows(saved, "/world/vehicle") == 6
    assert _rows(path, "/vehicle/mass") == _rows(path, "/world/vehicle") == 10


def _rows(path, entity):
    chunks = RrdReader(path).stream().filter(content=entity).to_chunks()
    return sum(chunk.to_record_batch().num_rows for chunk in chunks if not chunk.is_static)


@pytest.mark.thorough
def test_the_writes_to_a_viewer_are_not_those_of_the_file(tmp_path, monkeypatch):
    path, seconds = tmp_path / "a.rrd", 10
    writes, drain = {}, Feed.drain

    def counted(self):
        writes[self._live] = writes.get(self._live, 0) + bool(self._n)
        drain(self)

    monkeypatch.setattr(Feed, "drain", counted)
    with Recorder(
        path, signals=["vehicle/mass"], properties={}, serve=process.free_port()
    ) as recorder:
        for t in range(100 * seconds):
            recorder.row[0] = t
            recorder.commit(t * 10_000_000, t)
    assert recording.read(path)["vehicle/mass"].values[:, 0].tolist() == list(range(100 * seconds))
    assert _writes(path, "/vehicle/mass") == writes[False] == seconds
    assert writes[True] == 10 * seconds  # a viewer is shown every tenth of a second
