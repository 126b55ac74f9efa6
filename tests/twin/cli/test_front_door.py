"""The Python functions are the command line's verbs: same settings, recordings and numbers."""

import inspect
import json
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import twin
from analysis.schema import AnalysisError
from hardware.calibration import nominal
from hardware.calibration import write as write_calibration
from tests.twin.cli.test_cli import run as command
from tests.twin.experiments.test_fly import compared
from twin.cli import arguments
from twin.config.base import hints
from twin.config.result import Result
from twin.config.verbs import BY_NAME, VERBS
from twin.errors import DivergenceError, TwinError
from twin.plant.model.model import REFERENCE_GIMBAL

ROOT = Path(__file__).resolve().parents[3]
HEAVY = {"analysis", "hardware", "mujoco", "numba", "numpy", "pyarrow", "rerun", "scipy", "tyro"}
NAMES = [verb.name for verb in VERBS]


def imported(code: str) -> set[str]:
    """Top-level names of the modules that a fresh interpreter has imported after `code`."""
    code += "\nimport sys; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_imports_nothing_heavy():
    assert not imported("import twin") & HEAVY


def test_the_help_of_a_function_needs_no_simulator():
    assert not imported("import twin; twin.fly.__doc__, dir(twin)") & {"mujoco", "numba", "rerun"}


def test_a_function_records_what_the_command_records(capsys, tmp_path):
    gusts = ("wind_speed=8", "wind_turbulence=0.2")
    by_function, by_command = tmp_path / "f.rrd", tmp_path / "c.rrd"
    settings = {"gimbal": "transfer-function", "seed": 3, "duration_s": 3.0}
    twin.fly(**settings, set={"wind_speed": 8.0, "wind_turbulence": 0.2}, out=by_function)
    line = "fly --gimbal transfer-function --seed 3 --duration-s 3"
    flags = [word for gust in gusts for word in ("--set", gust)]
    code, _, _ = command(capsys, *line.split(), *flags, "--out", str(by_command))
    assert code == 0
    assert compared(by_function, by_command) == 0
    twin.fly(**settings | {"seed": 4}, set=gusts, out=by_function)
    assert compared(by_function, by_command) != 0


@pytest.mark.parametrize("name", NAMES)
def test_keywords_are_the_flags_of_the_command(capsys, name):
    _, shown, _ = command(capsys, name, "--help")
    flags = {flag.replace("-", "_") for flag in re.findall(r"^. --([a-z-]+)", shown, re.MULTILINE)}
    parameters = inspect.signature(getattr(twin, name)).parameters.values()
    keywords = {p.name.rstrip("_") for p in parameters if p.kind is p.KEYWORD_ONLY}
    assert keywords == flags - {"json"}


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_documented(name):
    function = getattr(twin, name)
    for parameter in inspect.signature(function).parameters:
        assert re.search(rf"^{parameter} : \S", function.__doc__, re.MULTILINE)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: twin.fly(programe="step"), "'programe'; did you mean programme"),
        (lambda: twin.fly(sed=3), "seed"),
        (lambda: twin.step(controller=object()), "unknown setting 'controller'"),
        (lambda: twin.fly(xyzzy=3), "valid: .*gimbal"),
        (lambda: twin.fly("flight.rrd"), "keyword arguments only"),
        (lambda: twin.fly(seed="three"), "--seed three: must be"),
        (lambda: twin.fly(dt=1.0), "--dt 1"),
        (lambda: twin.fly(programme="loop"), "must be one of hold, step, doublet"),
        (lambda: twin.fly(set={"air_axial_darg": 1.0}), "air_axial_drag"),
        (lambda: arguments.parse(["fly", "--motor", ""]), "--motor '': must be a path"),
        (lambda: arguments.parse(["fly", "--motor="]), "--motor '': must be a path"),
        (lambda: arguments.parse(["fly", "--out="]), "--out '': must be a path"),
        (lambda: arguments.parse(["replay", ""]), "'': must be a path"),
        (lambda: arguments.parse(["report", "a.rrd", ""]), "'': must be a path"),
        (lambda: arguments.parse(["mechanism", "check", ""]), "'': must be a path"),
        (lambda: twin.replay(), "needs recording"),
        (lambda: twin.replay("a.rrd", "b.rrd"), "one file, not 2"),
        (lambda: twin.identify(), "needs"),
        (lambda: twin.compare(), "needs"),
    ],
)
def test_a_mistake_raises_one_line(tmp_path, monkeypatch, call, says):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TwinError, match=says) as caught:
        call()
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'flie'"):
        _ = twin.flie
    assert {"fly", "read", "load", "TwinError"} <= set(dir(twin))


def test_the_errors_are_those_that_the_rooms_raise():
    assert twin.TwinError is TwinError
    assert twin.DivergenceError is DivergenceError
    assert twin.AnalysisError is AnalysisError


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """Results of a flight, its replay, a step test, and of what reads recordings."""
    folder = tmp_path_factory.mktemp("results")
    fly = twin.fly(duration_s=1.0, out=folder / "f.rrd")
    step = twin.step(repeats=2, hold_s=0.4, out=folder / "s.rrd")
    return {
        "fly": fly,
        "step": step,
        "replay": twin.replay(fly),
        "compare": twin.compare(step, step, out=folder / "c.rrd"),
        "identify": twin.identify(step, out=folder / "m.json"),
        "report": twin.report(step, out=folder / "p.html"),
    }


RESULTS = ("fly", "step", "replay", "compare", "identify", "report")


@pytest.mark.thorough
@pytest.mark.parametrize("verb", RESULTS)
def test_a_result_is_json_text_html_and_its_file(flights, verb):
    result = flights[verb]
    json.loads(json.dumps(result.as_dict(), allow_nan=False))
    page, rows = result._repr_html_(), result.rows()
    assert page.startswith("<table>")
    assert page.count("<tr>") == len(rows) == len(result.text().splitlines())
    assert Path(result).is_file()
    assert result.passed
    with pytest.raises(AttributeError):  # frozen
        result.passed = False


def test_a_result_is_escaped_in_html():
    class Odd(Result):
        def rows(self):
            return [("<b>", "a & b\nc")]

    assert "&lt;b&gt;" in Odd()._repr_html_()
    assert "a &amp; b" in Odd()._repr_html_()


def test_a_result_without_a_file_is_not_a_path():
    class Bare(Result):
        pass

    with pytest.raises(TypeError, match="Bare"):
        os.fspath(Bare())


@pytest.mark.parametrize(
    "verb", [v for v in VERBS if v.name not in ("rig", "view")], ids=lambda v: v.name
)
def test_every_verb_returns_a_result_with_rows_and_numbers(verb):
    returned = inspect.signature(verb.function).return_annotation
    names = re.findall(r"[A-Za-z]*Result", inspect.formatannotation(returned))
    assert names
    # imported when asked for
    for late in ("evaluation.linkage", "evaluation.flights", "campaigns.results.result"):
        import_module(f"twin.{late}")
    everything = {c.__name__: c for c in _below(Result)}
    for name in names:
        assert everything[name].rows is not Result.rows
        assert everything[name].as_dict is not Result.as_dict


def _below(kind):
    for child in kind.__subclasses__():
        yield child
        yield from _below(child)


def test_a_result_says_what_the_command_prints(capsys, tmp_path):
    out = tmp_path / "s.rrd"
    _, shown, _ = command(capsys, "step", "--repeats", "1", "--hold-s", "0.3", "--out", str(out))
    text = twin.step(repeats=1, hold_s=0.3, out=out).text()

    def steady(printed):
        return [line for line in printed.splitlines() if not line.startswith("computing")]

    assert steady(text) == steady(shown)


def test_a_recording_is_read_by_path_or_result(flights):
    flight = flights["fly"]
    by_result, by_path = (twin.read(x)["vehicle/position"] for x in (flight, flight.recording))
    assert by_result.values.shape == (250, 3)
    assert (by_result.values == by_path.values).all()
    with pytest.raises(twin.AnalysisError, match=r"vehicle/position"):
        twin.read(flights["fly"])["vehicle/postion"]


def test_what_describes_a_gimbal_is_loaded_as_what_it_is(tmp_path, flights):
    assert twin.load(REFERENCE_GIMBAL).channels
    assert twin.load(flights["identify"]).inputs == ("x", "y")
    write_calibration(tmp_path / "c.json", nominal())
    loaded, written = twin.load(tmp_path / "c.json"), nominal()
    assert loaded.potentiometers == written.potentiometers
    # the file has µs and °, so the last digit of a gain may differ
    np.testing.assert_allclose(loaded.matrix, written.matrix, rtol=1e-14)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot read"),
        ("{", "not JSON"),
        ("[1]", "identified model or calibration"),
        ('{"schema": "something/1"}', "something/1"),
        ('{"schema": "tvc-twin/transfer-function/1"}', "channels"),
        ("[" * 100_000, "not JSON"),
        ("RRF2\0\1", "twin.read"),
    ],
)
def test_what_cannot_be_loaded_is_refused_in_one_line(tmp_path, content, says):
    file = tmp_path / "file.json"
    if content is not None:
        file.write_text(content)
    with pytest.raises((TwinError, AnalysisError), match=says) as caught:
        twin.load(file)
    assert "\n" not in str(caught.value)


def test_the_typed_signatures_are_those_of_the_settings():
    """Their types are compared by `make lint`."""
    stub = (ROOT / "twin" / "__init__.pyi").read_text()
    for name in NAMES:
        block = re.search(rf"def {name}\((.*?)\) ->", stub, re.DOTALL).group(1)
        written = set(re.findall(r"^    \*?(\w+):", block, re.MULTILINE))
        assert written == set(hints(BY_NAME[name].settings)) - {"json"}
