"""Signals of a recording as MCAP with JSON messages, for Foxglove and other log viewers."""

import json
import math
from pathlib import Path

from analysis.recording.series import Recording, TimeSeries


def write(recording: Recording, path: Path) -> None:
    """Write a channel for each signal, with units in its schema, and the events as a log.

    Raises
    ------
    ImportError : without the package mcap (extra `export`)
    """
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="twin export")
        writer.add_metadata("run", {"properties": json.dumps(recording.properties)})
        for name, series in recording.series.items():
            form = json.dumps(_schema(series)).encode()
            schema = writer.register_schema(name, "jsonschema", form)
            channel = writer.register_channel(f"/{name}", "json", schema)
            for stamp, row in zip(series.time_ns.tolist(), series.values.tolist(), strict=True):
                values = dict(zip(series.components, row, strict=True))
                known = {k: v for k, v in values.items() if not math.isnan(v)}  # JSON has no NaN
                at = max(stamp, 0)
                writer.add_message(channel, at, json.dumps(known).encode(), at)
        text = {"type": "object", "properties": {"level": {}, "text": {"type": "string"}}}
        schema = writer.register_schema("event", "jsonschema", json.dumps(text).encode())
        channel = writer.register_channel("/events", "json", schema)
        for event in recording.events:
            stamp = max(round(event.time * 1e9), 0)
            line = json.dumps({"level": event.level, "text": event.text}).encode()
            writer.add_message(channel, stamp, line, stamp)
        writer.finish()


def _schema(series: TimeSeries) -> dict[str, object]:
    number = {"type": "number", "description": series.unit}
    return {
        "title": series.name,
        "type": "object",
        "properties": dict.fromkeys(series.components, number),
    }
