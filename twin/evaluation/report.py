"""`twin report`: recordings and models in, one page out."""

from dataclasses import dataclass
from pathlib import Path

from analysis.report import ReportNumbers, report
from analysis.transfer_function import TransferFunctionModel
from twin import status
from twin.config import Report
from twin.config.paths import named, point_latest
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.inputs import seen
from twin.plant.loops import attitude_loops


@dataclass(frozen=True)
class ReportResult(Result):
    """The page and its numbers."""

    numbers: ReportNumbers
    file: Path
    sources: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """The numbers that the page holds, as JSON values."""
        return self.numbers.to_dict()

    def rows(self) -> Rows:
        """The sources and the page."""
        return [("report of", ", ".join(self.sources)), ("page", str(self.file))]


def write_report(config: Report) -> ReportResult:
    """Write one page about recordings of a gimbal, and models beside them.

    Raises
    ------
    TwinError, AnalysisError : invalid input, in one line
    """
    if not config.recordings:
        raise TwinError("report: name one or more recordings (.rrd) or tables (.csv, .mat)")
    runs = seen(config, config.recordings)
    models = {f.stem: TransferFunctionModel.read(f) for f in config.model}
    out = named(config.out, "report", ".html", ".htm", force=config.force)
    loops = attitude_loops() if models else ()
    status.say("computing figures and comparison")
    numbers = report(runs, out, models=models, loops=loops, title=config.title)
    point_latest(out)
    return ReportResult(numbers, out, tuple(str(f) for f in (*config.recordings, *config.model)))
