"""The mutation run counts a mutant as killed only by a test that is green without it."""

import pytest

from tests.mutation.__main__ import report
from tests.mutation.runner import Mutant, Verdict, outcome, verdicts

GREEN, RED = Mutant("a", "f.py", "1", "2", ("green",)), Mutant("b", "f.py", "1", "2", ("red",))


class Workers:
    """Every mutant turns its tests red; those named red are so without one."""

    def run(self, mutants):
        for m in mutants:
            code = int(bool(m.file) or m.tests == ("red",))
            yield Verdict(m, outcome(code, ""), 0.1, "")


def test_mutants_are_not_tried_with_tests_that_are_red_without_them(capsys):
    found = list(verdicts(Workers(), [GREEN, RED]))
    assert {v.mutant.name: v.outcome for v in found} == {"a": "killed", "b": "not tried"}
    assert not report(found, 1.0)
    assert "1 of 2 mutants killed" in capsys.readouterr().out
    assert report(list(verdicts(Workers(), [GREEN])), 1.0)


@pytest.mark.parametrize(
    ("code", "late", "expected"),
    [
        (0, False, "survived"),
        (1, False, "killed"),
        (-9, True, "timed out"),
        (5, False, "no test ran"),
    ],
)
def test_a_run_that_does_not_end_is_not_a_kill(capsys, code, late, expected):
    assert outcome(code, "", late=late) == expected
    report([Verdict(GREEN, outcome(code, "", late=late), 1.0, "")], 1.0)
    assert f"{int(late)} timed out" in capsys.readouterr().out
