"""One function for all formats: what is written appears whole or not at all."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from analysis.export import glb, kml, mcap, scene, tables
from analysis.recording import read
from analysis.schema import AnalysisError

Writer = Callable[[Path, Path, "Origin"], None]


class ExportError(AnalysisError):
    """A recording that cannot be exported, in one line."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where the world's origin lies: latitude, longitude [deg], height above the sea [m]."""

    latitude: float = 0.0
    longitude: float = 0.0
    height: float = 0.0


def _csv(source: Path, target: Path, _: Origin) -> None:
    tables.write_csv(read(source), target)


def _parquet(source: Path, target: Path, _: Origin) -> None:
    tables.write_parquet(read(source), target)


def _mat(source: Path, target: Path, _: Origin) -> None:
    tables.write_mat(read(source), target)


def _mcap(source: Path, target: Path, _: Origin) -> None:
    mcap.write(read(source), target)


def _kml(source: Path, target: Path, origin: Origin) -> None:
    kml.write(read(source), target, (origin.latitude, origin.longitude, origin.height))


def _glb(source: Path, target: Path, _: Origin) -> None:
    glb.write(scene.bodies(source), target)


FORMATS: Mapping[str, Writer] = MappingProxyType(
    {"csv": _csv, "parquet": _parquet, "mat": _mat, "mcap": _mcap, "kml": _kml, "glb": _glb}
)


def write(writer: Writer, source: Path, target: Path, origin: Origin) -> None:
    """Export a recording.

    Raises
    ------
    AnalysisError : the recording or the file cannot be used, or the recording lacks what is asked
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".export-") as folder:
            part = Path(folder) / target.name
            writer(source, part, origin)
            part.replace(target)
    except OSError as error:
        raise ExportError(f"--out {target}: {error.strerror or error}") from None
