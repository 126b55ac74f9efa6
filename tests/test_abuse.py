"""A small fixed sample of `make abuse`, and that its driver notices what it should."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from tests.abuse import endurance, runs, texts
from tests.abuse.__main__ import KINDS
from tests.abuse.attempt import Attempt, abuse, save, table
from tests.twin.cli.test_mutations import KINDS as FILES
from twin.errors import TwinError

SAMPLE = {
    "frames": (texts.codec, 100),
    "settings": (texts.settings, 60),
    **{kind: (texts.files(kind), 5) for kind in FILES if KINDS[kind][1] > 300},
}


@pytest.mark.thorough
def test_a_fixed_sample_of_abuse_has_no_failures(tmp_path):
    rows = abuse(SAMPLE, 1, tmp_path / "abuse")
    assert [row.attempts for row in rows] == [count for _, count in SAMPLE.values()]
    assert [text for row in rows for *_, text in row.failed] == []


def planted(*outcomes):
    def attempts(chance, folder):
        for name, outcome in outcomes:
            yield Attempt(name, outcome, name.encode())

    return attempts


def raising(error):
    def act():
        raise error

    return act


def test_the_driver_counts_and_keeps_what_fails_and_nothing_else(tmp_path):
    kinds = {
        "valid": (planted(("read", dict), ("refused", raising(TwinError("x: too long")))), 2),
        "wrong": (
            planted(
                ("crash", raising(KeyError("nozzle"))),
                ("lines", raising(TwinError("x:\ntoo long"))),
                ("exit", raising(SystemExit(3))),
            ),
            3,
        ),
    }
    rows = abuse(kinds, 1, tmp_path / "abuse")
    assert [line.split()[:3] for line in table(rows).splitlines()[1:]] == [
        ["valid", "2", "0"],
        ["wrong", "3", "3"],
        ["all", "5", "3"],
    ]
    save(rows, tmp_path / "failures")
    kept = sorted(p.name for p in (tmp_path / "failures").iterdir())
    assert kept == [f"wrong-{k}.{kind}" for k in range(3) for kind in ("input", "txt")]
    assert (tmp_path / "failures/wrong-0.input").read_bytes() == b"crash"
    assert "KeyError: 'nozzle'" in (tmp_path / "failures/wrong-0.txt").read_text()


@pytest.mark.parametrize("value", [float("nan"), [1.0, float("inf")], {"a": (float("-inf"),)}])
def test_a_reader_that_takes_nonsense_is_a_failure(tmp_path, monkeypatch, value):
    monkeypatch.setitem(FILES, "motor", (".eng", lambda _: b"x", lambda _: value, 1))
    (row,) = abuse({"motor": (texts.files("motor"), 2)}, 1, tmp_path / "abuse")
    assert "not finite" in row.failed[0][2]


def test_an_attempt_that_ends_the_process_is_a_failure_of_its_kind_alone(tmp_path):
    crash = planted(("read", dict), ("kill", lambda: os.kill(os.getpid(), signal.SIGKILL)))
    rows = abuse({"crash": (crash, 2), "next": (planted(("read", dict)), 1)}, 1, tmp_path / "abuse")
    assert [(row.attempts, len(row.failed)) for row in rows] == [(1, 1), (1, 0)]
    assert rows[0].failed[0] == ("kill", b"kill", "ended the process, exit code -9")


@pytest.mark.parametrize("seconds", [1200, 3600])
def test_memory_that_grows_after_ten_minutes_is_a_failure(seconds):
    time = np.arange(seconds)
    warm = 100.0 + np.minimum(time, 540.0)  # s of growth at first
    for hourly, flat in ((19.0, True), (21.0, False)):
        sizes = warm + hourly / 3600.0 * time
        sizes[::7] += 50.0  # a write
        assert (endurance.grown(sizes, seconds) == "") is flat
    assert endurance.grown(warm + 21.0 / 3600.0 * time, seconds).startswith("memory grew from 64")


def test_memory_of_its_own_leaves_out_mapped_files(tmp_path):
    (tmp_path / "file").write_bytes(bytes(30_000_000))
    program = (
        "import mmap, sys; print(1, flush=True); input(); own = bytearray(b'1' * 10_000_000);"
        f"f = open({str(tmp_path / 'file')!r}, 'rb');"
        "m = mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ); sum(m[::4096]);"
        "print(2, flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()
        (before,) = endurance.resident(process.pid)
        process.stdin.write("\n")
        process.stdin.flush()
        process.stdout.readline()
        (after,) = endurance.resident(process.pid)
        process.communicate("\n")
    assert after[0] - before[0] == pytest.approx(10.0, abs=2.0)
    assert after[1] - before[1] == pytest.approx(40.0, abs=2.0)
    assert endurance.resident(process.pid) == []


def test_a_result_that_does_not_open_and_a_changed_input_are_failures(tmp_path):
    (tmp_path / "own.toml").write_text("a = 1")
    inputs = runs.outputs_of.state(tmp_path)
    runs._whole(tmp_path, inputs)
    (tmp_path / "result.json").write_text('{"a": ')
    with pytest.raises(ValueError, match="Expecting value"):
        runs._whole(tmp_path, inputs)
    (tmp_path / "result.json").unlink()
    (tmp_path / "own.toml").write_text("")
    with pytest.raises(AssertionError):
        runs._whole(tmp_path, inputs)
