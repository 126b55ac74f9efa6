"""Paired medians, and rows of the benchmarks' table with their ratios to a limit and to a peer."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

HEAD = f"  {'':<62}{'measured':>14}{'limit':>12}{'of limit':>10}{'of peer':>10}  peer, remark"


@dataclass(frozen=True)
class Row:
    """One figure of the table.

    Attributes
    ----------
    most, least : limits of the value, in its unit
    peer : the same quantity of what the figure is compared with, in its unit
    note : name of the peer, or a remark
    text, good : figure in words, and whether it is within the limit named in the note
    """

    claim: str
    value: float | None
    unit: str = ""
    most: float | None = None
    least: float | None = None
    peer: float | None = None
    note: str = ""
    text: str = ""
    good: bool = True

    @property
    def of_limit(self) -> float | None:
        """Value over its limit, or the least over the value: kept up to 1."""
        if self.value is None:
            return None
        if self.most:
            return self.value / self.most
        return self.least / self.value if self.least and self.value > 0 else None

    @property
    def of_peer(self) -> float | None:
        """Value over the peer's."""
        return self.value / self.peer if self.value is not None and self.peer else None

    @property
    def kept(self) -> bool:
        """Whether it was measured and is within its limit."""
        if self.text:
            return self.good
        if self.value is None or (self.most is not None and self.value > self.most):
            return False
        return self.least is None or self.value >= self.least

    def __str__(self) -> str:
        limit = f"≤ {_digits(self.most)}" if self.most is not None else ""
        limit = f"≥ {_digits(self.least)}" if self.least is not None else limit
        value = self.text or "not measured"
        value = value if self.value is None else f"{_digits(self.value)} {self.unit}"
        of = ("" if x is None else _digits(x) for x in (self.of_limit, self.of_peer))
        shares = "".join(f"{text:>10}" for text in of)
        mark = " " if self.kept else "!"
        return f"{mark} {self.claim:<62}{value:>14}{limit:>12}{shares}  {self.note}".rstrip()

    def numbers(self) -> dict[str, Any]:
        """Row with its ratios for JSON."""
        return asdict(self) | {
            "of_limit": self.of_limit,
            "of_peer": self.of_peer,
            "kept": self.kept,
        }


def row(claim: str, figure: str, bound: str, good: bool) -> Row:
    """Row of a figure in words, without ratios."""
    return Row(claim, None, note=bound, text=figure, good=good)


def _digits(value: float) -> str:
    """Three digits, and whole numbers in full."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def paired(actions: dict[str, Callable[[], object]], rounds: int = 15) -> dict[str, np.ndarray]:
    """Seconds of each action in each round, (rounds,); one warm-up round is not counted.

    What is compared runs in turn, so that a slow moment slows both.
    """
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


def missed(rows: Sequence[Row]) -> list[str]:
    """Claims of the rows that were not measured or exceed their limit."""
    return [row.claim for row in rows if not row.kept]
