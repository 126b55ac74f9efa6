"""What the demonstration measured, and each number in plain words."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from analysis.comparison.grade import GOOD_FIT, grade
from twin.config.result import Result, Rows

if TYPE_CHECKING:
    from twin.campaigns.results.result import CampaignResult
    from twin.evaluation.compare_result import CompareResult
    from twin.evaluation.identify_result import IdentifyResult
    from twin.experiments.calibrate import CalibrationResult
    from twin.experiments.flight.result import FlightResult
    from twin.experiments.step import StepResult

FIGURE = 1.96  # standard deviations of a 95 % interval
FOLLOWS = {"good": "closely", "fair": "roughly", "poor": "poorly"}


class Stages(NamedTuple):
    """Results of the verbs, in their order; no calibration where its file was given."""

    calibrated: "CalibrationResult | None"
    steps: "StepResult"
    model: "IdentifyResult"
    physics: "CompareResult"
    fitted: "CompareResult"
    flown: "FlightResult"
    looped: "FlightResult"
    apart: "CompareResult"
    windy: "CampaignResult"


class Fact(NamedTuple):
    """One number of the demonstration: what it is about, its text, and what it means."""

    topic: str
    text: str
    meaning: str


@dataclass(frozen=True)
class DemoResult(Result):
    """One rig from calibration to flight.

    Attributes
    ----------
    gimbal, unit : the rig, and its serial number if simulated
    folder : of recordings, calibration, model and page
    stages : results of the verbs
    wall_s : time of it all
    """

    gimbal: str
    unit: int | None
    folder: Path
    stages: Stages
    wall_s: float

    @property
    def page(self) -> Path:
        """The page that explains everything."""
        return self.folder / "demo.html"

    @property
    def passed(self) -> bool:
        """Whether no stage found fault with the rig."""
        return all(stage is None or stage.passed for stage in self.stages)

    def as_dict(self) -> dict[str, object]:
        """JSON values: the results of the stages by name."""
        stages = {
            name: None if stage is None else stage.as_dict()
            for name, stage in self.stages._asdict().items()
        }
        return {
            "gimbal": self.gimbal,
            "unit": self.unit,
            "folder": str(self.folder),
            "page": str(self.page),
            "wall_s": self.wall_s,
            "stages": stages,
        }

    def rows(self) -> Rows:
        """Every fact with its meaning, the files, and what to try next."""
        unit = "" if self.unit is None else f", unit {self.unit}"
        rows = [("rig", f"{self.gimbal}{unit}; all done in {self.wall_s:.0f} s")]
        for fact in self.facts():
            rows += [(fact.topic, fact.text), ("", f"  {fact.meaning}")]
        rows.append(("page", f"{self.page}  (open it in a browser)"))
        rows.append(("watch the flight", f"twin view {self.stages.looped.recording}"))
        ideas = (f"{command}    ({what})" for command, what in self.ideas())
        return rows + [("try next" if k == 0 else "", text) for k, text in enumerate(ideas)]

    def facts(self) -> Iterator[Fact]:
        """The numbers of the demonstration."""
        s = self.stages
        if s.calibrated is not None:
            c = s.calibrated.calibration
            half = FIGURE * math.degrees(max(c.sigma((0.0, 0.0))))
            yield Fact(
                "calibrated",
                f"the commanded angle is right within ± {half:.2f}° (95 %)",
                "servo zero and travel, measured at the limit switches; the rest is play",
            )
        if s.steps.fault or s.looped.fault:
            yield Fact("FAULT", str(s.steps.fault or s.looped.fault), "see `twin doctor`")
        yield from self._response()
        yield _followed(
            "physical model",
            s.physics,
            "simulated servos and pushrods with nominal values, which saw no reading",
        )
        yield _followed("identified model", s.fitted, f"{s.model.file.name}, fitted to the steps")
        if (apart := s.apart.flight) is not None:
            nose = math.degrees(apart.attitude_rms)
            yield Fact(
                "flights",
                f"{nose:.2f}° rms between the noses, paths {apart.path_worst:.1f} m apart at most",
                f"rig in the loop against the model in its place, over {apart.length:.0f} m under"
                " power",
            )
        if s.looped.attitude_error_rms_deg is not None:
            yield Fact(
                "control",
                f"{s.looped.attitude_error_rms_deg:.2f}° rms attitude error, rig in the loop",
                "between the nose and the programme (a doublet of 5°) while the motor burned",
            )

        yield Fact(
            "campaign",
            s.windy.answers.text,
            "hit: at most 5 m from a point 500 m away, in random wind, with the identified model",
        )

    def _response(self) -> Iterator[Fact]:
        words = (
            ("dead time", 1e3, "ms before it moves"),
            ("rise time", 1e3, "ms from 10 to 90 %"),
            ("overshoot", 1.0, "% past the target"),
        )
        for axis in "xy":
            parts = []
            for name, scale, text in words:
                values = [
                    f.value
                    for a in self.stages.steps.figures
                    for f in a.figures
                    if a.axis == axis
                    and f.name.startswith(name.replace(" ", "_"))
                    and math.isfinite(f.value)
                ]
                if values:
                    parts.append(f"{scale * sum(values) / len(values):.0f} {text}")
            if parts:
                yield Fact(f"step of 5°, {axis}", ", ".join(parts), "mean of both directions")

    def ideas(self) -> tuple[tuple[str, str], ...]:
        """Commands that lead on, and what each does."""
        model = self.stages.model.file
        return (
            (
                f"twin report {self.stages.steps.recording} --model {model}",
                "a page with all figures of the steps",
            ),
            ("twin fly --programme point --off-axis-deg 15 0", "steers to a point beside the ramp"),
            (
                f"twin campaign run {self.folder / 'wind.toml'} --out runs/wind",
                "the campaign with your changes to wind.toml",
            ),
            ("twin demo --gimbal firmware", "the same with the Nano's program on a simulated Nano"),
            ("twin demo --gimbal /dev/ttyUSB0", "the same with your rig; its servos move"),
        )


def _followed(topic: str, compared: "CompareResult", what: str) -> Fact:
    fit = compared.comparison.fit
    rms = math.degrees(max(a.as_is.rmse for a in compared.comparison.axes if a.commanded))
    word = FOLLOWS[grade(fit)]
    text = f"follows the rig {word}: fit {fit:.1f} %, {rms:.2f}° rms"
    return Fact(topic, text, f"{what}; 100 % is exact, {GOOD_FIT:.0f} % and more is close")
