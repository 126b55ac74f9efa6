"""`twin export`: a recording in the formats of other programs."""

from dataclasses import dataclass
from pathlib import Path

from analysis.export import FORMATS, Origin, Writer, write
from twin.config import Export
from twin.config.paths import named
from twin.config.result import Result, Rows
from twin.errors import TwinError


@dataclass(frozen=True)
class ExportResult(Result):
    """The file that was written.

    Attributes
    ----------
    file : path
    kind : its format
    size : bytes
    """

    file: Path
    kind: str
    size: int

    def as_dict(self) -> dict[str, object]:
        """Path, format and size."""
        return {"file": str(self.file), "format": self.kind, "bytes": self.size}

    def rows(self) -> Rows:
        """Path and size."""
        return [("exported", f"{self.file} ({size_text(self.size)})")]


def size_text(count: int) -> str:
    """A number of bytes with three digits, in B, kB, MB or GB."""
    unit = min(3, max(0, len(str(count)) - 1) // 3)
    return f"{count / 1000**unit:.3g} {('B', 'kB', 'MB', 'GB')[unit]}"


def _writer(kind: str) -> Writer:
    if kind in FORMATS:
        return FORMATS[kind]
    from twin.evaluation.usd import write_usd

    return write_usd


def export(config: Export) -> ExportResult:
    """Write a recording in another format.

    Raises
    ------
    TwinError, AnalysisError : a recording or file that cannot be used, in one line
    """
    kind = config.to
    if config.recording.suffix != ".rrd":
        raise TwinError(f"{config.recording}: must be a recording (.rrd)")
    out = config.out or config.recording.resolve().with_suffix(f".{kind}")
    out = named(out, "export", f".{kind}", force=config.force)
    write(
        _writer(kind),
        config.recording,
        out,
        Origin(config.latitude_deg, config.longitude_deg, config.height_m),
    )
    return ExportResult(out, kind, out.stat().st_size)
