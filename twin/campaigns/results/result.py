"""Result of a campaign: numbers for machines, rows for people."""

from dataclasses import dataclass

from twin.campaigns.results.answers import Answers
from twin.campaigns.statistics.boundary import SHARE
from twin.campaigns.statistics.statistic import MEANINGS, Estimate
from twin.config.result import Result, Rows

UNDECIDED = 3  # exit code
SHOWN = 4  # influences on the screen


@dataclass(frozen=True)
class Verdict:
    """A condition that the campaign must not meet; `holds` is None where that is undecided."""

    text: str
    estimate: Estimate
    holds: bool | None


@dataclass(frozen=True)
class CampaignResult(Result):
    """A campaign in numbers.

    Attributes
    ----------
    answers : from its rows
    folder : of the rows
    page : report written
    recording : with the paths of some runs; empty without
    planned, runs, new : runs of the whole study, there are, flown by this command
    verdicts : conditions that were asked for
    wall_s : time of this command [s]
    cpu_s : processor time of the processes that flew the new runs [s]; None with Ray, and without
        new runs
    """

    answers: Answers
    folder: str
    page: str
    recording: str
    planned: int
    runs: int
    new: int
    verdicts: tuple[Verdict, ...]
    wall_s: float
    cpu_s: float | None = None

    @property
    def passed(self) -> bool:
        """Whether no condition is met or undecided."""
        return all(v.holds is False for v in self.verdicts)

    @property
    def status(self) -> int:
        """1 where a condition is met, 3 where one is undecided, else 0."""
        if any(v.holds for v in self.verdicts):
            return 1
        return 0 if self.passed else UNDECIDED

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        a = self.answers
        return {
            "answer": a.text,
            "folder": self.folder,
            "page": self.page,
            "recording": self.recording or None,
            "planned": self.planned,
            "runs": self.runs,
            "new": self.new,
            "outcomes": dict(a.outcomes),
            "estimates": {name: e.to_dict() for name, e in a.estimates.items()},
            "influences_on": a.figure,
            "influences": {
                name: {k: e.to_dict() for k, e in vars(i).items() if e is not None}
                for name, i in a.influences.items()
            },
            "map": [
                {"parameter": p.name, "nominal": p.nominal, "better": p.better,
                 "threshold": p.threshold and p.threshold.to_dict(), "margin": p.margin}
                for p in a.map
            ],
            "cells": [
                {"parameter": c.parameter, "value": c.value,
                 "rate": c.rate and c.rate.to_dict(), "mean": c.figure.to_dict()}
                for c in a.cells
            ],
            "fail_if": [
                {"condition": v.text, "holds": v.holds, **v.estimate.to_dict()}
                for v in self.verdicts
            ],
            "wall_s": self.wall_s,
            "cpu_s": self.cpu_s,
        }  # fmt: skip

    def rows(self) -> Rows:
        """The campaign as a table."""
        a = self.answers
        flown = f"{self.runs} of {self.planned}, {self.new} new in {self.wall_s:.1f} s"
        if self.cpu_s is not None and self.new:
            flown += f", {self.cpu_s / self.new:.2g} s of processor time each"
        rows: Rows = [("answer", a.text), ("runs", flown)]
        rows.append(("ended", ", ".join(f"{name} {n}" for name, n in a.outcomes.items())))
        for name, e in a.estimates.items():
            meaning = f"; {MEANINGS[name].lower()}" if name in MEANINGS else ""
            rows.append((name, e.text() + meaning))
        rows += self._map() + self._influences()
        for c in a.cells:
            rate = (
                ""
                if c.rate is None
                else f"{100 * c.rate.value:.1f} % ({100 * c.rate.low:.1f} % at least), "
            )
            rows.append((c.parameter, f"{c.value}: {rate}{a.figure} {c.figure.value:.3g}"))
        for v in self.verdicts:
            word = {True: "FAILED", False: "passed", None: "UNDECIDED"}[v.holds]
            rows.append((word, f"{v.text}: {v.estimate.text()}"))
        if self.recording:
            rows.append(("paths", f"twin view {self.recording}"))
        return [*rows, ("rows", self.folder), ("report", self.page)]

    def _map(self) -> Rows:
        return [
            (f"for {100 * SHARE:.0f} %", f"{p.name}: {p.limit}, nominal {p.nominal:.3g}")
            for p in self.answers.map
        ]

    def _influences(self) -> Rows:
        order = sorted(self.answers.influences.items(), key=lambda item: -abs(item[1].rank.value))
        return [
            ("influence", f"{name}: rank correlation {i.rank.value:+.2f}"
             + ("" if i.total is None else f", total Sobol index {i.total.value:.2f}"))
            for name, i in order[:SHOWN]
        ]  # fmt: skip
