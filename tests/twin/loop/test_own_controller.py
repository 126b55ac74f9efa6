"""An own controller: equal to the built-in loop, harmless when it fails, never executed unasked."""

import math
import os
import sys
from pathlib import Path

import numpy as np
import pytest

import twin
from analysis.recording import read
from hardware.frames import GimbalState
from tests.twin.cli.test_cli import run as command
from twin.config import Fly
from twin.control import AttitudeController
from twin.errors import TwinError
from twin.experiments.assembly import make_plant
from twin.experiments.flight.own_controller import ControllerError, OwnController, load
from twin.experiments.programme import setpoint
from twin.loop.seats import Pilot
from twin.plant.authority import control_config
from twin.plant.compiled import compiled

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "own_controller.py"
SAME = f"{EXAMPLE}:AttitudeLoop"
GUSTS = {"wind_speed": 6.0, "wind_turbulence": 0.2}
MODEL = {"gimbal": "transfer-function"}
FLIGHTS = {
    "whole flight, doublet in gusts": MODEL | {"programme": "doublet", "set": GUSTS, "seed": 5},
    "linkage, step": {"programme": "step", "at_s": 1.0, "duration_s": 4.0},
    "point": MODEL | {"programme": "point", "off_axis_deg": (10.0, 5.0), "duration_s": 10.0},
    "hold": {"duration_s": 2.0},
    "rig": {"programme": "step", "at_s": 1.0, "gimbal": "emulator", "duration_s": 1.5},
    "base gyro": {"attitude": "base-gyro", "gimbal": "emulator", "duration_s": 0.3},
}


@pytest.mark.thorough
@pytest.mark.parametrize("settings", FLIGHTS.values(), ids=FLIGHTS)
def test_the_attitude_loop_as_a_users_file_flies_like_the_built_in_one(tmp_path, settings):
    built_in = read(twin.fly(out=tmp_path / "a.rrd", **settings))
    own = read(twin.fly(out=tmp_path / "b.rrd", controller=SAME, **settings))
    path = own["vehicle/position"].values
    apart = np.abs(path - built_in["vehicle/position"].values).max()
    assert apart <= 1e-9 * np.abs(path).max()  # the figure; rounding differs in places
    commands = (run["gimbal/command"].values for run in (built_in, own))
    assert np.abs(np.subtract(*commands)).max() <= 1e-9
    for signal in ("control/setpoint", "control/error"):
        np.testing.assert_allclose(own[signal].values, built_in[signal].values, atol=1e-9)


def test_what_an_own_controller_commands_is_what_the_gimbal_is_sent(tmp_path):
    class Swing:
        def start(self, model, period):
            self.period = period

        def update(self, time, gimbal, vehicle):
            assert vehicle.attitude.shape == (4,)
            return np.array([0.05 * math.sin(8.0 * time), self.period])

    out = tmp_path / "f.rrd"
    flight = twin.fly(controller=Swing(), control_hz=500.0, duration_s=0.5, out=out)
    sent = read(flight)["gimbal/command"]
    assert sent.values[:, 0] == pytest.approx(0.05 * np.sin(8.0 * sent.time), abs=1e-15)
    assert sent.values[:, 1] == pytest.approx(0.002)


def test_the_state_an_own_controller_is_given_is_a_copy(tmp_path):
    class Vandal:
        def update(self, time, gimbal, vehicle, setpoint):
            for array in (vehicle.position, vehicle.attitude, vehicle.rate, setpoint):
                array[:] = 7.0
            return 0.0, 0.0

    class Still:
        def update(self, time, gimbal, vehicle):
            return 0.0, 0.0

    ends = []
    for controller in (Vandal(), Still()):
        flight = twin.fly(controller=controller, duration_s=0.5, out=tmp_path / "f.rrd")
        ends.append(read(flight)["vehicle/position"].values[-1])
    np.testing.assert_array_equal(*ends)


BODIES = {
    "an exception": ("return 1.0 / 0.0", 3, "ZeroDivisionError"),
    "in a library": ("import math; return math.sqrt(-1.0)", 3, "ValueError"),
    "nan": ("return float('nan'), 0.0", 2, "nan"),
    "infinity": ("return 0.0, float('inf')", 2, "inf"),
    "degrees": ("return 5.0, 0.0", 2, "rad"),
    "three numbers": ("return 1, 2, 3", 2, "(1, 2, 3)"),
    "one number": ("return 0.1", 2, "0.1"),
    "nothing": ("return None", 2, "None"),
    "text": ("return 'left', 'right'", 2, "left"),
    "exit": ("raise SystemExit(0)", 3, "SystemExit"),
    "text of many lines": ("raise ValueError('a\\nb')", 3, "a b"),
    "no representation": (
        "return type('X', (), {'__repr__': lambda s: 1 / 0})()",
        2,
        "an object of type X",
    ),
}


@pytest.fixture(scope="module")
def seat():
    """Model and pilot of a flight, for adapters without a whole run."""
    config = Fly(gimbal="transfer-function")
    with compiled():
        plant = make_plant(config)
        programme, _ = setpoint(config, plant.model)
        loop = AttitudeController(control_config(plant.model))
        yield plant.model, Pilot(plant, loop, programme, 0.004)


@pytest.mark.parametrize(("body", "line", "says"), BODIES.values(), ids=BODIES)
def test_a_failing_update_is_reported_in_one_line_with_file_and_line(
    seat, tmp_path, body, line, says
):
    file = tmp_path / "own.py"
    file.write_text(f"class Loop:\n def update(self, t, g, v):\n  {body}\n")
    adapter = OwnController(load(f"{file}:Loop"), *seat, 0.004)
    with pytest.raises(ControllerError) as caught:
        adapter.update(0.1, GimbalState(0, (0.0, 0.0)))
    message = str(caught.value)
    assert message.startswith(f"controller at 0.1000 s: {file}, line {line}: ")
    assert says in message
    assert "\n" not in message


def test_a_failing_controller_ends_the_command_with_2_and_keeps_the_recording(capsys, tmp_path):
    file, out = tmp_path / "own.py", tmp_path / "f.rrd"
    file.write_text(
        "class Loop:\n  def update(self, t, g, v):\n    return (0.0, 0.0) if t < 0.1 else v.wrong\n"
    )
    code, text, err = command(capsys, "fly", "--controller", f"{file}:Loop", "--out", str(out))
    assert (code, text) == (2, "")
    assert f"{file}, line 3: AttributeError" in err
    assert err.count("\n") == 1
    kept = read(out)
    assert kept["gimbal/command"].time[-1] == pytest.approx(0.096)  # the last tick that was sent
    assert any(e.level == "ERROR" and "line 3" in e.text for e in kept.events)


FILES = {
    "wrong name": ("class Loop:\n  def update(self, t, g, v): ...\n", "Lop", ("'Lop'", "Loop")),
    "syntax": ("class Loop:\n  def update(self:\n", "Loop", ("line 2",)),
    "no update": ("class Loop: ...\n", "Loop", ("update(time, gimbal, vehicle)",)),
    "import": ("import os\nimport no_such_module\n", "Loop", ("line 2", "no_such_module")),
    "needs arguments": ("class Loop:\n  def __init__(self, k): ...\n", "Loop", ("k",)),
    "constructor": ("class Loop:\n  def __init__(self): 1/0\n", "Loop", ("line 2", "Zero")),
    "exit": ("import sys\nsys.exit(0)\n", "Loop", ("line 2", "SystemExit")),
    "null bytes": ("a = 1\0", "Loop", ("null",)),
}


@pytest.mark.parametrize(("text", "name", "says"), FILES.values(), ids=FILES)
def test_a_file_that_is_no_controller_is_refused_in_one_line(capsys, tmp_path, text, name, says):
    file = tmp_path / "own.py"
    file.write_text(text)
    code, out, err = command(capsys, "fly", "--controller", f"{file}:{name}", "--duration-s", "1")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert str(file) in err
    assert all(word in err for word in says)
    assert [p.name for p in tmp_path.iterdir()] == ["own.py"]  # no recording, no compiled file


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("missing.py:Loop", "there is no file missing.py"),
        ("folder.py:Loop", "not a Python file"),
        ("notes.txt:Loop", "not a Python file"),
        (":Loop", "not a Python file"),
        ("own.py", "FILE.py:NAME"),
    ],
)
def test_what_is_not_a_python_file_is_refused(capsys, tmp_path, monkeypatch, place, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "notes.txt").write_text("x")
    code, _, err = command(capsys, "fly", "--controller", place)
    assert code == 2
    assert says in err
    assert err.count("\n") == 1


def test_an_edit_within_the_same_second_counts_and_neighbours_can_be_imported(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "gains_of_mine.py").write_text("KP = 2")
    file = tmp_path / "own.py"
    text = "from gains_of_mine import KP\nclass Loop:\n  gain = {}\n  def update(s, t, g, v): ...\n"
    for gain in ("1", "2"):
        file.write_text(text.format(gain))
        os.utime(file, (1e9, 1e9))
        assert load(f"{file}:Loop").gain == int(gain)


def test_a_failing_start_is_reported_with_its_line(seat):
    class Loop:
        def start(self, model, period):
            model.nothing  # noqa: B018

        def update(self, time, gimbal, vehicle):
            return 0.0, 0.0

    with pytest.raises(ControllerError, match=r"test_own_controller.py, line \d+: Attr.*nothing"):
        OwnController(Loop(), *seat, 0.004)


def test_a_class_given_for_an_object_is_named():
    class Loop:
        def update(self, time, gimbal, vehicle):
            return 0.0, 0.0

    with pytest.raises(ControllerError, match="Loop is a class"):
        twin.fly(controller=Loop, duration_s=0.1)


def test_an_exception_with_a_rig_leaves_the_servos_at_neutral_and_disarmed(tmp_path, monkeypatch):
    from twin.hil import connect

    devices = []
    make = connect.device

    def kept(options):
        devices.append(make(options))
        return devices[-1]

    monkeypatch.setattr(connect, "device", kept)

    class Fails:
        def update(self, time, gimbal, vehicle):
            if time > 0.5:
                raise RuntimeError("own mistake")
            return 0.1, -0.1

    out = tmp_path / "f.rrd"
    with pytest.raises(ControllerError, match=r"test_own_controller.py, line \d+: .*own mistake"):
        twin.fly(controller=Fails(), gimbal="emulator", out=out)
    measured = read(out)["gimbal/measured"].values
    assert np.degrees(np.abs(measured).max()) > 4.0  # it was away from neutral
    (device,) = devices
    assert max(np.abs(device.truth()[0])) > np.radians(2.0)
    device.advance_us(20_000)  # less than the time after which a board gives up on its commander
    assert not device.device.armed
    device.advance_us(300_000)
    assert max(np.abs(device.truth()[0])) < np.radians(1.0)


def test_a_replay_executes_no_file_that_a_recording_names(capsys, tmp_path):
    file, trace = tmp_path / "own.py", tmp_path / "executed"
    file.write_text(
        f"open({str(trace)!r}, 'a').write('x')\n"
        "class Loop:\n  def update(self, t, g, v): return 0.01, 0.0\n"
    )
    flown = str(twin.fly(controller=f"{file}:Loop", duration_s=0.2, out=tmp_path / "f.rrd"))
    assert flown
    recording = str(tmp_path / "f.rrd")
    trace.unlink()
    code, _, err = command(capsys, "replay", recording)
    assert code == 2
    assert "--controller FILE.py:NAME" in err
    assert not trace.exists()
    for verb in ("report", "compare"):
        command(capsys, verb, recording, recording, "--out", str(tmp_path / verb))
    assert not trace.exists()
    code, text, _ = command(capsys, "replay", recording, "--controller", f"{file}:Loop")
    assert (code, trace.exists()) == (0, True)
    assert "identical" in text


def test_a_replay_names_an_edited_controller(tmp_path):
    file = tmp_path / "own.py"
    text = "class Loop:\n  def update(self, t, g, v): return {}, 0.0\n"
    file.write_text(text.format(0.01))
    place = f"{file}:Loop"
    flown = twin.fly(controller=place, duration_s=0.2, out=tmp_path / "f.rrd")
    file.write_text(text.format(0.02))
    again = twin.replay(flown, controller=place)
    assert not again.identical
    assert "controller's SHA-256" in again.changed


def test_a_flight_of_an_object_is_replayed_with_an_object(tmp_path):
    class Loop:
        def update(self, time, gimbal, vehicle):
            return 0.01, -0.02

    flown = twin.fly(controller=Loop(), duration_s=0.2, out=tmp_path / "f.rrd")
    assert read(flown).setting("controller") == "object:Loop"
    with pytest.raises(TwinError, match="own controller object:Loop"):
        twin.replay(flown)
    assert twin.replay(flown, controller=Loop()).identical
    with pytest.raises(TwinError, match="not a Python file"):
        twin.replay(flown, controller="object:Loop")


def test_repeated_flights_refuse_an_own_controller():
    with pytest.raises(TwinError, match="--repeat"):
        twin.fly(controller=SAME, repeat=2)
