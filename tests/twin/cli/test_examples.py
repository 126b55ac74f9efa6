"""The examples, the notebook and the code of docs/python.md run, and print what is true."""

import json
import re
import runpy
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))


@pytest.fixture
def example(tmp_path, monkeypatch, capsys):
    """Run an example into an empty folder; its output, and the names of what it wrote."""

    def run(name):
        elsewhere, folder = tmp_path / "elsewhere", tmp_path / "out"
        elsewhere.mkdir()
        folder.mkdir()
        monkeypatch.chdir(elsewhere)
        monkeypatch.setattr(sys, "argv", [name, str(folder)])
        runpy.run_path(str(DOCS / "examples" / f"{name}.py"), run_name="__main__")
        assert list(elsewhere.iterdir()) == []
        return capsys.readouterr().out, {p.name for p in folder.iterdir()}

    return run


def numbers(pattern, text):
    """The number of every place that a pattern with one group finds."""
    return [float(found) for found in re.findall(pattern, text)]


def test_there_are_six_examples_each_with_its_command_and_a_test():
    assert len(EXAMPLES) == 6
    here = Path(__file__).read_text()
    for file in EXAMPLES:
        assert f"python docs/examples/{file.name} [FOLDER]" in file.read_text()
        assert f'example("{file.stem}")' in here


@pytest.mark.thorough
def test_more_wind_from_behind_carries_the_flight_further_and_lower(example):
    shown, written = example("sweep")
    heights = numbers(r"([\d.]+) m +[\d.]+ m +[\d.]+ °", shown)
    ranges = numbers(r"[\d.]+ m +([\d.]+) m +[\d.]+ °", shown)
    assert len(heights) == 4
    assert heights == sorted(heights, reverse=True)
    assert ranges == sorted(ranges)
    assert {"sweep.html", "wind_0.rrd", "wind_12.rrd"} <= written


@pytest.mark.thorough
def test_a_csv_becomes_a_model_that_flies_like_the_shipped_one(example):
    shown, written = example("csv_to_flight")
    assert numbers(r"x/x gain +([\d.]+)", shown) == [pytest.approx(1.06, abs=0.02)]
    assert numbers(r"([\d.]+) m apart", shown)[0] < 1.0
    assert {"measured.csv", "model.json", "own_model.rrd"} <= written


@pytest.mark.thorough
def test_a_rig_and_its_model_agree_in_a_report(example):
    shown, written = example("rig_against_model")
    fits = numbers(r"fit ([\d.]+) %", shown)
    assert len(fits) == 2
    assert min(fits) > 80.0  # the rig's backlash and dead band are not in the model
    assert "report.html" in written


@pytest.mark.thorough
def test_the_own_controller_flies_like_the_built_in_one(example):
    shown, written = example("own_controller")
    position, command = numbers(r"at most (\S+) ", shown)
    assert position < 1e-6  # m, 1e-9 of the distance flown
    assert command < 1e-9
    assert written == {"built-in.rrd", "own.rrd"}


def test_a_recording_is_read_as_arrays_and_as_a_table(example):
    shown, written = example("read_recording")
    assert "command fly with seed 0" in shown
    assert "left the ramp" in shown
    assert numbers(r"gimbal/command +(\d+) rows", shown) == [1500.0]  # 6 s at 250 Hz
    assert {"run.rrd", "run.csv"} == written


def test_an_own_vehicle_flies_with_its_own_motor(example):
    shown, written = example("own_vehicle")
    masses = numbers(r"([\d.]+) kg", shown)
    # payload 0.1244 kg more, motor 0.0084 kg less; an identified model has no rods
    assert masses[1] - masses[0] == pytest.approx(0.116, abs=0.011)
    assert {"vehicle.xml", "airframe.xml", "own.eng"} <= written


@pytest.mark.thorough
def test_the_notebook_is_valid_and_runs(tmp_path, monkeypatch):
    notebook = json.loads((DOCS / "notebook.ipynb").read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in notebook["cells"]:
        code = {"execution_count": None, "outputs": []} if cell["cell_type"] == "code" else {}
        assert cell.keys() == {"cell_type", "id", "metadata", "source"} | code.keys()
        assert code.items() <= cell.items()  # committed without results
    monkeypatch.chdir(tmp_path)
    space = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), space)
    assert space["flight"]._repr_html_().startswith("<table>")
    assert space["compared"].comparison.fit > 80.0
    assert [p.name for p in tmp_path.iterdir()] == ["runs"]


@pytest.mark.thorough
def test_every_python_block_of_the_page_runs_in_order(tmp_path, monkeypatch):
    page = (DOCS / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 8
    monkeypatch.chdir(tmp_path)
    space = {"__name__": "page"}
    for k, block in enumerate(blocks):
        exec(compile(block, f"docs/python.md, block {k}", "exec"), space)
    assert [p.name for p in tmp_path.iterdir()] == ["runs"]
