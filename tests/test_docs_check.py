"""The check of the documentation reports what does not exist, and accepts what does."""

import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / ".ci"))

import docs_check  # noqa: E402
import source_names  # noqa: E402
import states  # noqa: E402

WRONG = {
    "[gone](gone.md)": "dead link gone.md",
    "[timing](timing.md#gone)": "link timing.md#gone: timing.md has no such heading",
    "`twin/loop/gone.py`": "no `twin/loop/gone.py`",
    "`twin/loop/*.gone`": "no `twin/loop/*.gone`",
    "`twin.loop.gone`": "no `twin.loop.gone`",
    "`twin.plant.plant.Plant.gone`": "no `twin.plant.plant.Plant.gone`",
    "`twin.gone`": "no `twin.gone`",
    "`sensors/gone`": "no `sensors/gone`",
    "`SuchAClassIs`": "no `SuchAClassIs`",
    "`--no-such-flag`": "no flag --no-such-flag",
    "`make gone`": "no make target gone",
    "`python -m twin.gone`": "no module twin.gone",
    "`twin gone`": "no verb 'gone'",
    "`twin fly --amplitude`": "'twin fly --amplitude': no --amplitude",
    "```python\nfrom twin.loop import gone\n```": "no twin.loop.gone",
    "```sh\ntwin fly --seed -1\n```": "'twin fly --seed -1': --seed -1: must be from 0 to",
    "```sh\ntwin gone\n```": "'twin gone': no verb 'gone'",
    "    twin fly --programme gone\n": "'twin fly --programme gone': --programme gone: must",
}
RIGHT = """# A heading
<!-- examples: twin weigh, sensors/none -->

[timing](timing.md#the-verdict) and [above](#a-heading), `twin/loop/loop.py`, `twin/loop/*.py`,
`twin.fly`, `twin.plant.plant.Plant(model).advance(1)`, `hardware.frames.GimbalState.sigma`,
`sensors/gyro`, `/gimbal/measured`, `GimbalCommand`, `--gimbal`, `make lint test`,
`python -m tests.benchmarks desk`, `RUN.rrd`, `twin weigh`, `sensors/none`, `mj_step`,
`twin fly --repeat 10`.

```python
import twin
from twin.plant.plant import Plant
```

```sh
twin identify --linkage rig.rrd --out set.json   # a flag without a value before a file
twin fly --programme point --off-axis-deg 15 0 --set wind_speed=6 --set-from set.json
```
"""


@pytest.fixture
def page(tmp_path):
    (tmp_path / "timing.md").write_text("# The verdict\n", encoding="utf-8")
    return tmp_path / "page.md"


@pytest.mark.parametrize("text", WRONG)
def test_what_does_not_exist_is_reported(page, text):
    page.write_text(f"text\n\n{text}\n", encoding="utf-8")
    found = list(docs_check.faults(page))
    assert len(found) == 1
    assert found[0].startswith(WRONG[text])


def test_what_exists_is_accepted(page):
    page.write_text(RIGHT, encoding="utf-8")
    assert list(docs_check.faults(page)) == []


def test_a_room_that_is_not_described_is_reported():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert docs_check.unlisted(page) == []
    assert docs_check.unlisted(page.replace("`twin/loop/`", "")) == ["twin/loop/"]


def test_names_that_can_be_imported_exist():
    from hardware.frames import SensorFrame
    from twin.plant.plant import Plant

    for cls in (Plant, SensorFrame):
        for name in (n for n in vars(cls) if not n.startswith("__")):
            assert source_names.exists(f"{cls.__module__}.{cls.__name__}.{name}")


def test_every_transition_has_one_entry():
    for module in states.tables():
        head, _, *body = [
            [cell.strip() for cell in line.strip("|\n").split("|")]
            for line in states.rows(states.table(module)).splitlines()
        ]
        entries = {
            (row[0], sign): new
            for row in body
            for sign, new in zip(head[1:], row[1:], strict=True)
            if new
        }
        assert entries == {(str(o), str(s)): str(n) for (o, s), n in states.table(module).items()}


def test_a_table_without_a_place_fails(monkeypatch, capsys):
    monkeypatch.setattr(states, "tables", lambda: {"twin.somewhere"})
    monkeypatch.setattr(sys, "argv", ["states.py", "--check"])
    assert states.main() == 1
    assert "twin.somewhere" in capsys.readouterr().out


def test_the_citation_has_the_version_of_the_package():
    package = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {package['version']}\n" in citation
    assert f"\nlicense: {package['license']}\n" in citation
