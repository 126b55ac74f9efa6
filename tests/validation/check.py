"""A check: a claim, the independent truth it is measured against, and what is tolerated."""

import math
from collections.abc import Callable
from dataclasses import dataclass

COMMAND = "python -m tests.validation --only"


@dataclass(frozen=True)
class Check:
    """A figure, in `unit`, from `low` to `high`; `long` ones are left out of `--quick`."""

    name: str
    claim: str
    truth: str
    measure: Callable[[], float]
    high: float = math.inf
    unit: str = ""
    low: float = -math.inf
    long: bool = False

    def tolerance(self) -> str:
        """In the words of the page."""
        if self.high == math.inf:
            return f"≥ {self.low:g}{self.unit}"
        if self.low == -math.inf:
            return f"≤ {self.high:g}{self.unit}"
        return f"{self.low:g} to {self.high:g}{self.unit}"

    def holds(self, figure: float) -> bool:
        """Whether a figure is tolerated; not a number is not."""
        return self.low <= figure <= self.high

    def row(self, figure: float, date: str) -> str:
        """A line of the page's table."""
        verdict = "holds" if self.holds(figure) else "**fails**"
        measured = f"{figure:.3g}{self.unit}"
        cells = (self.claim, self.truth, f"`{COMMAND} {self.name}`", measured, self.tolerance())
        return f"| {' | '.join((*cells, date, verdict))} |"
