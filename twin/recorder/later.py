"""Columns of little data, kept and sent as one chunk of each entity."""

from collections.abc import Iterable
from dataclasses import dataclass

import pyarrow as pa
import rerun as rr

from twin.recorder.columns import Columns

Parts = tuple[dict[str, pa.Array], dict[rr.ComponentDescriptor, pa.Array]]  # times, values


class Later:
    """Takes columns as a stream does, and sends them joined.

    Rerun's index, in memory until the file is closed, grows by the chunk and not by the row, and
    half of the chunks of a rig's run are the scene's, with 3 % of the data.

    Parameters
    ----------
    stream : that gets the columns
    """

    def __init__(self, stream: Columns) -> None:
        self._stream = stream
        self._kept: dict[tuple[str, tuple[str, ...]], list[Parts]] = {}

    def send_columns(
        self,
        entity_path: str,
        indexes: Iterable[rr.TimeColumn],
        columns: Iterable[rr.ComponentColumn],
    ) -> None:
        """Keep rows of an entity, its times ascending from call to call."""
        times = {t.timeline_name(): t.as_arrow_array() for t in indexes}
        values = {c.component_descriptor(): c.as_arrow_array() for c in columns}
        kind = tuple(str(descriptor) for descriptor in values)
        self._kept.setdefault((entity_path, kind), []).append((times, values))

    def send(self) -> None:
        """Send what is kept."""
        for (entity, _), parts in self._kept.items():
            times = [_Joined(name, [t[name] for t, _ in parts]) for name in parts[0][0]]
            values = [_Joined(kind, [v[kind] for _, v in parts]) for kind in parts[0][1]]
            self._stream.send_columns(entity, times, values)  # type: ignore[arg-type]
        self._kept.clear()


@dataclass(frozen=True, slots=True)
class _Joined:
    """Column from parts, in the form that `RecordingStream.send_columns` asks for."""

    name: str | rr.ComponentDescriptor
    parts: list[pa.Array]

    def timeline_name(self) -> str | rr.ComponentDescriptor:
        return self.name

    component_descriptor = timeline_name

    def as_arrow_array(self) -> pa.Array:
        return pa.concat_arrays(self.parts) if len(self.parts) > 1 else self.parts[0]
