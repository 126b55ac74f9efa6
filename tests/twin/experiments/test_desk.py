"""The desk's commands: serve, calibrate, mirror; and the one line each mistake is worth."""

import json
import os
import pty
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from analysis.recording import read
from hardware.calibration import CalibrationError, CalibrationRig, nominal
from hardware.calibration import read as read_calibration
from hardware.calibration.file import to_dict
from hardware.device import serve
from hardware.emulator import parse
from hardware.emulator.cable import Cable
from hardware.frames import GimbalCommand, GimbalState
from hardware.protocol import PROTOCOL, Board, Encoder, default_config, hello
from hardware.rig import in_process
from tests.twin.cli.test_cli import run as command
from twin.config import Calibrate, Mirror, Step
from twin.experiments import calibrate as calibrating
from twin.experiments.calibrate import calibrate
from twin.experiments.mirror import mirror
from twin.experiments.step import step
from twin.hil import RigOptions, device, open_rig
from twin.hil.connect import opened
from twin.hil.teleop import Keys, Stick
from twin.loop import loop
from twin.loop.readings import Readings
from twin.physics import native
from twin.plant.authority import stroke
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

TWIN = [sys.executable, "-m", "twin"]
UNIT = 3


@contextmanager
def served(*faults: str, tcp: int | None = None):
    """A simulated rig in real time on a thread of this process; gives its device and port."""
    with native.installed():
        simulated = device(RigOptions("emulator", faults=faults))
        with serve(simulated, tcp=tcp) as server:
            thread = threading.Thread(target=server.run)
            thread.start()
            try:
                yield simulated, server.port.url
            finally:
                server.stop()
                thread.join()


def pulled_thrice(simulated, monkeypatch):
    """Pull the cable of a mirror's rig for 0.3 s, 0.8 s apart, from 0.8 s of its loop on.

    Told by the loop itself: between its call and its first tick a full suite's garbage may take a
    second to collect.
    """

    whole = simulated._cable

    def told(seats, *, stop, **more):
        def watched():
            if seats.plant.time_ns >= 800_000_000 and simulated._cable is whole:
                begin = simulated.time_us * 1e-6
                faults = tuple(parse(f"link:unplug:0.3@{begin + 0.8 * k}") for k in range(3))
                simulated._cable = Cable(faults, 0)
            return stop()

        return loop.run(seats, stop=watched, **more)

    monkeypatch.setattr("twin.experiments.session.run", told)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A calibration of a rig with random tolerances."""
    path = tmp_path_factory.mktemp("desk") / "calibration.json"
    result = calibrate(Calibrate(unit=UNIT, repeats=1, out=path))
    return path, result


class TestRig:
    @pytest.mark.thorough
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_it_prints_its_loopback_port_and_ends_well(self, number):
        arguments = [*TWIN, "rig", "--port", "0", "--json"]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            told = json.loads(process.stdout.readline())
            process.send_signal(number)
            _, errors = process.communicate(timeout=20)
        assert told["port"].startswith("socket://127.0.0.1:")
        assert (process.returncode, errors) == (0, b"")


@contextmanager
def unit_alone(path):
    """A simulated unit driven by `hardware.rig.Rig` and its calibration file, without the twin."""
    with native.installed():
        simulated = device(RigOptions("emulator", unit=UNIT))
        rig = in_process(simulated, read_calibration(path), fuse=False)
        rig.connect()
        yield simulated, rig


def rest(simulated, rig, angle):
    """True angles after 0.3 s of one command [rad]."""
    end = simulated.time_us + 300_000
    while simulated.time_us < end:
        rig.send(GimbalCommand(simulated.time_ns, angle))
        simulated.advance_us(10_000)
        rig.poll()
    return np.array(simulated.bench.plant.angles())


class TestCalibrate:
    @pytest.mark.thorough
    def test_hardware_alone_sends_a_calibrated_rig_where_it_is_commanded(self, calibrated):
        off = []
        with unit_alone(calibrated[0]) as (simulated, rig):
            for degrees in ((8, 0), (4, 4), (-4, 0), (-8, 8), (0, -8), (0, 4)):
                angle = np.radians(degrees)
                sides = []
                for side in np.radians((-1.5, 1.5)):
                    rest(simulated, rig, tuple(angle + side))
                    sides.append(rest(simulated, rig, tuple(angle)))
                off.append(np.mean(sides, axis=0) - angle)
        # the motor's weight moves the gimbal through its play of ±0.2° outwards, which at the
        # switches counts as 3 % of slope and is 0.1° to 0.2° off in between; a line is 0.9° off
        assert np.degrees(abs(np.array(off))).max() < 0.3, np.degrees(off)

    def test_the_estimate_of_a_calibrated_rig_is_the_true_angle(self, calibrated):
        off = []
        with native.installed():
            plant = Plant(load(ModelConfig(scene="bench", gimbal="follow")))
            options = RigOptions("emulator", unit=UNIT, calibration=calibrated[0])
            with open_rig(options, plant) as seat:
                bench = seat.rig.line.device.bench.plant
                for angle in ((5, 0), (-5, 0), (0, 5), (0, -5), (3, -6)):
                    wanted = radians(angle[0]), radians(angle[1])
                    for _ in range(250):
                        state = seat.poll()
                        seat.send(GimbalCommand(plant.time_ns, wanted))
                        plant.advance(2)
                    off.append(np.subtract(state.angle, bench.angles()))
        # switches held to 0.03°, waviness of the tracks 0.05°, a quarter ADC step
        assert np.degrees(abs(np.array(off))).max() < 0.2, np.degrees(off)

    def test_a_file_of_version_1_is_used_with_one_line_of_warning(self, capsys, tmp_path):
        path = tmp_path / "old.json"
        content = to_dict(nominal()) | {
            "schema": "tvc-twin/calibration/1",
            "zero_covariance_us2": [[1.0, 0.0], [0.0, 1.0]],
            "matrix_covariance_deg2_per_us2": np.eye(4).tolist(),
        }
        path.write_text(json.dumps(content))
        with native.installed(), open_rig(RigOptions("emulator", calibration=path), None) as seat:
            assert seat.rig.calibration.linearisation.straight
        errors = capsys.readouterr().err
        assert errors.count("\n") == 1
        assert errors.startswith(f"twin: {path}: the calibration holds only a straight line")

    def test_the_file_holds_what_the_run_measured(self, calibrated):
        path, result = calibrated
        back, ours = read_calibration(path), result.calibration
        assert back.rig == ours.rig
        assert not back.linearisation.straight
        for angle in ((0.14, 0.14), (-0.14, 0.0)):
            np.testing.assert_allclose(back.pulses(angle), ours.pulses(angle), rtol=1e-12)
        np.testing.assert_allclose(back.matrix, ours.matrix, rtol=1e-12)
        np.testing.assert_allclose(back.zero, ours.zero, rtol=1e-12)
        assert "°/ms" in result.text()
        assert "at 8°" in result.text()
        assert json.loads(json.dumps(result.as_dict()))["rig"] == f"{result.calibration.rig:08x}"

    @pytest.mark.thorough
    def test_a_misplaced_switch_is_named_and_nothing_written(self, tmp_path):
        out = tmp_path / "c.json"
        asked = Calibrate(repeats=1, switch_deg=(13.0, -9.0, 9.0, -9.0), out=out)
        with pytest.raises(CalibrationError, match=r"switches \+x and -x are .* apart by the gyro"):
            calibrate(asked)
        assert list(tmp_path.iterdir()) == []

    def test_what_cannot_be_negative_is_a_limit_where_its_interval_holds_zero(self, calibrated):
        given = replace(
            calibrated[1].calibration,
            hysteresis=tuple(np.radians((-0.17, 0.4))),
            hysteresis_sigma=tuple(np.radians((0.1, 0.1))),
        )
        rows = dict(replace(calibrated[1], calibration=given, gimbal="/dev/ttyUSB0").rows())
        assert rows["play x"].startswith("below 0.20°,")  # 1.96 σ
        assert rows["play y"].startswith("0.40 ± 0.20°,")
        assert rows["timing"].startswith("not judged")

    @pytest.mark.parametrize(
        ("verb", "told"), [("mirror", "nothing was recorded"), ("calibrate", "sent to neutral")]
    )
    def test_an_interrupt_before_anything_is_kept_leaves_no_file(
        self, tmp_path, monkeypatch, capsys, verb, told
    ):
        def interrupted(*_, **__):
            signal.raise_signal(signal.SIGINT)

        monkeypatch.chdir(tmp_path)
        for name in ("twin.hil.connect.check_motion", "twin.experiments.calibrate.Procedure"):
            monkeypatch.setattr(name, interrupted)
        steer = ["--steer", "joystick"] if verb == "mirror" else []
        code, _, err = command(capsys, verb, "--gimbal", "emulator", *steer)
        assert code == 130
        assert told in err
        assert not list(tmp_path.rglob("*.rrd")) + list(tmp_path.rglob("*.json"))

    def test_a_board_without_a_serial_number_keeps_the_one_it_is_given(self):
        with native.installed(), open_rig(RigOptions("emulator", fuse=False), None) as seat:
            board = seat.rig.line.device.device
            board.serial = 0
            seat.rig.hello = replace(seat.rig.hello, serial=0)
            given = calibrating._numbered(seat)
            assert given == board.serial != 0
            assert calibrating._numbered(seat) == given

    def test_a_board_that_restarts_midway_is_reported(self):
        with native.installed(), open_rig(RigOptions("emulator", fuse=False), None) as seat:
            simulated, wait = seat.rig.line.device, seat.wait

            def failing(duration_ns):
                wait(duration_ns)
                if simulated.time_us > 6_000_000 and simulated._boot_us == 0:
                    simulated._boot_us = -simulated._tick * 1000
                    simulated.device.flags = 0

            seat.wait = failing
            with pytest.raises(CalibrationError, match=r"lost at .* it started again"):
                calibrating._drive(seat, CalibrationRig())

    def test_a_rig_that_falls_silent_midway_is_reported(self, tmp_path):
        asked = Calibrate(fault=("link:unplug:3600@3",), out=tmp_path / "c.json")
        with pytest.raises(CalibrationError, match="fell silent"):
            calibrate(asked)


class TestMirror:
    @pytest.mark.thorough
    def test_the_simulated_gimbal_shows_what_was_measured(self, tmp_path):
        result = mirror(Mirror(duration_s=0.6, out=tmp_path / "m.rrd"))
        run = read(tmp_path / "m.rrd")
        assert result.frames > 250
        seen = run["gimbal/measured"]
        shown = run["gimbal/followed"]
        later = np.interp(seen.time + 6e-3, shown.time, shown.values[:, 0])
        # it rests, so that 6 ms later only the filter's noise of 0.02° is between them
        assert abs(np.degrees(later - seen.values[:, 0])[5:-5]).max() < 0.1
        assert run["sensors/gyro"].values.shape == (len(seen.time), 3)

    @pytest.mark.thorough
    def test_a_tape_is_followed_without_the_rig(self, tmp_path):
        live = tmp_path / "live.rrd"
        step(Step(gimbal="emulator", repeats=1, hold_s=0.3, axis="x", out=live))
        result = mirror(Mirror(playback=live, out=tmp_path / "again.rrd"))
        a, b = read(live), read(tmp_path / "again.rrd")
        assert result.frames == len(a["gimbal/measured"].time)
        # the tape is cut into ticks of 0.5 ms, a frame belongs to the tick after its stamp
        for name in ("gimbal/measured", "sensors/potentiometer", "sensors/gyro"):
            n = len(b[name].time)
            assert n >= len(a[name].time) - 1
            np.testing.assert_array_equal(b[name].time, a[name].time[:n])
            np.testing.assert_allclose(b[name].values, a[name].values[:n], atol=1e-12)
        at = np.arange(0.1, 1.0, 0.01)
        moved = [
            np.interp(at, r["gimbal/followed"].time, r["gimbal/followed"].values[:, 0])
            for r in (a, b)
        ]
        # live it was late by the wire and the tick, 4 ms at up to 200 °/s
        assert np.degrees(np.sqrt(np.mean((moved[0] - moved[1]) ** 2))) < 0.5

    @pytest.mark.parametrize(
        "tcp", [pytest.param(None, id="pty"), pytest.param(0, id="tcp", marks=pytest.mark.slow)]
    )
    @pytest.mark.realtime
    def test_pulled_and_put_back_three_times_it_goes_on(self, tmp_path, monkeypatch, tcp):
        if tcp is None and os.name != "posix":
            pytest.skip("no pseudo-terminals here")
        with served(tcp=tcp) as (simulated, url):
            pulled_thrice(simulated, monkeypatch)
            asked = Mirror(gimbal=url, steer="joystick", duration_s=4.0, out=tmp_path / "m.rrd")
            result = mirror(asked)
        assert result.ended == "time"
        assert len(result.gaps_s) == 3, result
        run = read(tmp_path / "m.rrd")
        stamps = run["gimbal/measured"].time
        assert (np.diff(stamps) > 0.25).sum() == 3
        assert np.diff(run["gimbal/followed"].time).max() < 2.5e-3  # a row every 2 ms throughout
        assert [e.level for e in run.events].count("WARN") == 3
        assert any(e.text == "rig away" for e in run.health)


class TestSteering:
    def test_arrows_turn_and_space_returns(self):
        ours, theirs = pty.openpty()
        still = GimbalState(0, (0.0, 0.0))
        with Keys(radians(4.2), theirs) as keys:
            os.write(ours, b"\x1b[Aq")  # before the run
            assert keys.update(0.0, still) == (0.0, 0.0)
            os.write(ours, b"\x1b[A\x1b[A\x1b[C\x1b")
            first = keys.update(0.0, still)
            os.write(ours, b"[D")  # an arrow torn apart on its way
            second = keys.update(0.0, still)
            os.write(ours, b" q")
            third = keys.update(0.0, still)
            os.write(ours, b"\x1b[B" * 20)  # past the stroke of a small mechanism
            last = keys.update(0.0, still)
        np.testing.assert_allclose(
            np.degrees([first, second, third, last]), [[1, 0.5], [1, 0], [0, 0], [-4.2, 0]]
        )
        assert keys.ended
        os.close(ours)
        os.close(theirs)

    def test_a_stick_reaches_the_stroke_of_the_mechanism_and_rests_at_zero(self):
        model = load(ModelConfig(scene="bench", overrides={"gimbal_stroke": 0.07})).mj
        readings = Readings()
        stick = Stick(readings, stroke(model))
        with native.installed(), open_rig(RigOptions("emulator"), None) as seat:
            seat.rig.line.device.bench.joystick = (1.0, 0.02)
            seat.wait(20_000_000)
            readings.frames = seat.rig.poll()
        x, y = stick.update(0.0, GimbalState(0, (0.0, 0.0)))
        assert np.degrees(x) == pytest.approx(np.degrees(0.07), abs=0.03)  # one ADC step
        assert y == 0.0


MISTAKES = [
    ("mirror --gimbal linkage", "needs a rig"),
    ("mirror --gimbal /dev/nosuchport", "no such port"),
    ("mirror --gimbal socket://127.0.0.1:9", "nothing listens"),
    ("mirror --gimbal socket://127.0.0.1:99999", "1 to 65535"),
    ("mirror --gimbal {file}", "not a serial port"),
    ("mirror --gimbal emulator --fault gyro:melted", "must be one of"),
    ("mirror --gimbal emulator --fault link:drop:7", "0…1"),
    ("mirror --gimbal emulator --calibration {file}", "not JSON"),
    ("mirror --gimbal emulator --calibration {calibration}", "is of rig"),
    ("mirror --gimbal emulator --steer keys", "terminal"),
    ("mirror --playback {file}", "{file}"),
    ("mirror --playback {file} --steer keys", "cannot be steered"),
    ("mirror --playback {file} --gimbal firmware", "--gimbal: needs a rig"),
    ("mirror --playback {file} --unit 3", "--unit: needs a rig"),
    ("mechanism show --stroke-deg 5", "no effect with action show; it is for search"),
    ("mechanism build m.toml --gap-mm 1", "no effect with action build"),
    ("campaign refly limits 3 --workers 2", "no effect with action refly; it is for run, resume"),
    ("mirror --model {file}", "--shadow transfer-function only"),
    ("mirror --duration-s -1", "from 0.001"),
    ("campaign refly limits nan", "twin: 'nan': must be a whole number"),
    ("step --gimbal /dev/ttyUSB9 --clock lockstep", "real time"),
    ("step --gimbal emulater", "emulator"),
    ("step --gimbal ttyUSB0", "did you mean /dev/ttyUSB0?"),
    ("step --minimal", "other runs read it from --calibration"),
    ("step --baud 9600", "fixed at 500000"),
    ("step --gimbl emulator", "did you mean --gimbal? ("),
    ("step --gimbal linkage --fault gyro:bias", "needs a rig"),
    ("step --gimbal linkage --calibration {file}", "needs a rig"),
    ("step --gimbal socket://127.0.0.1:9 --unit 3", "simulated rigs"),
    ("calibrate --out /proc/nowhere/c.json", "cannot write"),
    ("calibrate --switch-deg 9 9 9 9", "+x, -x, +y, -y"),
    ("calibrate --repeats 0", "from 1 to 100"),
    ("calibrate --gimbal linkage", "must be a rig"),
    ("rig --kind arduino", "emulator"),
    ("rig --fault supply:sag:2", "0…0.9"),
    ("rig --fault nonsense", "potentiometer_x_a:glitch"),
    ("rig --port 99999", "65535"),
    ("rig --port 5000 --link /tmp/x", "--link"),
]


@pytest.mark.parametrize(("line", "told"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, calibrated, line, told):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "text.txt"
    file.write_text("text")
    names = {"file": file, "calibration": calibrated[0]}
    code, out, err = command(capsys, *line.format(**names).split())
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert told.format(**names) in err


class Chatter:
    """Something that is no rig, at the end of a pseudo-terminal."""

    def __init__(self, say: bytes) -> None:
        self.say = say

    def write(self, data: bytes) -> None: ...

    def read(self) -> bytes:
        return self.say

    def advance_us(self, duration: int) -> None: ...


@pytest.mark.parametrize(
    ("say", "told"), [(b"", "nothing answered"), (b"Marlin 1.0 ok\r\n", "another baud rate")]
)
def test_another_device_is_told_from_a_rig(capsys, tmp_path, monkeypatch, say, told):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hardware.rig.Rig.connect.__defaults__", (300_000_000,))
    with serve(Chatter(say)) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        code, _, err = command(capsys, "mirror", "--gimbal", server.port.url)
        server.stop()
        thread.join()
    assert code == 2
    assert told in err
    assert not (tmp_path / "runs").exists()


def test_old_firmware_is_told_and_what_to_do(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    old = replace(hello(Board.NANO, 1, default_config()), protocol=PROTOCOL + 1)
    with serve(Chatter(Encoder().encode(old))) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        code, _, err = command(capsys, "step", "--gimbal", server.port.url)
        server.stop()
        thread.join()
    assert code == 2
    assert "flash the firmware" in err


def test_a_rig_on_a_port_without_a_calibration_says_that_its_angles_are_unproven(calibrated):
    with serve(Chatter(b"")) as server:
        for path in (None, calibrated[0]):
            seat = opened(RigOptions(server.port.url, calibration=path), None)
            seat.close()
            assert ("angles unproven; run twin calibrate" in seat.note) is (path is None)


@pytest.mark.realtime
def test_a_busy_port_is_told(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with served() as (_, url), native.installed(), open_rig(RigOptions(url), None):
        code, _, err = command(capsys, "mirror", "--gimbal", url)
    assert code == 2
    assert "in use" in err
