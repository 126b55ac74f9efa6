"""No verb replaces anything with its result but a file of its own that can be had again."""

import os
import socket
import stat
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.twin.cli.test_cli import run
from twin.config.paths import named, point_latest, writable
from twin.errors import TwinError
from twin.recorder import Recorder

SUFFIX = ".rrd"


def kinds(folder, suffix=SUFFIX):
    """Kinds of path that a result must not go to."""
    other = folder / "elsewhere"
    other.mkdir()
    (other / f"precious{suffix}").write_text("precious")
    (folder / f"folder{suffix}").mkdir()
    os.mkfifo(folder / f"fifo{suffix}")
    os.mkfifo(folder / f"beside{suffix}.partial")
    (folder / "file").write_text("a file as a folder")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / f"s{suffix}"))
    (folder / f"out{suffix}").symlink_to(other / f"precious{suffix}")
    (folder / f"linked{suffix}.partial").symlink_to(other / f"precious{suffix}")
    (folder / f"null{suffix}").symlink_to("/dev/null")
    (folder / f"nowhere{suffix}").symlink_to(folder / "missing")
    (folder / f"loop{suffix}").symlink_to(folder / f"loop{suffix}")
    (folder / f"taken{suffix}").write_text("of another program")
    (folder / f"left{suffix}.partial").write_text("of another program")
    (folder / "notes.other").write_text("of another kind")
    names = (
        "folder",
        "fifo",
        "beside",
        "s",
        "out",
        "linked",
        "null",
        "nowhere",
        "loop",
        "taken",
        "left",
    )
    found = [folder / f"{name}{suffix}" for name in names]
    return [*found, folder / "notes.other", folder / "file" / f"a{suffix}", "/dev/null"]


def state(folder):
    """Every entry below a folder with its kind and content."""
    found = {}
    for path in sorted(folder.rglob("*")):
        mode = path.lstat().st_mode
        content = path.read_bytes() if stat.S_ISREG(mode) else b""
        found[str(path)] = (
            stat.S_IFMT(mode),
            content,
            str(path.readlink()) if path.is_symlink() else "",
        )
    return found


def test_only_free_names_and_regular_files_are_written(tmp_path):
    for path in kinds(tmp_path):
        before = state(tmp_path)
        with pytest.raises(TwinError) as caught:
            writable(tmp_path / path, SUFFIX)
        assert "\n" not in str(caught.value)
        assert state(tmp_path) == before
    plain = tmp_path / "plain.rrd"
    assert writable(plain, SUFFIX) == plain
    plain.write_text("of another program")
    assert writable(plain, SUFFIX, force=True) == plain
    plain.write_text("")
    (tmp_path / "latest.rrd").symlink_to("plain.rrd")  # a link within the folder
    assert writable(tmp_path / "latest.rrd", SUFFIX).name == "latest.rrd"


@pytest.mark.parametrize("links", [True, False])
def test_results_get_names_of_their_own_and_latest_leads_to_the_newest(
    tmp_path, monkeypatch, links
):
    if not links:  # as on Windows without the privilege
        monkeypatch.setattr(Path, "symlink_to", lambda *_: (_ for _ in ()).throw(OSError()))
    written = []
    for k in range(3):  # within one second, too
        written.append(named(tmp_path, "fly", SUFFIX))
        written[-1].write_text(f"{k}")
        point_latest(written[-1])
    assert [p.read_text() for p in written] == ["0", "1", "2"]
    assert (tmp_path / "latest-fly.rrd").read_text() == "2"
    point_latest(named(tmp_path, "fly", SUFFIX))  # a run that wrote nothing
    point_latest(tmp_path / "mine.rrd")
    assert len(list(tmp_path.iterdir())) == 4
    assert (tmp_path / "latest-fly.rrd").read_text() == "2"
    with pytest.raises(TwinError, match="newest result"):
        writable(tmp_path / "latest-fly.rrd", SUFFIX)


def test_the_newest_result_takes_no_place_that_is_not_a_link_of_ours(tmp_path):
    (tmp_path / "latest-fly.rrd").write_text("mine")
    (tmp_path / "latest-step.rrd").symlink_to("chosen.rrd")
    (tmp_path / "latest-demo").mkdir()
    before = set(tmp_path.iterdir())
    for name, suffix in (("fly", SUFFIX), ("step", SUFFIX), ("demo", "")):
        path = named(tmp_path, name, SUFFIX).with_suffix(suffix)
        path.write_text("new")
        point_latest(path)
        path.unlink()
    assert set(tmp_path.iterdir()) == before
    assert (tmp_path / "latest-fly.rrd").read_text() == "mine"
    assert (tmp_path / "latest-step.rrd").readlink() == Path("chosen.rrd")


def recorded(path, gimbal, date):
    properties = {"command": "step", "configuration": {"gimbal": gimbal}} | date
    with Recorder(path, signals=["vehicle/mass"], properties=properties) as recorder:
        recorder.commit(0, 0)


@pytest.mark.parametrize(
    ("gimbal", "date", "asked"),
    [
        ("linkage", {}, False),
        ("emulator", {"date": "2026-01-01"}, False),
        ("/dev/ttyUSB0", {"date": "2026-01-01"}, True),
        ("/dev/ttyUSB0", {}, False),  # a replay
    ],
)
def test_only_a_recording_of_a_rig_is_kept_without_force(tmp_path, capsys, gimbal, date, asked):
    path = tmp_path / "a.rrd"
    recorded(path, gimbal, date)
    assert writable(path, SUFFIX, force=True) == path
    assert "is replaced" in capsys.readouterr().err
    if not asked:
        assert writable(path, SUFFIX) == path
        return
    with pytest.raises(TwinError, match="--force"):
        writable(path, SUFFIX)
    path.rename(tmp_path / "a.rrd.partial")
    with pytest.raises(TwinError, match=r"a\.rrd\.partial exists"):
        writable(path, SUFFIX)


VERBS = {
    "fly --duration-s 0.01": ".rrd",
    "fly --duration-s 0.05 --repeat 2": ".html",
    "step --repeats 1": ".rrd",
    "mirror --duration-s 0.01": ".rrd",
    "calibrate": ".json",
    "converge": ".html",
    "identify run.rrd": ".json",
    "identify --linkage run.rrd": ".json",
    "compare run.rrd run.rrd": ".rrd",
    "report run.rrd": ".html",
    "replay run.rrd": ".rrd",
    f"vehicle build {ROOT / 'mjcf/examples/reference.toml'}": ".xml",
}


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    """A short recording of a step test."""
    import twin

    out = tmp_path_factory.mktemp("step") / "run.rrd"
    twin.step(repeats=1, hold_s=0.1, out=out)
    return out


def refuses_all(capsys, command, paths, folder):
    before = Path("/dev/null").stat()
    for path in paths:
        there = state(folder)
        code, _, err = run(capsys, *command.split(), "--out", path)
        assert code == 2, path
        assert err.count("\n") == 1
        assert state(folder) == there
    after = Path("/dev/null").stat()
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_ino, after.st_rdev) == (before.st_ino, before.st_rdev)


@pytest.fixture
def places(tmp_path, monkeypatch, step):
    """Kinds of path for a suffix, in a folder with a recording."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.rrd").write_bytes(step.read_bytes())
    return lambda suffix: kinds(tmp_path, suffix)


@pytest.mark.parametrize("command", VERBS)
def test_no_verb_replaces_a_device_or_a_file_of_another_program(capsys, tmp_path, places, command):
    """As root, `calibrate --out /dev/null` once replaced the device node."""
    found = [p for p in places(VERBS[command]) if "taken" in str(p) or p == "/dev/null"]
    assert len(found) == 2
    refuses_all(capsys, command, found, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("command", VERBS)
def test_no_verb_replaces_what_is_not_its_own(capsys, tmp_path, places, command):
    suffix = VERBS[command]
    found = places(suffix)  # a folder takes recordings by their usual names
    refuses_all(capsys, command, found[suffix == ".rrd" :], tmp_path)
