"""Shares of effects in a difference, against games and fits with known answers."""

from itertools import permutations

import numpy as np
import pytest

from analysis.comparison.explanation import (
    Explanation,
    Share,
    candidates,
    deviations,
    jackknife,
    shapley,
    subsets,
)
from analysis.estimate import information


def test_shares_of_the_glove_game_are_those_of_the_textbook():
    # one left glove, two right ones; a pair is worth 1: 2/3, 1/6, 1/6
    worth = {s: float("left" in s and len(s) > 1) for s in subsets(("left", "right", "other"))}
    shares = shapley(worth, ("left", "right", "other"))
    assert shares == pytest.approx({"left": 2 / 3, "right": 1 / 6, "other": 1 / 6})


def test_shares_are_the_mean_contribution_over_all_orders_and_add_up():
    rng, players = np.random.default_rng(1), ("a", "b", "c", "d")
    worth = {s: float(rng.normal()) if s else 0.0 for s in subsets(players)}
    shares = shapley(worth, players)
    for player in players:
        orders = [o[: o.index(player)] for o in permutations(players)]
        joined = [worth[frozenset(o) | {player}] - worth[frozenset(o)] for o in orders]
        assert shares[player] == pytest.approx(np.mean(joined))
    assert sum(shares.values()) == pytest.approx(worth[frozenset(players)])


def test_the_effect_that_made_a_difference_is_tried_first_and_none_where_there_is_only_noise():
    rng, t = np.random.default_rng(2), 0.01 * np.arange(2001)
    J = np.column_stack([np.sin(t), np.sin(t + 0.3), np.sign(np.sin(3 * t)), np.ones_like(t)])
    groups = {"first": [0], "alike": [1], "square": [2, 3]}
    noise = 1e-3 * rng.standard_normal(len(t))
    prior = np.ones(4)
    made = information(t, 0.01 * J[:, 1] + noise, J)
    assert candidates(made, groups, prior, [])[0] == "alike"
    assert candidates(made, groups, prior, ["alike"]) == []
    assert candidates(information(t, noise, J), groups, prior, []) == []


def test_the_interval_of_an_effect_fitted_in_place_of_its_rival_holds_its_true_value():
    rng, t = np.random.default_rng(4), 0.01 * np.arange(2001)
    J = np.column_stack([np.sin(t), np.sin(t + 0.3)])
    angle = 0.01 * J[:, 1] + 1e-3 * rng.standard_normal(len(t))  # none of it by the first
    found, alone = np.linalg.lstsq(J[:, :1], angle, rcond=None)[0][0], 1e-3 / np.sqrt(len(t) / 2)
    assert found > 100.0 * alone
    sigma = deviations(information(t, angle - found * J[:, 0], J), np.ones(2))
    assert found < 1.96 * sigma[0] < 3.0 * found


def test_what_is_explained_is_the_part_of_the_mean_square():
    e = Explanation("x", 0.05, 0.03, 0.01, (Share("delay", 1.0, "0 → 1"),))
    assert e.explained == pytest.approx(1.0 - 0.36)
    assert e.to_dict()["shares"][0]["effect"] == "delay"


def test_intervals_of_shares_are_those_of_a_ratio_over_blocks():
    """W. G. Cochran, Sampling Techniques, 3rd ed., (6.13), of the first order; 5 %: the next."""
    rng = np.random.default_rng(3)
    own, other = rng.uniform(1.0, 2.0, 10), rng.uniform(0.5, 1.0, 10)
    left = {
        frozenset(): own + other + 1.0,
        frozenset("a"): other + 1.0,
        frozenset("b"): own + 1.0,
        frozenset("ab"): np.ones(10),
    }
    whole = left[frozenset()]

    def half(part):
        rest = part - part.sum() / whole.sum() * whole
        return 2.262 * np.sqrt(np.sum(rest**2) / 90.0) / whole.mean()

    assert jackknife(left, "ab") == pytest.approx({"a": half(own), "b": half(other)}, rel=0.05)
    assert jackknife({frozenset(): own}, "") == {}
