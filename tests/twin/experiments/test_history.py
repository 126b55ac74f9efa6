"""Commands from a file: units, stops, and the gimbals they drive."""

import re

import numpy as np
import pytest

from analysis.recording import read
from analysis.schema import AnalysisError
from tests.twin.cli.test_cli import run as command
from twin.config import Compare, Step
from twin.errors import TwinError
from twin.evaluation.compare import compare
from twin.experiments.step import step
from twin.hil import nominal_calibration
from twin.hil.history import Source, gimbal_angles
from twin.hil.history import read as read_commands
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

TIMES, ANGLES = (0.0, 0.1, 0.35, 0.6), (0.0, 4.0, -3.0, 0.0)  # s, degrees


def table(path, values, name="u"):
    rows = "".join(f"{t},{v}\n" for t, v in zip(TIMES, values, strict=True))
    path.write_text(f"t,{name}\n{rows}")
    return path


def test_a_table_of_degrees_commands_those_angles_at_its_stamps(tmp_path):
    file = table(tmp_path / "a.csv", ANGLES)
    asked = {"commands": file, "time": "t", "input": "u", "input_unit": "deg", "hold_s": 0.2}
    step(Step(**asked, axis="y", out=tmp_path / "a.rrd"))
    run = read(tmp_path / "a.rrd")
    given = run["gimbal/command"]
    held = np.array(ANGLES)[np.searchsorted(TIMES, given.time + 1e-9, side="right") - 1]
    np.testing.assert_allclose(np.degrees(given.column("y")), held, atol=1e-9)
    assert not given.column("x").any()
    assert given.time[-1] == pytest.approx(0.8, abs=0.01)
    assert np.degrees(run["gimbal/simulated"].column("y").max()) == pytest.approx(4.0, abs=1.0)
    assert run.setting("signal") is None  # no figure takes them for a test signal
    # the recording drives another gimbal in the same way
    step(Step(commands=tmp_path / "a.rrd", gimbal="transfer-function", out=tmp_path / "b.rrd"))
    again = read(tmp_path / "b.rrd")["gimbal/command"]
    n = min(len(again.time), len(given.time))
    np.testing.assert_allclose(again.values[:n], given.values[:n], atol=1e-12)


def test_pulses_and_shaft_angles_are_converted_by_the_calibration_and_the_ratio(tmp_path):
    calibration = nominal_calibration(load(ModelConfig(scene="bench")).mj)
    wanted = np.radians(np.stack([ANGLES, np.zeros(4)], axis=1))
    pulses = 1e6 * np.array([calibration.pulses((x, y)) for x, y in wanted])
    rest = 1e6 * calibration.zero[1]
    file = tmp_path / "p.csv"
    lines = [f"{t},{a!r},{rest!r}" for t, a in zip(TIMES, pulses[:, 0].tolist(), strict=True)]
    file.write_text("\n".join(["t,p,q", *lines]))
    source = Source(file, "t", ("p", "q"), "us")
    seen = gimbal_angles(source, read_commands(source), calibration, "both", None)
    np.testing.assert_allclose(seen[:, 0], wanted[:, 0], atol=2e-4)
    # 0 % is 1500 µs and 100 % is 2000 µs, so 20 % is 1600 µs
    file = table(tmp_path / "q.csv", (0.0, 20.0, -20.0, 0.0))
    source = Source(file, "t", ("u",), "percent")
    np.testing.assert_allclose(read_commands(source).value, (1.5e-3, 1.6e-3, 1.4e-3, 1.5e-3))
    source = Source(table(tmp_path / "s.csv", ANGLES), "t", ("u",), "deg", ratio=-0.5)
    np.testing.assert_allclose(np.degrees(read_commands(source).value), -0.5 * np.array(ANGLES))


@pytest.mark.parametrize(
    ("values", "settings", "match"),
    [
        ((0, 4, -12, 0), {"input_unit": "deg"}, r"-12 ° at 0.35 s: must be between the stops"),
        ((0, 5, 0, 0), {}, r"5 rad, 286.5 °, at .*in degrees\? give --input-unit deg$"),
        ((1500, 2600, 1500, 1500), {"input_unit": "us"}, r"2600 µs at 0.1 s: must be a pulse"),
        ((0, 1, 0, 0), {"input_unit": "us", "ratio": 0.5}, "--ratio: not with --input-unit us"),
        ((0, 1, 0, 0), {"input_unit": "furlong"}, "--input-unit furlong: must be one of"),
        ((0, 1, 0, 0), {"input": "v"}, "no column 'v'"),
        ((0, 1, 0, 0), {"input": None}, "name its columns"),
        ((0, 1, 0, 0), {"signal": "chirp"}, "--signal chirp: --commands takes the place"),
    ],
)
def test_a_history_that_cannot_be_commanded_is_refused_in_one_line(
    tmp_path, values, settings, match
):
    file = table(tmp_path / "a.csv", values)
    asked = {"commands": file, "time": "t", "input": "u", "out": tmp_path / "never.rrd"}
    with pytest.raises((TwinError, AnalysisError), match=match) as caught:
        step(Step(**{**asked, **settings}))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "never.rrd").exists()


def test_columns_without_commands_are_refused():
    with pytest.raises(TwinError, match="--time t: needs --commands"):
        Step(time="t")


def logged(tmp_path, scale=1.0):
    """A log of the linkage under test steps, as somebody's CSV in degrees."""
    step(Step(repeats=1, hold_s=0.3, axis="x", out=tmp_path / "l.rrd"))
    run = read(tmp_path / "l.rrd")
    rows = np.degrees([run["gimbal/command"].column("x"), run["gimbal/simulated"].column("x")])
    path = tmp_path / "my.csv"
    np.savetxt(
        path, np.array([run["gimbal/command"].time, *(scale * rows)]).T, "%.9g", ",",
        header="t,u,y", comments="",
    )  # fmt: skip
    return path


def test_one_line_compares_a_log_with_the_linkage_or_a_model(capsys, tmp_path):
    file = logged(tmp_path, scale=2.0)
    asked = {"time": "t", "input": "u", "angle": "y", "angle_unit": "deg", "ratio": 0.5}
    found = compare(Compare((file,), with_="linkage", **asked, out=tmp_path / "c.rrd"))
    assert found.comparison.fit > 99.0
    merged = read(tmp_path / "c.rrd")
    assert {"gimbal/command", "gimbal/reference", "gimbal/other"} <= set(merged.series)
    slow = {**asked, "set": {"gimbal_servo_slew": 5.0}}
    other = compare(Compare((file,), with_="linkage", **slow, out=tmp_path / "d.rrd"))
    assert other.comparison.fit < found.comparison.fit - 3.0
    line = f"compare {file} --with mjcf/gimbal.json --time t --input u --angle y --angle-unit deg"
    code, text, _ = command(capsys, *line.split(), "--ratio", "0.5", "--out", f"{tmp_path}/e.rrd")
    assert code == 0
    assert "mjcf/gimbal.json (simulated)" in text


@pytest.mark.parametrize(
    ("flags", "match"),
    [
        (("--with", "turbo"), "--with turbo: must be linkage, or an identified model"),
        (("--ratio", "2"), "--ratio 2.0: needs --with"),
    ],
)
def test_a_model_that_does_not_exist_is_refused(capsys, tmp_path, flags, match):
    file = table(tmp_path / "a.csv", ANGLES)
    line = f"compare {file} --time t --input u --angle u"
    code, _, error = command(capsys, *line.split(), *flags)
    assert (code, error.count("\n")) == (2, 1)
    assert match in error


@pytest.mark.parametrize(
    ("units", "hint"),
    [
        ((), "5 rad, 286.5 °, at 0.4 s: must be .*in degrees? give --angle-unit deg"),
        (("--angle-unit", "rad"), "5 rad, 286.5 °, at .*in degrees? give --angle-unit deg"),
        (("--angle-unit", "deg", "--input-unit", "rad"), "5 rad, .* give --input-unit deg"),
        (("--angle-unit", "deg"), "of 12 ° at .* to 10 °"),
    ],
)
def test_a_log_in_degrees_that_is_read_as_radians_is_asked_for_its_unit(
    capsys, tmp_path, units, hint
):
    reach = 12.0 if units == ("--angle-unit", "deg") else 5.0
    file = tmp_path / "log.csv"
    rows = (f"{k / 50},{u},{0.9 * u}" for k, u in enumerate(np.repeat([0.0, reach, 0.0], 20)))
    file.write_text("\n".join(["t,u,y", *rows]))
    line = f"compare {file} --with linkage --time t --input u --angle y --out {tmp_path}/o.rrd"
    code, _, error = command(capsys, *line.split(), *units)
    assert (code, error.count("\n")) == (2, 1)
    assert re.search(hint.replace("?", r"\?") + "$", error.strip())


@pytest.mark.parametrize(("degrees", "stops"), [(6.0, 5.0), (12.0, 15.0)])
def test_commands_are_limited_by_the_stops_of_the_mechanism_that_is_commanded(
    tmp_path, degrees, stops
):
    mechanism = stopped(tmp_path, stops)
    file = table(tmp_path / "c.csv", (0.0, degrees, 0.0, 0.0))
    of_file = {"commands": file, "time": "t", "input": "u", "input_unit": "deg", "hold_s": 0.1}
    for settings in ({"amplitude_deg": degrees, "repeats": 1, "hold_s": 0.1}, of_file):
        asked = Step(mechanism=mechanism, out=tmp_path / "s.rrd", axis="x", **settings)
        if degrees < stops:
            step(asked)
            continue
        with pytest.raises(TwinError, match=rf"{degrees:g}\b.*{stops:g}"):
            step(asked)
        assert not list(tmp_path.glob("*.rrd*"))


def stopped(folder, degrees):
    """The shipped direct drive with stops at this angle."""
    file = folder / "stopped.xml"
    text = (MJCF / "examples" / "direct_drive.xml").read_text()
    end = np.radians(degrees)
    for old, new in (("-0.174533 0.174533", f"{-end} {end}"), ("-0.17 0.17", f"{-end} {end}")):
        text = text.replace(f'range="{old}"', f'range="{new}"')
    file.write_text(text)
    return file
