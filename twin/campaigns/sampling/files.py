"""Files that a study names: where they are, and what of their content decides a row."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from analysis.schema import AnalysisError
from twin.errors import TwinError
from twin.plant.model.compose import described_files
from twin.plant.model.packing import packed

FILES = ("vehicle", "mechanism", "model", "motor", "calibration", "set_from", "scene")


def beside(setting: str, value: Any, folder: Path) -> Any:  # noqa: ANN401  of any setting
    """The value of a setting; a file that is found in the study's folder with its path."""
    named = setting in FILES and isinstance(value, str)
    return str(folder / value) if named and (folder / value.partition(":")[0]).is_file() else value


def contents(fly: Mapping[str, Any], vary: Mapping[str, Any], folder: Path) -> Iterator[bytes]:
    """Content of every file that `[fly]` and `[vary]` name, and of those that these name."""
    named = [(name, fly[name]) for name in FILES if name in fly]
    for name, table in vary.items():
        if "file" in table:
            yield from _content(folder / str(table["file"]))
        values = table.get("values", ())
        for value in values if isinstance(values, list) else ():
            named += value.items() if isinstance(value, dict) else [(name, value)]
    for name, value in named:
        path = beside(name, value, folder)
        if name in FILES and isinstance(path, str):
            yield from _content(Path(path.partition(":")[0]))


def _content(path: Path) -> Iterator[bytes]:
    """Bytes of a file, then of those that it names; what cannot be read is left to the flight."""
    if not path.is_file():
        return
    yield path.read_bytes()
    try:
        if path.suffix.lower() == ".xml":
            yield from packed(path).values()
        for other in described_files(path).values():
            yield from _content(other)
    except (TwinError, AnalysisError):
        return
