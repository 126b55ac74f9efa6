"""Paired medians: what is compared runs in turn, so that a slow moment slows both."""

import time
from collections.abc import Callable

import numpy as np


def paired(actions: dict[str, Callable[[], object]], rounds: int = 15) -> dict[str, np.ndarray]:
    """Seconds of each action in each round, (rounds,); one warm-up round is not counted."""
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for k in range(rounds + 1):
        for name, action in actions.items():
            began = time.perf_counter()
            action()
            if k:
                taken[name].append(time.perf_counter() - began)
    return {name: np.array(seconds) for name, seconds in taken.items()}


def ratio(taken: dict[str, np.ndarray], over: str, under: str) -> float:
    """Median of the round-by-round ratios."""
    return float(np.median(taken[over] / taken[under]))


def row(claim: str, figure: str, bound: str, good: bool) -> str:
    """One line of the table; says whether the bound was met."""
    return f"{'  ' if good else '! '}{claim:<58}{figure:>20}   {bound}"
