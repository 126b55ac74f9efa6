"""What must hold before a recording is opened: signals, properties, file and port."""

import json
import os
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from analysis import schema
from analysis.recording.lock import claim
from twin.errors import TwinError
from twin.viewer.process import LOOPBACK

# bytes of the blueprint: 34 kB with one signal, 123 kB with those of a flight
ROOM, ROOM_EACH = 40_000, 4_000


class RecorderError(TwinError):
    """A recording that cannot be written, as one line."""


def checked(names: Sequence[str]) -> list[schema.Signal]:
    """Signals by name, without duplicates.

    Raises
    ------
    RecorderError : no such signal, or none given
    """
    try:
        found = [schema.signal(name) for name in dict.fromkeys(names)]
    except schema.AnalysisError as error:
        raise RecorderError(str(error)) from None
    if not found:
        raise RecorderError("a recording needs at least one signal")
    return found


def title(properties: Mapping[str, object]) -> str:
    """Name of a recording in the viewer, such as `fly, emulator, seed 3`; equal for equal runs."""
    settings = properties.get("configuration")
    gimbal = settings.get("gimbal") if isinstance(settings, Mapping) else None
    parts = [properties.get("command", "recording"), gimbal]
    if "seed" in properties:
        parts.append(f"seed {properties['seed']}")
    return ", ".join(str(part) for part in parts if part is not None)


def json_text(properties: Mapping[str, object]) -> str:
    """Properties as JSON.

    Raises
    ------
    RecorderError : they are not JSON values
    """
    try:
        return json.dumps(dict(properties), sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise RecorderError(f"the properties of a run must be JSON values: {error}") from None


def claimed(path: Path, partial: Path, signals: int) -> IO[bytes]:
    """Mark the file as being written; returns the open mark.

    Raises
    ------
    RecorderError : the file cannot be written, or another run writes it
    """
    if path.suffix != ".rrd":
        raise RecorderError(f"--out {path}: must end in .rrd")
    if path.is_dir():
        raise RecorderError(f"--out {path}: must be a file, not a folder")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        mark = claim(partial)
        _refuse_full(mark, partial, ROOM + ROOM_EACH * signals)
        if os.name != "posix":  # an open file could not be renamed there
            mark.close()
    except BlockingIOError:
        raise RecorderError(f"{path} is being written by another run; give another --out") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecorderError(f"cannot record to {path}: {reason}") from None
    return mark


def _refuse_full(mark: IO[bytes], partial: Path, room: int) -> None:
    """Reserve and release room for the blueprint: Rerun would fail in many lines, and later."""
    if not hasattr(os, "posix_fallocate"):
        return
    try:
        os.posix_fallocate(mark.fileno(), 0, room)
        os.ftruncate(mark.fileno(), 0)
    except OSError:
        partial.unlink(missing_ok=True)
        mark.close()
        raise


def refuse_taken(port: int) -> None:
    """Refuse a port in use: Rerun would only log it and lose the end of the file.

    Raises
    ------
    RecorderError : the port is in use
    """
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((LOOPBACK, port))
    except (OSError, OverflowError) as error:
        raise RecorderError(f"cannot serve a viewer on port {port}: {error}") from None
