"""No verb replaces anything with its result but a regular file in the place that was named."""

import os
import socket
import stat
from pathlib import Path

import pytest

from tests.twin.test_cli import run
from twin.config.paths import writable
from twin.errors import TwinError

SUFFIX = ".rrd"


def kinds(folder):
    """Twelve kinds of path, each with what must be left as it is (None: nothing there)."""
    other = folder / "elsewhere"
    other.mkdir()
    (other / "precious.rrd").write_text("precious")
    (folder / "folder.rrd").mkdir()
    os.mkfifo(folder / "fifo.rrd")
    os.mkfifo(folder / "beside.rrd.partial")
    (folder / "file").write_text("a file as a folder")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / "socket.rrd"))
    (folder / "out.rrd").symlink_to(other / "precious.rrd")
    (folder / "linked.rrd.partial").symlink_to(other / "precious.rrd")
    (folder / "null.rrd").symlink_to("/dev/null")
    (folder / "nowhere.rrd").symlink_to(folder / "missing")
    (folder / "loop.rrd").symlink_to(folder / "loop.rrd")
    names = ("folder", "fifo", "beside", "socket", "out", "linked", "null", "nowhere", "loop")
    return [*(folder / f"{n}.rrd" for n in names), folder / "file" / "a.rrd", "/dev/null"]


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
    plain.write_text("old")
    assert writable(plain, SUFFIX) == plain
    (tmp_path / "latest.rrd").symlink_to("plain.rrd")  # a link within the folder
    assert writable(tmp_path / "latest.rrd", SUFFIX).name == "latest.rrd"


VERBS = (
    "fly --duration-s 0.01",
    "step --repeats 1",
    "mirror --duration-s 0.01",
    "calibrate",
    "converge",
    "fly --repeat 2",
    "identify a.rrd",
    "report a.rrd",
)


@pytest.mark.parametrize("command", VERBS)
def test_no_verb_replaces_a_device(capsys, tmp_path, monkeypatch, command):
    """As root, `calibrate --out /dev/null` once replaced the device node."""
    monkeypatch.chdir(tmp_path)
    before = Path("/dev/null").stat()
    code, _, err = run(capsys, *command.split(), "--out", "/dev/null")
    assert code == 2
    assert err.count("\n") == 1
    after = Path("/dev/null").stat()
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_ino, after.st_rdev) == (before.st_ino, before.st_rdev)
    assert not any(tmp_path.iterdir())
