"""`make validate` measures what its page shows, and fails where a figure leaves its tolerance."""

import math

import pytest

from tests.conftest import ROOT
from tests.validation import __main__ as validation
from tests.validation.check import Check
from tests.validation.checks import CHECKS

NAMES = [c.name for c in CHECKS]


def test_every_row_of_the_page_has_its_command_and_every_command_its_row():
    page = validation.PAGE.read_text(encoding="utf-8")
    assert list(validation.rows_of(page)) == NAMES
    assert len(set(NAMES)) == len(NAMES)
    assert "-m tests.validation" in (ROOT / "Makefile").read_text()
    assert "fails" not in page


@pytest.mark.parametrize(
    ("figure", "code"), [(1.9, 0), (2.1, 1), (0.9, 1), (math.nan, 1), (math.inf, 1)]
)
def test_a_wrong_figure_is_told_and_the_exit_code_is_1(tmp_path, capsys, figure, code):
    page = tmp_path / "page.md"
    after = "| a question | `python -m tests.validation --only kept` | after |\n"
    page.write_text(f"before\n<!-- figures -->\nstale\n<!-- end of figures -->\n{after}")
    kept = Check("kept", "claim", "truth", lambda: 0.1, 1.0)
    wrong = Check("wrong", "claim", "truth", lambda: figure, 2.0, " %", low=1.0)
    gone = Check("gone", "claim", "truth", lambda: 0.1, 1.0)
    checks = [kept, wrong]
    assert validation.run([*checks, gone], page, [kept, gone]) == 0
    assert validation.run(checks, page, [wrong]) == code
    text = page.read_text()
    assert list(validation.rows_of(text)) == ["kept", "wrong"]
    assert text.startswith("before\n")
    assert text.endswith(after)
    assert "stale" not in text
    assert ("**fails**" in text) == ("FAILS" in capsys.readouterr().out) == bool(code)


def test_the_commands_measure_what_they_are_named_after(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text("<!-- figures -->\n<!-- end of figures -->\n")
    monkeypatch.setattr(validation, "PAGE", page)
    for name in ("stepinfo", "transfer-function", "density", "barrowman"):
        assert validation.main(["--only", name]) == 0
        assert f"--only {name}`" in page.read_text()
