"""What a terminal shows while a verb works, and what is refused before it computes."""

import io
import os
import threading
import time

import pytest

from twin import status
from twin.cli import doctor
from twin.cli.main import main
from twin.config.verbs import Verb


class Terminal(io.StringIO):
    """Standard error of a user who watches."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(status, "FIRST_S", 0.02)
    monkeypatch.setattr(status, "PERIOD_S", 0.02)


def test_a_terminal_shows_what_is_done_and_is_left_clean(quick, monkeypatch):
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    with status.shown(), status.stage("fly: "):
        status.say(lambda: "1.5 s")
        time.sleep(0.1)
        status.note("a warning")
        time.sleep(0.1)
    shown = screen.getvalue().split("\r")
    assert any(line.startswith("fly: 1.5 s (") for line in shown)
    assert "a warning\n" in shown  # on a line that was cleared
    assert not shown[-1].strip()


@pytest.mark.realtime
def test_a_log_has_a_line_of_long_work_only_and_ever_more_rarely(quick, monkeypatch):
    log = io.StringIO()
    monkeypatch.setattr("sys.stderr", log)
    for first, expected in ((5.0, 0), (0.02, 3)):  # after 20, 40 and 80 ms; the next after 160
        monkeypatch.setattr(status, "LONG_S", first)
        with status.shown():
            status.say("12 of 500 runs")
            time.sleep(0.12)
        lines = log.getvalue().splitlines()
        assert lines == ["12 of 500 runs (0 s since the start)"] * len(lines)
        assert len(lines) <= expected
    assert lines


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_forked_process_can_print_although_the_line_was_being_drawn():
    status._lock.acquire()  # as the thread that draws does, which the child does not have
    threading.Timer(0.05, status._lock.release).start()
    if (child := os.fork()) == 0:
        free = status._lock.acquire(blocking=False)
        os._exit(0 if free else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def refused(capsys, *arguments: str) -> str:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    return capsys.readouterr().err


@pytest.fixture
def not_imported(monkeypatch):
    """No verb may be imported."""
    monkeypatch.setattr(Verb, "function", property(lambda verb: pytest.fail(f"ran {verb.name}")))


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("fly --gimbal /dev/ttyUSB77", "/dev/ttyUSB77: no such port"),
        ("fly --vehicle none.xml", "cannot read --vehicle none.xml: No such file"),
        ("fly --motor none.eng:Q20", "cannot read --motor none.eng:Q20: No such file"),
        ("compare none.rrd", "cannot read none.rrd: No such file"),
        ("report a.csv none.csv", "cannot read a.csv: No such file"),
    ],
)
def test_what_is_missing_is_reported_before_the_verb_is_imported(
    command, says, capsys, not_imported
):
    assert says in refused(capsys, *command.split())


@pytest.mark.parametrize("command", ["converge", "fly --repeat 3", "identify a --linkage"])
def test_a_missing_extra_is_reported_before_anything_is_computed(
    command, capsys, monkeypatch, not_imported
):
    monkeypatch.setattr("twin.cli.ready.find_spec", lambda _: None)
    extra = "sysid" if "--linkage" in command else "report"
    assert f"pip install '.[{extra}]'" in refused(capsys, *command.split())


def test_the_doctor_names_missing_extras_a_missing_display_and_services_that_take_ports(
    monkeypatch,
):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: name if name == "brltty" else None)
    monkeypatch.setattr("twin.cli.ready.find_spec", lambda _: None)
    monkeypatch.setattr(doctor.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    looks = (doctor._extras, doctor._viewer, doctor._grabbers)
    found = {f.topic: f for look in looks for f in look()}
    assert "pip install '.[report]'" in found["extra report"].remedy
    assert "twin view --web" in found["display"].remedy
    assert found["browser"].level == "note"
    assert "apt remove brltty" in found["brltty"].remedy
