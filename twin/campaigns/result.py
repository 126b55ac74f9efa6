"""Result of a campaign: numbers for machines, rows for people."""

from collections.abc import Mapping
from dataclasses import dataclass

from twin.campaigns.statistic import Estimate
from twin.config.result import Result, Rows

UNDECIDED = 3  # exit code


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
    answer : the result in a sentence
    folder : of the rows
    page : report written
    planned, runs, new : runs of the whole study, there are, flown by this command
    outcomes : how many runs ended how
    estimates : statistics with their intervals
    verdicts : conditions that were asked for
    wall_s : time of this command
    """

    answer: str
    folder: str
    page: str
    planned: int
    runs: int
    new: int
    outcomes: Mapping[str, int]
    estimates: Mapping[str, Estimate]
    verdicts: tuple[Verdict, ...]
    wall_s: float

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
        return {
            "answer": self.answer,
            "folder": self.folder,
            "page": self.page,
            "planned": self.planned,
            "runs": self.runs,
            "new": self.new,
            "outcomes": dict(self.outcomes),
            "estimates": {name: e.to_dict() for name, e in self.estimates.items()},
            "fail_if": [
                {"condition": v.text, "holds": v.holds, **v.estimate.to_dict()}
                for v in self.verdicts
            ],
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """The campaign as a table."""
        rows: Rows = [("answer", self.answer)]
        rows.append(
            ("runs", f"{self.runs} of {self.planned}, {self.new} new in {self.wall_s:.1f} s")
        )
        rows.append(("ended", ", ".join(f"{name} {n}" for name, n in self.outcomes.items())))
        rows += [(name, e.text()) for name, e in self.estimates.items()]
        for v in self.verdicts:
            word = {True: "FAILED", False: "passed", None: "UNDECIDED"}[v.holds]
            rows.append((word, f"{v.text}: {v.estimate.text()}"))
        return [*rows, ("rows", self.folder), ("report", self.page)]
