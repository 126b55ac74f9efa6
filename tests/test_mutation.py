"""The list of planted breakages keeps pace with the code and its tests."""

from pathlib import Path

import pytest

from tests.mutation.breakages import PLANTED
from tests.mutation.rooms import ROOMS
from tests.mutation.survivors import REASONS

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("mutant", PLANTED, ids=lambda m: m.name)
def test_a_planted_breakage_changes_a_line_that_exists_and_names_tests_that_do(mutant):
    text = (ROOT / mutant.file).read_text()
    assert mutant.applied(text) != text
    for test in (t for t in mutant.tests if t.startswith("tests/")):
        assert (ROOT / test.partition("::")[0]).exists()


@pytest.mark.parametrize(("file", "code", "change"), REASONS)
def test_a_mutant_that_is_let_live_changes_a_line_that_exists(file, code, change):
    assert code in map(str.strip, (ROOT / file).read_text().splitlines())
    assert change.partition(" → ")[0] in code


def test_every_file_and_test_of_the_rooms_exists():
    for files, tests in ROOMS:
        for name in (*files, *tests):
            assert (ROOT / name).is_file(), name
