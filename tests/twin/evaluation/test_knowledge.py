"""`twin identify` and `twin compare`: from recordings and tables to models, figures, exit codes."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.identify import Expectation
from analysis.recording import load
from analysis.recording import reader as recording
from analysis.transfer_function import TransferFunctionModel
from hardware.simavr.nano import missing
from tests.twin.cli.test_cli import run
from twin.evaluation.identify_result import InformationResult
from twin.plant.model.model import REFERENCE_GIMBAL

needs_avr = pytest.mark.skipif(bool(missing()), reason=f"without {', '.join(missing())}")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Recordings of the shipped model (steps, multisine) and of the linkage."""
    from twin.config import Step
    from twin.experiments.step import step

    folder = tmp_path_factory.mktemp("made")
    short = {"repeats": 1, "hold_s": 0.5}
    for name, options in {
        "steps": {"gimbal": "transfer-function"},
        "multisine": {"gimbal": "transfer-function", "signal": "multisine"},
        "only_x": {"gimbal": "transfer-function", "axis": "x"},
        "linkage": {"gimbal": "linkage"},
    }.items():
        step(Step(out=folder / f"{name}.rrd", **short, **options))
    return folder


def told(capsys, *arguments: str) -> dict:
    again = ("--force",) if arguments[0] == "identify" else ()
    code, out, _ = run(capsys, *arguments, "--json", *again)
    assert code == 0
    return json.loads(out)


@pytest.mark.thorough
@pytest.mark.parametrize("signal", ["steps", "multisine"])
def test_the_flown_model_is_found_again_within_its_intervals_and_flies(
    capsys, made, tmp_path, signal
):
    """99.9 % intervals, since there are 16 of them; nothing couples, so nothing is fitted there."""
    out = tmp_path / "model.json"
    found = told(capsys, "identify", str(made / f"{signal}.rrd"), "--out", str(out))
    flown = TransferFunctionModel.read(REFERENCE_GIMBAL)
    known = {}
    for axis in "xy":
        truth = flown.channel(axis, axis)
        omega = math.sqrt(truth.den[2])
        known[f"{axis}/{axis} gain"] = truth.num[0] / truth.den[2]
        known[f"{axis}/{axis} delay"] = truth.delay
        known[f"{axis}/{axis} natural frequency"] = omega
        known[f"{axis}/{axis} damping"] = truth.den[1] / 2.0 / omega
    assert len(found["estimates"]) == 8
    for e in found["estimates"]:
        value = known[e["name"]]
        assert abs(e["value"] - value) < 3.3 * e["std"]
        assert e["std"] < 0.01 * value
    model = TransferFunctionModel.read(out)
    assert model.channels[0][1].zero
    assert model.source["made_by"] == "twin identify"
    code, text, _ = run(
        capsys, "fly", "--gimbal", "transfer-function", "--model", str(out), "--duration-s", "0.3",
        "--out", str(tmp_path / "fly.rrd"),
    )  # fmt: skip
    assert code == 0
    assert "recording" in text


def test_a_flight_is_identified_with_a_word_about_its_loop_and_compared_with_a_step_with_another(
    capsys, made, tmp_path
):
    """What the loop does to an estimate: L. Ljung, System Identification, 2nd ed., § 13.4."""
    flight, out = str(tmp_path / "flight.rrd"), str(tmp_path / "model.json")
    assert run(capsys, "fly", "--programme", "doublet", "--at-s", "1", "--duration-s", "3",
               "--gimbal", "transfer-function", "--out", flight)[0] == 0  # fmt: skip
    found = told(capsys, "identify", flight, "--out", out)
    assert any("commands answer its angles" in w for w in found["warnings"])
    steps = str(made / "steps.rrd")
    compared = told(capsys, "compare", steps, flight, "--out", str(tmp_path / "c.rrd"))
    assert any(w.startswith(f"{flight} is of fly, {steps} of step") for w in compared["warnings"])
    assert told(capsys, "compare", steps, steps, "--out", str(tmp_path / "c.rrd"))["warnings"] == []


def test_what_a_record_can_determine_is_given_over_the_value_and_a_limit_as_a_bound():
    limit = Expectation(
        "x rate limit", math.inf, 3.99, "rad/s", True, math.nan, 0.03, "add larger steps"
    )
    band = Expectation("x dead band", 0.16, math.radians(0.33), "rad", False, math.nan, 0.3, "")
    delay = Expectation("x/x delay", 0.0021, 0.018, "s", False, math.nan, 1e-3, "use stamps")
    rows = dict(InformationResult((limit, band, delay), ("a.csv",), ()).rows())
    assert rows["x dead band"] == "± 16 % of 0.33°"
    reached = "at least 3.99 rad/s (never reached in this record): add larger steps"
    assert rows["x rate limit"] == reached
    assert rows["x/x delay"] == "± 2.1 ms of 18 ms, not determined (± 1 ms is): use stamps"


def test_a_model_is_judged_on_a_recording_it_never_saw(capsys, made, tmp_path):
    """99 %: a reading error of 0.01° on some 2.5° of motion is 0.4 %."""
    found = told(
        capsys, "identify", str(made / "steps.rrd"), "--check", str(made / "multisine.rrd"),
        "--out", str(tmp_path / "m.json"),
    )  # fmt: skip
    assert min(found["checks"][str(made / "multisine.rrd")]) > 99.0


def test_a_check_by_what_was_fitted_is_named(capsys, table, tmp_path):
    """The file itself, a copy of it, and its readings in another file; not a run of its own."""
    copy, noted, other = (tmp_path / f"{n}.csv" for n in ("copy", "noted", "other"))
    copy.write_bytes(table.read_bytes())
    noted.write_text(f"# rig 7\n{table.read_text()}")
    rows = [line.split(",") for line in table.read_text().splitlines()]
    k = rows[0].index("pot")
    for row in rows[1:]:
        row[k] = f"{float(row[k]) + 1e-3:.6f}"
    other.write_text("\n".join(",".join(r) for r in rows))
    checks = [a for f in (table, copy, noted, other) for a in ("--check", str(f))]
    out = ("--out", str(tmp_path / "m.json"))
    found = told(capsys, "identify", str(table), *COLUMNS, *checks, *out)["warnings"]
    named = [w.split(",")[0] for w in found if "which was fitted" in w]
    assert named == [f"{table}: the same file"] + [
        f"{f}: the same readings as {table}" for f in (copy, noted)
    ]


def test_one_commanded_axis_is_said_and_can_stand_for_both(capsys, made, tmp_path):
    out = tmp_path / "m.json"
    source = str(made / "only_x.rrd")
    found = told(capsys, "identify", source, "--out", str(out))
    assert any("only x was commanded" in w for w in found["warnings"])
    assert TransferFunctionModel.read(out).inputs == ("x",)
    line = ("identify", source, "--out", str(out), "--force")
    code, shown, _ = run(capsys, *line)
    assert code == 0
    assert "twin fly" not in shown
    _, shown, _ = run(capsys, *line, "--both")
    model = TransferFunctionModel.read(out)
    assert model.inputs == ("x", "y")
    assert model.channels[0][0] == model.channels[1][1]
    offered = next(text for text in shown.splitlines() if "twin fly" in text)
    flown = ("--duration-s", "0.1", "--out", str(tmp_path / "f.rrd"))
    assert run(capsys, *offered.split()[1:], *flown)[0] == 0


def test_no_flight_is_offered_of_a_model_of_one_measured_axis(capsys, table, tmp_path):
    """It has both commands as inputs, so that it looks like a model of both axes."""
    head, *lines = table.read_text().splitlines()
    both = tmp_path / "both.csv"
    moved = [line.split(",")[1] for line in lines]
    second = [*moved[150:], *moved[:150]]
    rows = [f"{line},{u}" for line, u in zip(lines, second, strict=True)]
    both.write_text("\n".join([f"{head},v", *rows]))
    _, shown, _ = run(
        capsys, "identify", str(both), "--time", "t", "--input", "u,v", "--angle", "pot",
        "--angle-unit", "deg", "--out", str(tmp_path / "m.json"),
    )  # fmt: skip
    assert "only x was measured" in shown
    assert "twin fly" not in shown


@pytest.mark.thorough
def test_identify_and_report_give_the_margins_of_the_attitude_loop_with_the_model(
    capsys, made, tmp_path
):
    """Those of the shipped model in docs/control.md; the identified one is within 1 %."""
    model, page = str(tmp_path / "model.json"), tmp_path / "page.html"
    found = told(capsys, "identify", str(made / "steps.rrd"), "--out", model)
    rows = {(m["axis"], m["loop"]): m for m in found["margins"]}
    assert set(rows) == {(a, at) for a in "xy" for at in ("ignition", "burnout")}
    x = rows["x", "ignition"]
    assert x["crossover"] == pytest.approx(9.2, rel=0.015)
    assert math.degrees(x["phase"]) == pytest.approx(43.4, abs=0.5)
    assert 20.0 * math.log10(x["gain"]) == pytest.approx(9.5, abs=0.1)
    assert x["delay"] == pytest.approx(x["phase"] / x["crossover"])
    assert rows["x", "burnout"]["gain"] < x["gain"]  # the emptied vehicle turns more easily
    file = str(made / "steps.rrd")
    numbers = told(capsys, "report", file, "--model", model, "--out", str(page))
    assert numbers["margins"]["model"] == found["margins"]
    assert "+9.5 dB" in page.read_text(encoding="utf-8")
    assert told(capsys, "report", file, "--out", str(page))["margins"] == {}


@pytest.fixture(scope="module")
def measured():
    """A CSV of 20 rad/s, damping 0.6, 15 ms: steps in degrees, from python-control."""
    import control

    t = np.arange(0.0, 6.0, 0.005)
    levels = np.random.default_rng(1).choice([-8.0, -3.0, 2.0, 6.0], 12)
    levels[0] = 0.0  # at rest
    u = levels[(t // 0.5).astype(int)]
    system = control.tf([400.0], [1.0, 24.0, 400.0])
    late = np.concatenate([np.zeros(3), u[:-3]])
    fine = np.repeat(late, 5)
    y = control.forced_response(system, np.arange(len(fine)) * 1e-3, fine).outputs[::5]
    y += np.random.default_rng(2).normal(0.0, 0.05, len(t))
    rows = (f"{a:.6f},{b},{c:.5f}" for a, b, c in zip(t, u, y, strict=True))
    return "t,u,pot\n" + "\n".join(rows) + "\n"


@pytest.fixture
def table(tmp_path, measured):
    path = tmp_path / "run.csv"
    path.write_text(measured)
    return path


def test_anybodys_table_gives_the_model_that_made_it(capsys, table, tmp_path):
    """Tolerances are three of the intervals; python-control interpolates its input over 1 ms."""
    out = tmp_path / "m.json"
    found = told(
        capsys, "identify", str(table), "--time", "t", "--input", "u", "--angle", "pot",
        "--angle-unit", "deg", "--out", str(out),
    )  # fmt: skip
    values = {e["name"]: e["value"] for e in found["estimates"]}
    assert values["x/x natural frequency"] == pytest.approx(20.0, rel=0.01)
    assert values["x/x damping"] == pytest.approx(0.6, rel=0.015)
    # the command is only sampled: the delay is known to 5 ms, up to one period too short
    assert values["x/x delay"] == pytest.approx(0.015, abs=1.5e-3)
    assert found["fit"] > 95.0


COLUMNS = ("--time", "t", "--input", "u", "--angle", "pot", "--angle-unit", "deg")


def test_whose_loop_logs_its_own_commands_says_so_and_gets_the_narrow_interval(
    capsys, table, tmp_path
):
    def delay(*stamps: str) -> tuple[dict, list[str]]:
        found = told(
            capsys, "identify", str(table), *COLUMNS, *stamps, "--out", str(tmp_path / "m.json")
        )
        said = [w for w in found["warnings"] if "--commands" in w]
        return next(e for e in found["estimates"] if e["name"] == "x/x delay"), said

    open_, said = delay()
    assert open_["std"] == pytest.approx(0.005 / math.sqrt(3.0), rel=0.05)
    assert len(said) == 1
    exact, said = delay("--input-stamps", "exact")
    assert exact["value"] == pytest.approx(open_["value"], abs=1e-5)
    assert exact["std"] < 5e-4
    assert said == []
    sampled, said = delay("--input-stamps", "sampled")
    assert sampled["value"] == pytest.approx(exact["value"] + 0.0025, abs=1e-4)
    assert len(said) == 1


def test_a_list_of_changes_needs_the_command_before_it(capsys, table, tmp_path):
    lines = [line.split(",") for line in table.read_text().splitlines()[1:]]
    changes = [a[:2] for a, b in zip(lines[1:], lines, strict=False) if a[1] != b[1]]
    commands = tmp_path / "changes.csv"
    commands.write_text("t,u\n" + "\n".join(",".join(c) for c in changes))
    found = told(
        capsys, "identify", str(table), *COLUMNS, "--commands", str(commands), "--before", "0",
        "--out", str(tmp_path / "m.json"),
    )  # fmt: skip
    values = {e["name"]: e for e in found["estimates"]}
    assert values["x/x natural frequency"]["value"] == pytest.approx(20.0, rel=0.01)
    assert values["x/x delay"]["std"] < 5e-4


def test_a_check_says_where_there_is_nothing_to_check(capsys, made, table, tmp_path):
    rows = [line.split(",") for line in table.read_text().splitlines()]
    (tmp_path / "still.csv").write_text("\n".join(",".join([*r[:2], r[2] if r[2] == "pot" else
                                                           "1.5"]) for r in rows))  # fmt: skip
    out = ("--out", str(tmp_path / "m.json"), "--force")
    still = str(tmp_path / "still.csv")
    found = told(capsys, "identify", str(table), *COLUMNS, "--check", still, *out)
    assert found["checks"][still] == [None]
    assert any(w.startswith(still) and "are constant" in w for w in found["warnings"])
    # one axis of two that the model has: that one is predicted
    one = str(made / "only_x.rrd")
    x, y = told(capsys, "identify", str(made / "steps.rrd"), "--check", one, *out)["checks"][one]
    assert x > 99.0
    assert y is None
    code, text, _ = run(capsys, "identify", str(made / "steps.rrd"), "--check", one, *out)
    assert code == 0
    assert f"x {x:.2f} %" in text


@pytest.mark.thorough
def test_order_selection_searches_the_delays_it_is_told_to(capsys, tmp_path):
    """150 ms: beyond the 100 ms that are searched without a word."""
    t = np.arange(0.0, 4.0, 0.025)
    u = np.where((t // 1.0).astype(int) % 2, [[4.0], [2.0]], 0.0)[(t // 2.0).astype(int) % 2,
                                                                  np.arange(len(t))]  # fmt: skip
    y, late, out = 0.0, np.concatenate([np.zeros(6), u[:-6]]), []
    for command in late:
        out.append(y)
        y += (command - y) * (1.0 - math.exp(-0.025 / 0.06))
    pot = out + np.random.default_rng(0).normal(0.0, 0.02, len(t))
    gyro = np.gradient(pot, t)
    np.savetxt(
        tmp_path / "run.csv", np.column_stack([t, u, pot, gyro]), delimiter=",",
        header="t,u,pot,gyro", comments="",
    )  # fmt: skip
    file, model = str(tmp_path / "run.csv"), str(tmp_path / "m.json")
    for extra in (("--max-delay-ms", "300"), ("--delay", "0.15")):
        found = told(capsys, "identify", file, *COLUMNS, "--select-order", *extra, "--out", model)
        assert max(o["fit"] for o in found["orders"]) > 95.0
    code, text, _ = run(
        capsys, "identify", file, *COLUMNS, "--rate", "gyro", "--poles", "1", "--delay", "0.15",
        "--out", model, "--force",
    )  # fmt: skip
    assert code == 0
    fits = next(line for line in text.splitlines() if line.startswith("x fit"))
    assert "angle" in fits
    assert "rate" in fits
    assert "step to the power" in text


# what bends a servo's answer: then a transfer function is all there is to know of it
STRAIGHT = ("gimbal_backlash=0", "gimbal_servo_dead_band=0", "gimbal_servo_slew=0")


@pytest.mark.parametrize(
    "rig", ["emulator", pytest.param("firmware", marks=[needs_avr, pytest.mark.slow])]
)
def test_a_model_from_pulses_predicts_another_multisine_of_a_linear_rig(capsys, tmp_path, rig):
    """97 % is the issue's figure; from commands even a perfectly linear gimbal gives 96.8 %, since
    a mean wait for the pulse frame is not the wait of each command.
    """
    from twin.config import Step
    from twin.experiments.step import step

    for name, seed in (("fitted", 0), ("other", 7)):
        step(
            Step(
                gimbal=rig, signal="multisine", amplitude_deg=3.0, band_hz=(1.0, 8.0), axis="x",
                repeats=2, hold_s=0.2, set=STRAIGHT, seed=seed, out=tmp_path / f"{name}.rrd",
            )
        )  # fmt: skip
    found = told(
        capsys, "identify", str(tmp_path / "fitted.rrd"), "--from-pulses",
        "--check", str(tmp_path / "other.rrd"), "--out", str(tmp_path / "m.json"),
    )  # fmt: skip
    assert min(found["checks"][str(tmp_path / "other.rrd")]) >= 97.0
    assert any("pulse frame" in w for w in found["warnings"])
    assert TransferFunctionModel.read(tmp_path / "m.json").source["input"] == "pulses"


MISTAKES = [
    ("identify", "needs a recording"),
    ("identify missing.rrd", "missing.rrd"),
    ("identify text.rrd", "not a Rerun recording"),
    ("identify run.csv", "--time t"),
    ("identify run.csv --time t --input u --angle pt", "did you mean 'pot'"),
    ("identify run.csv --time t --input t --angle pot", "column 't' is named twice"),
    ("identify run.xls --time t --input u --angle pot", "run.xls: '.xls' is no table; .csv"),
    ("identify run.csv --time t --input u --angle pot --angle-unit grad", "no unit 'grad'"),
    (
        "identify run.csv --time t --input u --angle pot --input-unit deg",
        "axis in degrees and command in radians",
    ),
    ("identify run.csv --time t --input u --angle pot --poles 9", "9 poles"),
    ("identify run.csv --time t --input u --angle pot --zeros 2", "2 zeros"),
    ("identify run.csv --time t --input u --angle pot --delay soon", "'free', or seconds"),
    ("identify run.csv --time t --input u --angle pot --out m.txt", ".json"),
    ("identify run.csv --time t --input u --angle pot --out /proc/a/m.json", "cannot write"),
    ("identify constant.csv --time t --input u --angle pot", "never changes"),
    ("identify back.csv --time t --input u --angle pot", "stamps must increase"),
    ("identify steps.rrd --angle-unit deg", "--angle-unit is only for tables"),
    ("identify steps.rrd --angle gimbal/measured", "gimbal/measured"),
    ("identify steps.rrd --from-pulses", "no sensors/pulse"),
    ("identify run.csv --time t --input u --angle pot --max-delay-ms -5", "--max-delay-ms -5"),
    ("identify run.csv --time t --input u --angle pot --max-delay-ms 0", "--max-delay-ms 0"),
    ("identify run.csv --time t --input u --angle pot --max-delay-ms 1e6", "to 60000 ms"),
    ("identify run.csv --time t --input u --angle pot --gyro-delay-ms 5", "needs --rate (the gyro"),
    ("identify run.csv --time t --input u --angle pot --mechanism m.xml", "needs --linkage"),
    ("identify run.csv --time t --input u --angle pot --structure speed", "needs --servo"),
    (
        "identify run.csv --time t --input u --angle pot --set gimbal_holder.mass=0.05",
        "--set gimbal_holder.mass=0.05: needs --linkage or --live",
    ),
    (
        "identify run.csv --time t --input u --angle pot --check-only --servo --structure clipped",
        "--structure clipped: --check-only searches bounds in the structure speed alone",
    ),
    ("identify run.csv --time t --input u --angle pot --before some", "--before some"),
    ("identify run.csv --time t --input u --angle pot --time-scale 0", "must be from 1e-12"),
    ("identify ms.csv --time t --input u --angle pot", "--time-scale 0.001"),
    ("identify run.csv --time t --input u --angle pot --commands late.csv", "--before 0"),
    ("identify run.csv --time t --input u --angle pot --commands early.csv", "one clock"),
    (
        "identify run.csv --time t --input u --angle pot --commands early.csv --input-stamps exact",
        "not with --commands",
    ),
    ("identify steps.rrd --before 0", "--before is only for tables"),
    ("identify run.csv --from-pulses --time t --input u --angle pot", "is a table"),
    ("identify --linkage steps.rrd multisine.rrd", "takes one recording"),
    ("identify --linkage run.csv --time t --input u --angle pot", "x and y"),
    ("identify --linkage steps.rrd --parameters gimbal_servo_gian", "gimbal_servo_gain"),
    ("report", "name one or more"),
    ("report run.csv", "--time t"),
    ("report run.csv --time t --input u", "angle"),
    ("report steps.rrd --angle-unit deg", "--angle-unit is only for tables"),
    ("report steps.rrd --out page.txt", ".html"),
    ("report steps.rrd --model missing.json", "missing.json"),
    ("compare", "0 recordings"),
    ("compare steps.rrd", "holds no measured angles"),
    ("compare run.csv", "a table with one motion"),
    ("compare run.csv steps.rrd", "--time t"),
    ("compare steps.rrd linkage.rrd --angle pot", "--angle is only for tables"),
    ("compare steps.rrd missing.rrd", "missing.rrd"),
    ("compare steps.rrd linkage.rrd --out c.txt", ".rrd"),
    ("compare steps.rrd linkage.rrd --fail-below nan", "finite"),
]


@pytest.mark.parametrize(("command", "says"), MISTAKES, ids=[c for c, _ in MISTAKES])
def test_a_mistake_is_one_line_with_exit_2_and_leaves_nothing(
    capsys, made, table, tmp_path, monkeypatch, command, says
):
    monkeypatch.chdir(tmp_path)
    for file in made.glob("*.rrd"):
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "text.rrd").write_text("text")
    (tmp_path / "run.xls").write_text("text")
    lines = table.read_text().splitlines()
    still = [",".join([*line.split(",")[::2][:1], "1", line.split(",")[2]]) for line in lines[1:]]
    (tmp_path / "constant.csv").write_text("\n".join([lines[0], *still]))
    cells = [line.split(",") for line in lines[1:]]
    for name, scale, shift in (("ms", 1e3, 0.0), ("late", 1.0, 0.5), ("early", 1.0, -1000.0)):
        moved = [",".join([f"{float(c[0]) * scale + shift}", *c[1:]]) for c in cells]
        (tmp_path / f"{name}.csv").write_text("\n".join([lines[0], *moved]))
    (tmp_path / "back.csv").write_text("\n".join([lines[0], *lines[200:400], *lines[1:200]]))
    before = {p.name for p in tmp_path.iterdir()}
    code, out, err = run(capsys, *command.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert {p.name for p in tmp_path.iterdir() if p.name != "runs"} == before


def test_a_comparison_reports_the_delay_between_two_motions_and_checks_the_fit(
    capsys, made, tmp_path
):
    """One model with 7 ms more delay; 0.2 ms: rows come every 2 ms and are interpolated."""
    from twin.config import Step
    from twin.experiments.step import step

    shipped = TransferFunctionModel.read(REFERENCE_GIMBAL)
    late = replace(
        shipped,
        channels=tuple(
            tuple(replace(c, delay=0.0 if c.zero else c.delay + 0.007) for c in row)
            for row in shipped.channels
        ),
    )
    late.write(tmp_path / "late.json")
    step(
        Step(
            gimbal="transfer-function", model=tmp_path / "late.json", repeats=1, hold_s=0.5,
            out=tmp_path / "late.rrd",
        )
    )  # fmt: skip
    files = [str(made / "steps.rrd"), str(tmp_path / "late.rrd")]
    out = tmp_path / "both.rrd"
    found = told(capsys, "compare", *files, "--out", str(out))
    for axis in found["axes"]:
        assert axis["delay"] == pytest.approx(0.007, abs=2e-4)
        assert axis["as_is"]["fit"] < axis["aligned"]["fit"]
        assert axis["aligned"]["fit"] > 99.0
    rows = run(capsys, "compare", *reversed(files), "--out", str(out), "--force")[1].splitlines()
    assert next(r for r in rows if r.startswith("delay")).count("ms ahead of the reference") == 2
    merged = recording.read(out)
    a, b, d = (merged[f"gimbal/{n}"].values for n in ("reference", "other", "difference"))
    assert d == pytest.approx(b - a, abs=1e-12)
    assert np.degrees(np.abs(d).max()) > 0.5
    assert [run(capsys, "compare", *files, "--out", str(out), "--fail-below", f)[0] for f in
            ("50", "99")] == [0, 1]  # fmt: skip


@pytest.mark.thorough
def test_a_limit_is_held_against_the_axes_that_were_commanded(capsys, made, tmp_path):
    """A rig moved about x, whose y moves by coupling and noise, and a model that has neither."""
    files = [str(tmp_path / "rig.rrd"), str(made / "only_x.rrd")]
    line = f"--gimbal emulator --axis x --repeats 1 --hold-s 0.5 --out {files[0]}"
    told(capsys, "step", *line.split())
    out = ("--out", str(tmp_path / "c.rrd"), "--fail-below", "70")
    found = told(capsys, "compare", *files, *out)
    x, y = found["axes"]
    assert found["passed"]
    assert found["fit"] == x["as_is"]["fit"] > 70.0 > y["as_is"]["fit"]
    assert found["uncounted"] == {"y": "not commanded"}
    assert (y["commanded"], y["delay"]) == (False, None)
    code, text, _ = run(capsys, "compare", *files, *out)
    assert code == 0
    assert "y: not commanded" in text


def test_a_difference_is_not_drawn_across_a_hole(capsys, made, tmp_path, monkeypatch):
    """A second of the other run is missing."""
    file, out = str(made / "steps.rrd"), tmp_path / "c.rrd"
    whole = load(file)
    kept = (whole.angles.time < 1.0) | (whole.angles.time > 2.0)
    runs = iter([whole, replace(whole, angle=whole.angles.rows(kept))])
    monkeypatch.setattr("twin.evaluation.compare.seen", lambda *_: list(runs))
    found = told(capsys, "compare", file, file, "--out", str(out))
    assert found["fit"] == pytest.approx(100.0)
    assert found["axes"][0]["left_out"] == pytest.approx(1.0 - kept.mean(), abs=1e-6)
    apart = recording.read(out)["gimbal/difference"]
    inside = (apart.time > 1.0) & (apart.time < 2.0)
    assert not np.isfinite(apart.values[inside]).any()
    assert np.isfinite(apart.values[~inside]).all()


def test_a_run_equals_itself_and_one_recording_may_hold_both_motions(capsys, made, tmp_path):
    file = str(made / "steps.rrd")
    found = told(capsys, "compare", file, file, "--out", str(tmp_path / "c.rrd"))
    assert found["fit"] == 100.0
    assert found["shift_s"] == 0.0
    code, text, _ = run(capsys, "compare", file, file, "--out", str(tmp_path / "c.rrd"))
    assert code == 0
    assert text.count("\n") < 24  # one screen


def test_a_report_is_one_page_with_the_numbers_that_json_prints(capsys, made, tmp_path):
    out = tmp_path / "page.html"
    found = told(
        capsys, "report", str(made / "steps.rrd"), str(made / "linkage.rrd"),
        "--model", str(REFERENCE_GIMBAL), "--out", str(out),
    )  # fmt: skip
    assert "<html" in out.read_text()[:200].lower()
    assert found["page"] == str(out)


def test_anybodys_tables_are_compared_and_reported_on_like_recordings(
    capsys, made, table, tmp_path
):
    """One table is the other with 20 ms more delay; a command file has few rows, and a model
    answers it all the same.
    """
    rows = [line.split(",") for line in table.read_text().splitlines()]
    late = [[a[0], a[1], b[2]] for a, b in zip(rows[5:], rows[1:], strict=False)]
    (tmp_path / "late.csv").write_text("t,u,pot\n" + "\n".join(",".join(r) for r in late))
    changes = [a[:2] for a, b in zip(rows[2:], rows[1:], strict=False) if a[1] != b[1]]
    (tmp_path / "changes.csv").write_text("t,u\n" + "\n".join(",".join(c) for c in changes))
    files = [str(table), str(tmp_path / "late.csv")]
    out = ("--out", str(tmp_path / "c.rrd"))
    (axis,) = told(capsys, "compare", *files, *COLUMNS, *out)["axes"]
    assert axis["delay"] == pytest.approx(0.02, abs=5e-4)
    assert axis["aligned"]["fit"] > 97.0
    assert "gimbal/difference" in recording.read(tmp_path / "c.rrd").series
    mixed = told(capsys, "compare", files[0], str(made / "only_x.rrd"), *COLUMNS, *out)
    assert mixed["warnings"] == []  # nothing is known of what a table was asked for
    stamps = (*COLUMNS, "--commands", str(tmp_path / "changes.csv"), "--before", "0")
    model = str(tmp_path / "m.json")
    told(capsys, "identify", files[0], *stamps, "--out", model)
    page = told(
        capsys, "report", files[0], *stamps, "--model", model, "--out", str(tmp_path / "p.html")
    )
    assert [r["label"] for r in page["runs"]] == ["run.csv", "m"]
    assert page["runs"][1]["samples"] > 1000
    assert page["comparisons"][0]["axes"][0]["as_is"]["fit"] > 95.0


@pytest.fixture
def few_places(monkeypatch):
    """Half as many places around a linkage's minimum: enough for two or three parameters."""
    monkeypatch.setattr("analysis.linkage.search._PLACES", 16)


@pytest.mark.thorough
def test_a_bench_with_other_parameters_is_found_again_and_its_file_loads(
    capsys, few_places, tmp_path
):
    """A weaker motor with a looser gear. 2 %: the dead band's and friction's rough loss, not noise.

    Two parameters on one axis keep this short; docs/identification.md tells what five come to.
    """
    changed = {"gimbal_servo_motor_constant": 0.33, "gimbal_backlash": 0.012}
    file, out = tmp_path / "bench.rrd", tmp_path / "set.json"
    sets = [a for name, value in changed.items() for a in ("--set", f"{name}={value}")]
    code, _, _ = run(
        capsys, "step", "--signal", "prbs", "--axis", "x", "--repeats", "1", "--hold-s", "0.3",
        "--band-hz", "2", "8", "--out", str(file), *sets,
    )  # fmt: skip
    assert code == 0
    found = told(
        capsys, "identify", "--linkage", str(file), "--out", str(out), "--parameters", *changed
    )
    for name, value in changed.items():
        assert found["overrides"][name] == pytest.approx(value, rel=0.02)
    assert found["held_out"][0] > 98.5 > found["start"][0]
    again = tmp_path / "again.rrd"
    code, _, _ = run(
        capsys, "step", "--signal", "prbs", "--axis", "x", "--repeats", "1", "--hold-s", "0.3",
        "--band-hz", "2", "8", "--out", str(again), "--set-from", str(out),
    )  # fmt: skip
    assert code == 0
    compared = told(capsys, "compare", str(file), str(again), "--out", str(tmp_path / "c.rrd"))
    assert compared["axes"][0]["as_is"]["fit"] > 99.0


@pytest.mark.thorough
def test_the_linkage_behind_a_rig_is_found_within_its_intervals(capsys, few_places, tmp_path):
    """By pulses and raw potentiometers of an emulated Nano. 3.3 deviations: 99.9 %, since there are
    three values; ten rigs of five parameters: tests/benchmarks/linkage.py.
    """
    changed = {"gimbal_servo_motor_constant": 0.34, "gimbal_servo_gain": 2.1}
    file, out = tmp_path / "rig.rrd", tmp_path / "set.json"
    sets = [a for name, value in changed.items() for a in ("--set", f"{name}={value}")]
    code, _, _ = run(
        capsys, "step", "--gimbal", "emulator", "--signal", "multisine", "--axis", "x",
        "--amplitude-deg", "6", "--repeats", "1", "--hold-s", "0.4", "--band-hz", "1", "8",
        "--out", str(file), *sets,
    )  # fmt: skip
    assert code == 0
    found = told(
        capsys, "identify", "--linkage", str(file), "--out", str(out),
        "--parameters", *changed, "delay",
    )  # fmt: skip
    for e in found["estimates"]:
        assert abs(e["value"] - {**changed, "delay": 0.0}[e["name"]]) < 3.3 * e["std"]
        assert e["std"] < 0.015 * e["value"] or e["name"] == "delay"


def test_a_table_to_check_by_has_commands_of_its_own(capsys, tmp_path):
    """Two records of one closed form, with other steps; their commands stand in other tables."""
    time = np.arange(0.0, 6.0, 0.01)
    for name, seed in (("a", 0), ("b", 1)):
        rng = np.random.default_rng(seed)
        at = np.concatenate([[-1.0], 0.4 + 0.5 * np.arange(10) + rng.uniform(-0.1, 0.1, 10)])
        level = np.concatenate([[0.0], rng.permutation(np.linspace(-6.0, 6.0, 10))])
        late = np.clip(time[:, None] - at - 0.02, 0.0, None)
        answer = 1.0 - np.exp(-30.0 * late) * (1.0 + 30.0 * late)
        angle = answer @ np.diff(level, prepend=0.0) + rng.normal(0.0, 0.02, len(time))
        log = tmp_path / f"{name}.csv"
        log.write_text("t,p\n" + "".join(f"{t},{p}\n" for t, p in zip(time, angle, strict=True)))
        sent = tmp_path / f"{name}-sent.csv"
        sent.write_text("t,u\n" + "".join(f"{t},{u}\n" for t, u in zip(at, level, strict=True)))
    given = f"identify {tmp_path}/a.csv --time t --input u --angle p --angle-unit deg"
    given += f" --commands {tmp_path}/a-sent.csv --check {tmp_path}/b.csv"
    status, _, err = run(capsys, *f"{given} --out {tmp_path}/m.json".split())
    assert status == 2
    assert "--check-commands" in err
    given += f" --check-commands {tmp_path}/b-sent.csv --json"
    status, out, _ = run(capsys, *f"{given} --out {tmp_path}/n.json".split())
    assert status == 0
    ((fit,),) = json.loads(out)["checks"].values()
    assert fit > 98.0
