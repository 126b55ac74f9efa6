"""`twin export`: a recording in the formats of other programs."""

from dataclasses import dataclass
from pathlib import Path

from analysis.export import FORMATS, Origin, Writer, write
from analysis.recording.exported import SUFFIXES
from twin.config import Export
from twin.config.paths import named
from twin.config.result import Result, Rows
from twin.errors import TwinError

NOWHERE = "launched from 0°N 0°E, in the Atlantic: give --latitude-deg and --longitude-deg"
SCENES = ("glb", "usd")  # formats of the bodies, which a table of signals does not have


@dataclass(frozen=True)
class ExportResult(Result):
    """The file that was written.

    Attributes
    ----------
    file : path
    kind : its format
    size : bytes
    note : what is worth knowing about it
    """

    file: Path
    kind: str
    size: int
    note: str = ""

    def as_dict(self) -> dict[str, object]:
        """Path, format, size and note; the note is None where there is none."""
        return {
            "file": str(self.file),
            "format": self.kind,
            "bytes": self.size,
            "note": self.note or None,
        }

    def rows(self) -> Rows:
        """Path and size, and the note where there is one."""
        written = [("exported", f"{self.file} ({size_text(self.size)})")]
        return [*written, ("note", self.note)] if self.note else written


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
    kind, given = config.to, config.recording.suffix.lower()
    if given == f".{kind}":
        raise TwinError(f"{config.recording}: is {kind} already; give --to another format")
    if given in SUFFIXES and kind in SCENES:
        raise TwinError(
            f"{config.recording}: has signals and no 3D scene, which {kind} needs; give the"
            " recording (.rrd) that it was exported from"
        )
    if given not in (".rrd", *SUFFIXES):
        raise TwinError(
            f"{config.recording}: must be a recording (.rrd), or what was exported from one as"
            f" {', '.join(s[1:] for s in SUFFIXES)}"
        )
    out = config.out or config.recording.resolve().with_suffix(f".{kind}")
    out = named(out, "export", f".{kind}", force=config.force)
    write(
        _writer(kind),
        config.recording,
        out,
        Origin(config.latitude_deg, config.longitude_deg, config.height_m),
    )
    nowhere = kind == "kml" and config.latitude_deg == config.longitude_deg == 0.0
    return ExportResult(out, kind, out.stat().st_size, NOWHERE if nowhere else "")
