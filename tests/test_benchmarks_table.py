"""The table of benchmarks: ratios to limit and peer, misses, a section that cannot be measured."""

import json

import pytest

from tests.benchmarks import __main__ as bench
from tests.benchmarks.timing import Row, row


@pytest.mark.parametrize(
    ("line", "of_limit", "of_peer", "kept"),
    [
        (Row("a", 3.0, "s", most=4.0, peer=2.0), 0.75, 1.5, True),
        (Row("a", 5.0, "s", most=4.0), 1.25, None, False),
        (Row("a", 2.0, "×", least=4.0), 2.0, None, False),
        (Row("a", 8.0, "×", least=4.0, peer=1.0), 0.5, 8.0, True),
        (Row("a", 1.0, most=0), None, None, False),
        (Row("a", None), None, None, False),
        (row("a", "0.4 ms, 0.5 ms", "≤ 0.3", good=False), None, None, False),
    ],
)
def test_a_row_has_its_ratios_and_marks_what_exceeds_its_limit(line, of_limit, of_peer, kept):
    assert (line.of_limit, line.of_peer, line.kept) == (of_limit, of_peer, kept)
    assert str(line).startswith("! " if not kept else "  ")


def test_a_section_that_fails_is_a_row_and_the_others_are_measured(tmp_path, monkeypatch, capsys):
    def broken():
        yield Row("before", 1.0)
        raise OSError("no port")

    monkeypatch.setattr(bench, "SECTIONS", {"bad": broken, "good": lambda: [Row("after", 2.0)]})
    assert bench.main(["--json", str(tmp_path / "b.json")]) == 1
    assert "3 figures, 1 beyond their limit or not measured" in capsys.readouterr().out
    sections = json.loads((tmp_path / "b.json").read_text())["sections"]
    assert [r["claim"] for r in sections["bad"]] == ["before", "section bad"]
    assert sections["good"][0]["kept"]
    assert bench.main(["good"]) == 0
