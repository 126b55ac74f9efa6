"""Recordings as validated time series: the reader of the twin's own files."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis import schema
from analysis.files import FileError
from analysis.recording import exported, rrd
from analysis.recording.series import Event, Recording, RecordingError, TimeSeries, checked

PROPERTIES = f"/__properties/{schema.PROPERTY}"
ENDS = {f"/__properties/{n}": n for n in (schema.TIMING, schema.FLIGHT)}  # known at the end
TEXTS = (schema.EVENTS, schema.HEALTH, schema.ESTIMATOR)
WANTED = frozenset([PROPERTIES, *ENDS, *TEXTS, *schema.ENTITIES])
MAX_PROPERTIES = 16 * 2**20  # characters of JSON


def read(path: Path | str, *, growing: bool = False) -> Recording:
    """Read and check a recording of the twin.

    Parameters
    ----------
    path : an `.rrd` file; also one whose end is missing, as far as it goes, if `twin view` has
        repaired it; or what `twin export` wrote as CSV, Parquet or MATLAB file
    growing : it is still being written, and read as far as it goes

    Raises
    ------
    RecordingError : the file is missing, is no recording of the twin, is cut off, has another
        schema version, or holds impossible numbers
    """
    path = Path(path)
    if path.suffix.lower() in exported.SUFFIXES:
        return _exported(path)
    content = _Content(path)
    try:
        for entity, batch in rrd.batches(path, WANTED, growing=growing):
            content.take(entity, batch)
    except RecordingError:
        raise
    except FileError as error:
        raise RecordingError(f"cannot read {error}") from None
    except rrd.CutOffError as error:
        raise RecordingError(f"{path}: {error}; `twin view FILE` repairs it") from None
    except (ValueError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:160]
        raise RecordingError(f"{path}: not a Rerun recording, or damaged ({reason})") from None
    return content.recording()


def _exported(path: Path) -> Recording:
    found = exported.read(path)
    return Recording(
        _properties(path, found.about.get("properties", "{}")),
        found.series,
        found.logs["events"],
        found.logs["health"],
        found.about.get("estimator", ""),
        *(_properties(path, found.about.get(n, "{}")) for n in ENDS.values()),
    )


def properties(path: Path) -> dict[str, object]:
    """Properties of a recording of the twin, also of one without an end; nothing else is read.

    Raises
    ------
    RecordingError : the file is not a recording of the twin
    """
    content = _Content(path)
    try:
        for entity, batch in rrd.batches(path, {PROPERTIES}, growing=True):
            content.take(entity, batch)
            if "json" in content.texts:
                break
    except FileError as error:
        raise RecordingError(f"cannot read {error}") from None
    except (ValueError, pa.ArrowException) as error:
        raise RecordingError(f"{path}: not a Rerun recording, or damaged ({error})") from None
    if "json" not in content.texts:
        raise RecordingError(f"{path}: a Rerun file, but no recording of the twin")
    return _properties(path, content.texts["json"])


@dataclass
class _Content:
    """What has been read so far, still as stored."""

    path: Path
    texts: dict[str, str] = field(default_factory=dict)
    parts: dict[str, list[tuple[NDArray[np.int64], NDArray[np.float64]]]] = field(
        default_factory=dict
    )
    lines: dict[str, list[Event]] = field(default_factory=dict)

    def take(self, entity: str, batch: pa.RecordBatch) -> None:
        if entity == PROPERTIES:
            self._take_properties(batch)
        elif entity in ENDS:
            if "json" in batch.schema.names and (text := _texts(batch, "json")[0]) is not None:
                self.texts[ENDS[entity]] = text
        elif schema.TIME not in batch.schema.names:
            return
        elif entity in TEXTS:
            self._take_lines(entity, batch)
        elif entity in schema.ENTITIES:
            self._take_values(schema.ENTITIES[entity], batch)

    def _take_properties(self, batch: pa.RecordBatch) -> None:
        # `rerun rrd optimize`, and so every repair, puts long properties in a chunk each.
        for name in {"schema", "json"}.intersection(batch.schema.names):
            if (text := _texts(batch, name)[0]) is not None:
                self.texts[name] = text
        version = self.texts.get("schema", schema.SCHEMA)
        if version != schema.SCHEMA:
            raise RecordingError(
                f"{self.path}: schema '{version}'; this version reads '{schema.SCHEMA}'"
            )

    def _take_lines(self, entity: str, batch: pa.RecordBatch) -> None:
        texts, levels = (_texts(batch, name) for name in ("TextLog:text", "TextLog:level"))
        for at, text, level in zip(_times(batch), texts, levels, strict=True):
            self.lines.setdefault(entity, []).append(
                Event(float(at) / 1e9, level or "INFO", text or "")
            )

    def _take_values(self, signal: schema.Signal, batch: pa.RecordBatch) -> None:
        if "Scalars:scalars" not in batch.schema.names:
            return
        column, width = batch["Scalars:scalars"], len(signal.components)
        if column.type != pa.list_(pa.float64()):
            raise RecordingError(f"{self.path}: {signal.name} holds {column.type}, not numbers")
        flat = column.flatten().to_numpy(zero_copy_only=False)
        if flat.size != batch.num_rows * width or column.null_count:
            raise RecordingError(
                f"{self.path}: {signal.name} holds {flat.size} values in {batch.num_rows} rows; "
                f"{width} to a row are right ({', '.join(signal.components)})"
            )
        self.parts.setdefault(signal.name, []).append((_times(batch), flat.reshape(-1, width)))

    def recording(self) -> Recording:
        if not {"schema", "json"} <= self.texts.keys():
            raise RecordingError(f"{self.path}: a Rerun file, but no recording of the twin")
        series = {name: self._series(schema.SIGNALS[name]) for name in sorted(self.parts)}
        events, health = (
            tuple(sorted(self.lines.get(entity, ()), key=lambda event: event.time))
            for entity in (schema.EVENTS, schema.HEALTH)
        )
        memory = self.lines.get(schema.ESTIMATOR)
        return Recording(
            _properties(self.path, self.texts["json"]),
            MappingProxyType(series),
            events,
            health,
            memory[0].text if memory else "",
            *(_properties(self.path, self.texts.get(n, "{}")) for n in ENDS.values()),
        )

    def _series(self, signal: schema.Signal) -> TimeSeries:
        # The pieces lie in the file in any order; each is in order itself.
        parts = sorted(self.parts[signal.name], key=lambda part: int(part[0][0]))
        time = np.concatenate([stamps for stamps, _ in parts])
        values = np.concatenate([values for _, values in parts])
        try:
            # Division gives the float nearest to the decimal; a product with 1e-9 may be one off.
            return checked(signal, time / 1e9, signal.from_stored(values))
        except RecordingError as error:
            raise RecordingError(f"{self.path}: {error}") from None


def _times(batch: pa.RecordBatch) -> NDArray[np.int64]:
    column = batch[schema.TIME]
    if column.null_count or not pa.types.is_duration(column.type):
        raise RecordingError(f"timeline '{schema.TIME}' holds {column.type}, not durations")
    stamps = column.to_numpy(zero_copy_only=False)
    return np.asarray(stamps.astype("timedelta64[ns]", copy=False).view(np.int64))


def _texts(batch: pa.RecordBatch, name: str) -> list[str | None]:
    """Return the first text of each row of a column of lists of text; None where there is none."""
    # Other types are not even looked at: what a column becomes in Python may raise anything.
    if name not in batch.schema.names or batch[name].type != pa.list_(pa.string()):
        return [None] * batch.num_rows
    return [row[0] if row else None for row in batch[name].to_pylist()]


def _properties(path: Path, text: str) -> dict[str, object]:
    if len(text) > MAX_PROPERTIES:
        raise RecordingError(f"{path}: {len(text)} characters of properties; something is wrong")
    try:
        properties = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path}: properties are not JSON ({error})") from None
    if not isinstance(properties, dict):
        raise RecordingError(f"{path}: properties are not a JSON object")
    return properties
