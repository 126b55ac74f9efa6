"""The command line: one clear line and exit 2 for a mistake, JSON alone for machines."""

import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.recording import read
from twin.cli.arguments import parse
from twin.cli.main import main
from twin.errors import TwinError
from twin.loop.seats import Pilot

EXAMPLES = Path(__file__).resolve().parents[3] / "mjcf" / "examples"


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of one command."""
    with pytest.raises(SystemExit) as end:
        main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    return int(end.value.code or 0), out, err


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


FILES = {
    "garbage.eng": "garbage\n",
    "negative.eng": "F1 29 100 0 0.02 0.05 X\n0.1 5\n0.5 -3\n1 0\n",
    "endless.eng": "F1 29 100 0 0.02 0.05 X\n0.1 5\n0.5 3\n",
    "nan.eng": "F1 29 100 0 0.02 0.05 X\n0.1 nan\n0.5 0\n",
    "empty.xml": "<mujoco><worldbody/></mujoco>",
    "html.xml": "<html/>",
    "text.xml": "text",
    "other.json": '{"schema": "something else"}',
    "set.json": '{"air_drag": "much"}',
    "text.rrd": "text",
    "deep.json": '{"a":' * 50_000 + "1" + "}" * 50_000,
    "huge.json": '{"wind_speed": ' + "9" * 400 + "}",
    "deep.xml": "<mujoco><worldbody>"
    + "<body>" * 3000
    + "</body>" * 3000
    + "</worldbody></mujoco>",
}

MISTAKES = [
    ("fly --motor garbage.eng", "garbage.eng, line 1"),
    ("fly --motor negative.eng", "-3 N is negative"),
    ("fly --motor endless.eng", "never ends"),
    ("fly --motor nan.eng", "nan"),
    ("fly --motor missing.eng", "missing.eng"),
    ("fly --set air_axial_darg=1", "air_axial_drag"),
    ("fly --set vehicel.mass=1", "vehicle"),
    ("fly --set wind_speed=nan", "not finite"),
    ("fly --set wind_speed", "NAME=VALUE"),
    ("fly --set-from set.json", "much"),
    ("fly --scene fligth", "flight, bench, turntable"),
    ("fly --scene bench", "vehicle"),
    ("fly --vehicle empty.xml", "body 'vehicle'"),
    ("fly --vehicle text.xml", "not well-formed"),
    ("fly --vehicle html.xml", "<html>"),
    ("fly --vehicle missing.xml", "missing.xml"),
    ("fly --mechanism empty.xml", "mount"),
    ("fly --gimbal transfer-function --set gimbal_servo_gain=2", "no servos"),
    ("step --gimbal transfer-function --set gimbal_backlash=0.1", "no servos"),
    ("fly --set gimbal_propellant.mass=0.2", "motor_propellant_mass"),
    ("fly --set gimbal_x.damping=-1", "0 or more"),
    ("fly --integrator ab4 --dt 0.002", "0.0005 s"),
    ("fly --dt 0", "from 1e-06 to 0.005 s"),
    ("fly --dt -0.001", "from 1e-06 to 0.005 s"),
    ("fly --dt 0.1", "from 1e-06 to 0.005 s"),
    ("fly --dt nan", "finite"),
    ("fly --control-hz 333 --dt 0.001", "for example 333.333 Hz"),
    ("fly --duration-s inf", "finite"),
    ("fly --seed -1", "must be from 0"),
    (f"fly --seed {'9' * 400}", "must be from 0"),
    ("fly --duration-s 0", "0.001 to 36000 s"),
    ("fly --duration-s 1e300", "0.001 to 36000 s"),
    ("fly --control-hz 1e-300", "0.1 to 100000"),
    ("fly --dt 0.01 --control-hz 100", "0.005"),
    ("fly --off-axis-deg 15 0", "no effect with --programme hold; it is for point"),
    ("step --duration-s 5", "no effect with --signal steps"),
    ("fly --programme step --at-s 700", "must be before the end, --duration-s 600"),
    ("fly --programme step --target 300 0 350", "exclude"),
    ("fly --model other.json", "transfer-function"),
    ("fly --set-from deep.json", "deep.json"),
    ("fly --set-from huge.json", "not a number"),
    ("fly --vehicle deep.xml", "deep.xml"),
    ("fly --out flight.txt", ".rrd"),
    ("fly --out /proc/nowhere/flight.rrd", "cannot write"),
    ("fly --gimbal transfer-function --model other.json", "schema"),
    ("fly --gimbal transfer-function --model missing.json", "missing.json"),
    ("fly --gimbal rope", "linkage"),
    ("fly --target 0 0 -100", "30°"),
    ("fly --programme point --off-axis-deg 45 0", "30°"),
    ("fly --programme point --target-range-m -5", "from 1 to 100000 m"),
    ("step --amplitude-deg 11", "stops"),
    ("step --repeats 0", "repeats"),
    ("step --hold-s 0", "hold"),
    ("view missing.rrd", "missing.rrd"),
    ("view text.rrd", "not a Rerun recording"),
    ("flie", "fly"),
    ("fly --dt 0.001 --seed 3 --dt=0.0005", "--dt: given twice; give it once"),
    ("fly --out a.rrd --out b.rrd", "--out: given twice"),
    ("fly --set wind_speed=1 --set wind_speed=2", "wind_speed is given twice"),
    ("fly --seed 1_0", "--seed 1_0: must be a number of the digits 0 to 9"),
    ("step --repeats ٣", "--repeats ٣: must be a number of the digits 0 to 9"),
    ("fly --off-axis-deg 1 ２", "--off-axis-deg ２: must be a number"),
    ("converge --dt-ms 1 2 4_0", "--dt-ms 4_0: must be a number"),
    ("fly --jsn", "--jsn"),
    ("fly --dt abc", "--dt: 'abc' is not a number (`twin fly --help`"),
    ("identify a.csv --unit deg", "a simulated rig; columns have --angle-unit"),
    ("step --repeats 2.5", "--repeats: '2.5' is not a whole number"),
    ("fly --repeat 2.5", "--repeat: '2.5' is not a whole number"),
    ("fly --gimbal", "--gimbal: its value is missing"),
    ("fly --off-axis-deg 1", "--off-axis-deg: 2 values are needed"),
    ("fly --integrator ab9", "--integrator ab9: must be one of '"),
    ("vehicle", "twin vehicle needs one of show, build, import (`twin vehicle --help`"),
    ("mechanism", "twin mechanism needs one of show, check, build, search"),
    ("campaign", "twin campaign needs one of run, resume, report, refly (`twin campaign --help`"),
    ("campaign run", "twin campaign needs an argument: Study file (.toml), or a shipped study"),
    ("campaign fly", "action fly: must be one of 'run', 'resume', 'report', 'refly'"),
]


@pytest.mark.parametrize(("command", "says"), MISTAKES, ids=[c for c, _ in MISTAKES])
def test_a_mistake_is_reported_in_one_line_with_exit_2_and_leaves_nothing_behind(
    capsys, here, command, says
):
    for name, text in FILES.items():
        (here / name).write_text(text)
    code, out, err = run(capsys, *command.split())
    assert code == 2
    assert out == ""
    assert says in err
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert {p.name for p in here.iterdir()} == set(FILES)


@pytest.mark.parametrize(
    "words",
    [
        "--longest-delay-ms 60 1_0 2_0",
        "--longest-delay-ms=60 1_0 2_0",
        "--fail-below 1_0 1_0 2_0",
        "--with linkage --set wind_speed=1 1_0",
    ],
)
def test_a_file_after_a_number_may_have_a_name_like_one(words):
    if "--fail-below" in words:  # there it is the number
        with pytest.raises(TwinError, match="--fail-below 1_0: must be a number"):
            parse(["compare", *words.split()])
        return
    _, settings = parse(["compare", *words.split()])
    assert settings.recordings == tuple(Path(n) for n in ("1_0", "2_0") if n in words)


def test_the_rate_a_mistake_suggests_is_accepted(capsys, here):
    _, _, err = run(capsys, "fly", "--control-hz", "333", "--dt", "0.001")
    suggested = re.search(r"for example ([\d.]+) Hz", err).group(1)
    step = ("--dt", "0.001", "--duration-s", "0.1")
    code, _, err = run(capsys, "fly", "--control-hz", suggested, *step)
    assert (code, err) == (0, "")


def test_a_flight_of_one_tick_towards_a_point_has_a_distance(capsys, here):
    code, out, _ = run(
        capsys, "fly", "--json", "--target", "300", "0", "350", "--duration-s", "0.004"
    )
    assert code == 0
    assert json.loads(out)["closest_approach_m"] == pytest.approx(461, abs=1)  # hypot(300, 350)


def test_an_interrupted_run_says_where_it_is_kept(capsys, here, monkeypatch):
    planned = Pilot.planned

    def pressed(self, times):
        if times[0] > 0:  # before the second chunk of compiled ticks
            raise KeyboardInterrupt
        return planned(self, times)

    monkeypatch.setattr(Pilot, "planned", pressed)
    code, _, err = run(capsys, "fly", "--out", "f.rrd")
    assert (code, err) == (130, "twin: interrupted; f.rrd holds the run up to there\n")
    assert read("f.rrd")["vehicle/position"].time[-1] == pytest.approx(63 * 0.004)


@pytest.mark.realtime
def test_a_run_interrupted_in_real_time_says_where_it_is_kept(capsys, here, monkeypatch):
    def pressed(self, time_ns):
        if time_ns >= 200_000_000:
            raise KeyboardInterrupt

    monkeypatch.setattr("twin.experiments.flight.flight.Flight.watch", pressed)
    code, _, err = run(capsys, "fly", "--clock", "wall", "--out", "f.rrd")
    assert (code, err) == (130, "twin: interrupted; f.rrd holds the run up to there\n")
    assert read("f.rrd")["vehicle/position"].time[-1] == pytest.approx(0.2, abs=0.005)


def test_json_is_one_object_with_the_documented_numbers_and_nothing_else(capsys, here):
    code, out, _ = run(capsys, "fly", "--json", "--duration-s", "0.5")
    assert code == 0
    numbers = json.loads(out)
    documented = {
        "recording",
        "mass_kg",
        "flight_time_s",
        "max_speed_m_s",
        "powered_slant_range_m",
        "closest_approach_m",
        "physics_steps",
        "physics_s",
        "wall_s",
    }
    assert documented <= set(numbers)
    assert Path(numbers["recording"]).is_file()
    assert numbers["physics_steps"] == 125


def test_a_run_that_diverges_ends_with_1_and_keeps_its_recording_up_to_there(capsys, here):
    from analysis.recording import reader as recording

    code, _, err = run(capsys, "fly", "--set", "ramp_stiffness=1e9", "--out", "bad.rrd")
    assert code == 1
    assert "diverged at" in err
    kept = recording.read(here / "bad.rrd")
    assert kept.series["vehicle/position"].time.size > 0
    assert "MuJoCo: " in err
    assert {p.name for p in here.iterdir()} == {"bad.rrd"}  # no .partial, no log of MuJoCo's


@pytest.mark.parametrize(
    "arguments",
    [("--mechanism", "direct_drive.xml"), ("--vehicle", "large_rocket.xml")],
    ids=lambda a: a[1],
)
def test_another_mechanism_or_vehicle_flies_without_a_change_to_the_program(
    capsys, here, arguments
):
    flag, file = arguments
    code, out, _ = run(capsys, "fly", "--json", flag, str(EXAMPLES / file))
    assert code == 0
    numbers = json.loads(out)
    assert numbers["warnings"] == {}
    assert numbers["max_height_m"] > 300


def test_doctor_names_what_it_looked_at(capsys):
    code, out, _ = run(capsys, "doctor", "--json")
    assert code == 0
    findings = json.loads(out)["findings"]
    topics = {f["topic"] for f in findings}
    assert {"mujoco", "native callbacks", "headless GL", "SCHED_FIFO", "AVR tools"} <= topics
    assert all(f["remedy"] for f in findings if f["level"] == "missing")


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp850"])
def test_any_encoding_of_the_terminal_shows_the_result(tmp_path, monkeypatch, encoding):
    """`attitude error 1.48°` once ended in a traceback after the flight was flown."""
    monkeypatch.chdir(tmp_path)
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding))
    with pytest.raises(SystemExit) as ended:
        main(["fly", "--duration-s", "0.05"])
    assert ended.value.code == 0
    assert b"rms under power" in shown.getvalue()


def test_a_full_disk_behind_the_output_is_one_line(tmp_path):
    command = [sys.executable, "-m", "twin", "parameters", "wind"]
    environment = {**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1])}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert done.returncode == 2
    assert done.stderr.decode().count("\n") == 1
    assert "No space left" in done.stderr.decode()


def test_a_terminal_of_one_column_gets_the_help(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1")
    code, out, _ = run(capsys, "view", "--help")
    assert code == 0
    assert "--web" in out


def table(path, name="y", last=0.2):
    """A table of steps whose angle follows at once."""
    rows = [(k * 0.01, (k // 50 % 2) * 0.1) for k in range(500)]
    lines = (f"{t:.2f},{u},{u * 0.9 if name == 'y' else last}\n" for t, u in rows)
    path.write_text(f"t,u,{name}\n{''.join(lines)}")


def test_what_cannot_be_identified_from_is_refused_in_one_line(capsys, here):
    table(here / "constant.csv", "z")
    table(here / "a.csv")
    table(here / "b.csv")
    columns = ("--time", "t", "--input", "u", "--angle")
    code, _, err = run(capsys, "identify", "constant.csv", *columns, "z")
    assert (code, err.count("\n")) == (2, 1)
    assert "is 0.2 in every sample" in err
    for twice in ("a.csv", "b.csv"):  # the same file, and a copy
        code, _, err = run(capsys, "identify", "a.csv", twice, *columns, "y")
        assert (code, err.count("\n")) == (2, 1)
        assert "give every measurement once" in err


def test_a_served_rig_refuses_parameters_that_it_does_not_have(capsys, here):
    code, _, err = run(capsys, "rig", "--set", "nope=5", "--duration-s", "0.1")
    assert code == 2
    assert err == (
        "twin: --set nope: a rig on the bench has no such parameter; must begin with gimbal_\n"
    )


@pytest.mark.parametrize(
    "module", ["analysis.schema", "tyro", "twin.experiments.flight.fly", "mujoco"]
)
def test_an_interrupt_while_something_is_imported_is_one_line(tmp_path, module):
    program = f"""
import os, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
from twin.cli.main import main
main(["fly"])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "twin: interrupted; nothing was recorded\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_an_import_turns_into_an_import_error_ends_without_a_traceback(
    tmp_path, number
):
    """NumPy's C code does so with a KeyboardInterrupt."""
    program = f"""
import os, sys
class Swallowing:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            try:
                os.kill(os.getpid(), {int(number)})
            except BaseException as error:
                raise ImportError("numpy") from error
sys.meta_path.insert(0, Swallowing())
from twin.cli.main import main
main(["fly"])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    what = "interrupted" if number == signal.SIGINT else "ended by SIGTERM"
    line = f"twin: {what}; nothing was recorded\n"
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", line)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_flight_says_what_ended_it_and_where_the_recording_is(tmp_path, capsys, number):
    """It arrives within an own controller, whose errors are otherwise the controller's."""
    own = tmp_path / "own.py"
    own.write_text(
        f"import os\nclass Ending:\n    def update(self, time, gimbal, vehicle):\n"
        f"        if time > 0.2:\n            os.kill(os.getpid(), {int(number)})\n"
        f"        return 0.0, 0.0\n"
    )
    out = tmp_path / "ended.rrd"
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        with pytest.raises(SystemExit) as end:
            main(["fly", "--controller", f"{own}:Ending", "--out", str(out)])
    finally:
        for n, handler in before.items():
            signal.signal(n, handler)
    assert end.value.code == 128 + number
    what = "interrupted" if number == signal.SIGINT else "ended by SIGTERM"
    line = f"twin: {what}; {out} holds the run up to there"
    assert capsys.readouterr().err.splitlines()[-1] == line
    recorded = read(out)
    assert recorded["gimbal/command"].time[-1] == pytest.approx(0.2, abs=0.01)
    assert any(f"run ended early: {number.name}" in e.text for e in recorded.events)


@pytest.mark.parametrize("name", ["two\nlines.csv", "red\x1b[31m.csv", "carriage\r.csv"])
def test_a_name_with_line_ends_or_control_characters_makes_a_message_of_one_line(
    capsys, tmp_path, name
):
    path = tmp_path / name
    path.write_text("t,u\n")
    code, _, err = run(
        capsys, "identify", str(path), "--time", "t", "--input", "u", "--angle", "u2"
    )
    (line,) = (text for text in err.split("\n") if text.startswith("twin:"))
    assert code == 2
    assert err.endswith(f"{line}\n")
    assert line.isprintable()
    assert repr(name)[1:-5] in line
