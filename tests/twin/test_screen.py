"""What a terminal shows while a verb works, and what is refused before it computes."""

import io
import time

import pytest

from twin import status
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


def test_a_pipe_shows_no_status(quick, monkeypatch):
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stderr", pipe)
    with status.shown():
        status.say("flying")
        time.sleep(0.1)
    assert pipe.getvalue() == ""


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
    assert f"pip install 'tvc-twin[{extra}]'" in refused(capsys, *command.split())
