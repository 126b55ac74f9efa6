"""Results on one screen, and the files they go to."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from analysis.comparison.flights import PathDifference
from twin.errors import TwinError

_WIDTH = 24
_READ_AS = {"s": (1e3, " ms"), "rad/rad": (1.0, ""), "1": (1.0, ""), "rad": (180.0 / np.pi, "°")}


def screen(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values, one row each."""
    return "\n".join(f"{name:<{_WIDTH}} {value}".rstrip() for name, value in rows)


def writable(path: Path) -> Path:
    """The file to write; a folder that cannot be written is told before anything is computed."""
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"cannot write {path}: {error.strerror}") from None
    if path.is_dir() or not os.access(folder, os.W_OK):
        raise TwinError(f"cannot write {path}: {'a folder' if path.is_dir() else 'no permission'}")
    return path


def quantity(value: float, half: float, unit: str) -> str:
    """A value with its 95 % interval, as people read it."""
    scale, unit = _READ_AS.get(unit, (1.0, f" {unit}"))
    value, half = scale * value, scale * half
    if not np.isfinite(half):
        return f"{value:.4g}{unit}, interval unknown"
    if half == 0.0:
        return f"{value:.5g}{unit}, as given"
    digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 9))
    return f"{value:.{digits}f} ± {half:.{digits}f}{unit}"


def difference_text(d: PathDifference) -> str:
    """One line about how far two flights lie apart."""
    return (
        f"nose {math.degrees(d.attitude_rms):.2f}° rms apart, path {d.path_worst:.2f} m at most,"
        f" {100.0 * d.share:.2f} % of {d.length:.0f} m"
    )
