"""What a measurement until the model is known leaves."""

from dataclasses import dataclass
from pathlib import Path

from analysis.identify import IdentifiedModel
from twin.config.result import Result, Rows
from twin.evaluation.identify_result import IdentifyResult


@dataclass(frozen=True)
class LiveResult(Result):
    """A model, and the measurement that ended when it was known well enough.

    Attributes
    ----------
    identified : the model with its file
    pieces : recordings, fitted together
    signals : what was commanded in each
    motion_s : time commanded
    halves : half width of each figure asked for, of the axis that knows it worst; a delay in s, the
        others over their value
    asked : the same, as asked for
    """

    identified: IdentifyResult
    pieces: tuple[Path, ...]
    signals: tuple[str, ...]
    motion_s: float
    halves: dict[str, float]
    asked: dict[str, float]

    @property
    def model(self) -> IdentifiedModel:
        """The model."""
        return self.identified.model

    @property
    def file(self) -> Path:
        """Its file."""
        return self.identified.file

    @property
    def passed(self) -> bool:
        """Whether every interval is as narrow as asked."""
        return all(self.halves[n] <= half for n, half in self.asked.items())

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI: those of `twin identify`, and the measurement."""
        return {
            **self.identified.as_dict(),
            "pieces": [str(p) for p in self.pieces],
            "signals": list(self.signals),
            "motion_s": self.motion_s,
            "half_widths": self.halves,
            "asked": self.asked,
        }

    def rows(self) -> Rows:
        """The measurement, then the model."""
        rows = [
            ("measured" if k == 0 else "", f"{p}  {s}")
            for k, (p, s) in enumerate(zip(self.pieces, self.signals, strict=True))
        ]
        rows.append(("motion", f"{self.motion_s:.0f} s"))
        for name, half in self.asked.items():
            met = "" if self.halves[name] <= half else ", not reached"
            found = text(name, self.halves[name])
            rows.append((f"{name} known to", f"± {found} (asked: {text(name, half)}{met})"))
        return rows + self.identified.rows()


def text(name: str, half: float, gap: str = " ") -> str:
    """A half width as it is asked for."""
    scale, unit = (1e3, "ms") if name == "delay" else (100.0, "%")
    return f"{scale * half:.2g}{gap}{unit}"
