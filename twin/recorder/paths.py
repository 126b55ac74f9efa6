"""A recording of many paths at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from analysis import schema
from twin.recorder.checks import RecorderError
from twin.recorder.sink import one_line

Array = NDArray[np.float64]
PLAIN, THIN_M, THICK_M = (130, 140, 150), 0.15, 0.6


@dataclass(frozen=True)
class FlownPath:
    """One path.

    Attributes
    ----------
    name : shown beside it
    points : (n, 3) in the world [m]
    colour : red, green, blue, 0 to 255, of a highlighted path; None for one of many
    """

    name: str
    points: Array
    colour: tuple[int, int, int] | None = None


def write_paths(out: Path, paths: Sequence[FlownPath], about: str) -> Path:
    """Write a recording with all paths in one 3D view, and a text about them.

    Raises
    ------
    RecorderError : it cannot be written
    """
    partial = out.with_name(out.name + ".partial")
    # equal paths give equal recordings
    stream = rr.RecordingStream(
        schema.APPLICATION, recording_id=out.stem, send_properties=False, default_enabled=True
    )
    try:
        view = rrb.Spatial3DView(origin="/", name="Paths")
        text = rrb.TextDocumentView(origin="/about", name="Campaign")
        look = rrb.Blueprint(rrb.Horizontal(view, text, column_shares=[4, 1]))
        stream.save(partial, default_blueprint=look)
        stream.send_recording_name(out.stem)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for path in paths:
            lit = path.colour is not None
            strip = rr.LineStrips3D(
                [path.points], colors=[path.colour or PLAIN], labels=[path.name], show_labels=lit,
                radii=[THICK_M if lit else THIN_M],
            )  # fmt: skip
            stream.log(f"/paths/{path.name.replace(' ', '_')}", strip, static=True)
        stream.log("/about", rr.TextDocument(about), static=True)
        stream.flush()
        stream.disconnect()
        partial.replace(out)
    except (RuntimeError, OSError, ValueError) as error:
        partial.unlink(missing_ok=True)
        raise RecorderError(f"cannot record to {out}: {one_line(error)}") from None
    return out
