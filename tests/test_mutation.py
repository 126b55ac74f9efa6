"""The list of planted breakages keeps pace with the code and its tests."""

from pathlib import Path

import pytest

from tests.mutation.breakages import PLANTED

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("mutant", PLANTED, ids=lambda m: m.name)
def test_a_planted_breakage_changes_a_line_that_exists_and_names_tests_that_do(mutant):
    text = (ROOT / mutant.file).read_text()
    assert mutant.applied(text) != text
    for test in (t for t in mutant.tests if t.startswith("tests/")):
        assert (ROOT / test.partition("::")[0]).exists()
