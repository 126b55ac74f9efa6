"""Printed numbers that are rounded to zero have no sign, whoever prints them."""

import json

import pytest

from analysis.plain import plain
from analysis.report import Section, render
from analysis.signs import unsigned_zeros
from twin.config.result import Result


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (f"delay {-0.3:.0f} ms", "delay 0 ms"),
        (f"{-0.004:.2f} ± 0.01°", "0.00 ± 0.01°"),
        (f"({-0.0:+.2g} dB, {-0.04:.1f}°)", "(0 dB, 0.0°)"),
        ("\u22120.0 to \u22120.1", "0.0 to \u22120.1"),
        ("a shift of -0.", "a shift of 0."),
        *((t, t) for t in ("-0.01", "-0.1 ms", "-05", "run-0.csv", "runs/-0", "1e-0", "--0",
                           "-0.rrd", "2026-01-00", "-0e3", "x-0", "-1.0", "0-0")),
    ],
)  # fmt: skip
def test_no_zero_is_negative_and_nothing_else_is_changed(text, shown):
    assert unsigned_zeros(text) == shown


class _Shown(Result):
    def rows(self):
        return [("late", f"{-0.2:.0f} ms")]


def test_tables_notebooks_pages_and_json_have_no_negative_zero(tmp_path):
    result = _Shown()
    page = render([Section("a", "A", text=[f"late {-0.2:.0f} ms"])], "A", tmp_path / "a.html")
    for text in (result.text(), result._repr_html_(), page.read_text()):
        assert "0 ms" in text
        assert "-0 ms" not in text
    assert (
        json.dumps(plain({"late": -0.0, "all": [-0.0, -1.0]}))
        == '{"late": 0.0, "all": [0.0, -1.0]}'
    )
