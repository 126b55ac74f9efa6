"""What a section is made of: plain data. The page alone makes HTML of it, and escapes it all."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.comparison.grade import Grade

Style = Literal["line", "thin", "dash", "dots", "rings"]

MOST_POINTS = 3000  # of one line: more than a screen has columns
DIGITS = 6  # significant, in the page


@dataclass(frozen=True, slots=True)
class Line:
    """One line, or one set of points, of a plot.

    Attributes
    ----------
    name : in the legend; lines of one name share an entry and a colour
    x, y : (n,); NaN in y breaks the line
    role : decides the colour: `command`, or `run0`, `run1` … in the order of the runs,
        or itself a colour, `#rrggbb`
    panel : index of the panel
    low, high : band around the line (n,), or nothing
    labels : text of each point, shown under the pointer
    """

    name: str
    x: Array
    y: Array
    role: str
    panel: int = 0
    style: Style = "line"
    low: Array | None = None
    high: Array | None = None
    labels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes in a plot's grid; `rows` name y = 0, 1, 2 … from the top."""

    title: str
    y_label: str
    row: int = 0
    column: int = 0
    y_log: bool = False
    x_label: str = ""  # of an own x axis; without it the panel shares the plot's
    rows: tuple[str, ...] = ()
    x_range: tuple[float, float] | None = None  # of an own x axis
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Plot:
    """Panels that share their x axis, and what is drawn in them.

    Attributes
    ----------
    name : unique in the page, letters and dashes
    caption : what the reader sees, and how it was computed
    panel_height : of every row [pixels]
    x_range : shown at first; the rest is a double-click away
    """

    name: str
    caption: str
    x_label: str
    panels: tuple[Panel, ...]
    lines: tuple[Line, ...]
    x_log: bool = False
    panel_height: int = 230
    x_range: tuple[float, float] | None = None

    def to_dict(self) -> dict[str, object]:
        """What the page's script draws."""
        return {
            "name": self.name,
            "x_label": self.x_label,
            "x_log": self.x_log,
            "panel_height": self.panel_height,
            "x_range": self.x_range,
            "panels": [
                {"title": p.title, "y_label": p.y_label, "row": p.row, "column": p.column,
                 "y_log": p.y_log, "x_label": p.x_label, "rows": p.rows,
                 "x_range": p.x_range, "y_range": p.y_range}
                for p in self.panels
            ],
            "lines": [_line(line) for line in self.lines],
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Cell:
    """Text of a table's cell; `mark` stresses it (`off`: disagrees, `warn`)."""

    text: str
    mark: Literal["", "off", "warn", "number"] = ""


@dataclass(frozen=True, slots=True)
class Verdicts:
    """A row of short verdicts, each with a colour and a word: `linkage: fit 97 %, good`."""

    items: tuple[tuple[str, Grade], ...]
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under a head; `folded` tables open on a click and are not printed."""

    head: tuple[str, ...]
    rows: tuple[tuple[Cell | str, ...], ...]
    caption: str = ""
    folded: str = ""


@dataclass(frozen=True, slots=True)
class Section:
    """A chapter of the page: plain text, plots and tables.

    Attributes
    ----------
    name : its address in the page, letters and dashes
    text : paragraphs
    """

    name: str
    title: str
    text: tuple[str, ...] = ()
    parts: tuple[Plot | Table | Verdicts, ...] = field(default_factory=tuple)


def thinned(x: ArrayLike, y: ArrayLike, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """At most about so many points of a line that still reach every peak: extremes of stretches.

    A gap (NaN) still breaks it.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    filled = np.where(np.isfinite(y), y, 0.0)
    rows = {0, len(x) - 1}
    for a, b in pairwise(edges):
        rows.update((int(a + np.argmin(filled[a:b])), int(a + np.argmax(filled[a:b]))))
        rows.update((a + np.flatnonzero(~np.isfinite(y[a:b]))[:1]).tolist())
    kept = np.array(sorted(rows))
    return x[kept], y[kept]


def held(time: Array, value: Array) -> tuple[Array, Array]:
    """Corners of a command held from stamp to stamp, so that its jumps are upright."""
    rows = np.flatnonzero(np.diff(value) != 0.0) + 1
    if len(rows) > MOST_POINTS // 2:
        return thinned(time, value)
    starts = np.concatenate([[0], rows])
    ends = np.concatenate([rows, [len(value) - 1]])
    corners = np.stack([time[starts], time[ends]], axis=1).ravel()
    return corners, np.repeat(value[starts], 2)


def _line(line: Line) -> dict[str, object]:
    content: dict[str, object] = {
        "name": line.name,
        "role": line.role,
        "panel": line.panel,
        "style": line.style,
        "x": _numbers(line.x),
        "y": _numbers(line.y),
    }
    if line.low is not None and line.high is not None:
        content |= {"low": _numbers(line.low), "high": _numbers(line.high)}
    if line.labels:
        content["labels"] = line.labels
    return content


def _numbers(values: Sequence[float] | Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if math.isfinite(v) else None for v in values]
