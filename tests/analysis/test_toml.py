"""TOML of unknown origin."""

import time

import pytest

from analysis import toml

HOSTILE = {
    "dotted": ".".join("a" * 50_000) + " = 1",
    "quoted": ".".join(['"a"'] * 30_000) + " = 1",
    "header": "[" + " . ".join("a" * 40_000) + "]",
    "inline": "b = {" + ".".join("a" * 50_000) + " = 1}",
    "nested": "a = " + 50_000 * "[" + 50_000 * "]",
    "word": "a" * 190_000,
    "quotes": '"' * 190_000,
    "dashes": "-." * 90_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_text_is_refused_at_once(name):
    began = time.thread_time()
    with pytest.raises(ValueError, match=r"\A[^\n]*\Z"):
        toml.parsed(HOSTILE[name])
    assert time.thread_time() - began < 2.0  # s; the parser alone takes minutes for 50 000 names


def test_dots_in_numbers_and_texts_are_no_nested_keys():
    text = f'a.b.c = [{", ".join(["0.5"] * 100)}]\nd = "1.0 … 2.0 ... 3.0, see x.y.z.toml"\n'
    assert toml.parsed(text) == {
        "a": {"b": {"c": [0.5] * 100}},
        "d": "1.0 … 2.0 ... 3.0, see x.y.z.toml",
    }
