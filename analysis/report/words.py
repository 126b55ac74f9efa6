"""Figures in words: units people read, and no more digits than the interval allows."""

import math

from analysis.response import Figure

NOTHING = 1e-4  # °, ms, %, Hz: rounding errors of a simulation count as zero
MOST_PLACES: dict[str, int] = {"°": 3, "°/s": 1, "ms": 2, "%": 2, "Hz": 2}  # finer is not measured
DIRECTIONS = ("up", "from below", "down", "from above")
READ: dict[str, tuple[str, float]] = {
    "rad": ("°", 180.0 / math.pi), "rad/s": ("°/s", 180.0 / math.pi), "s": ("ms", 1e3),
    "deg": ("°", 1.0), "1": ("", 1.0),
}  # fmt: skip


def title(name: str) -> str:
    """A figure's name as people write it."""
    return name.replace("_", " ").replace("-90", "−90")


def split(name: str) -> tuple[str, str]:
    """A figure's name and its approach direction: `rise_time up` is `rise time` and `up`."""
    words = title(name)
    for direction in DIRECTIONS:
        if words.endswith(f" {direction}"):
            return words.removesuffix(f" {direction}"), direction
    return words, ""


def value_text(figure: Figure) -> str:
    """Value and half interval in the unit people read; a lopsided interval is written out."""
    unit, scale = READ.get(figure.unit, (figure.unit, 1.0))
    space = "" if unit in ("°", "°/s", "") else " "
    if not math.isfinite(figure.value):
        return "not measurable"
    value, (low, high) = figure.value * scale, (x * scale for x in figure.interval)
    most = MOST_PLACES.get(unit, 6)
    half = 0.5 * (high - low)
    places = _places(half, most) if math.isfinite(half) else -1
    if places < 0:  # no interval, or one too narrow to be shown
        return f"{_trimmed(value, most)}{space}{unit}"
    if abs(value - 0.5 * (low + high)) > max(0.1 * half, 0.5 * 10.0**-places):
        shown, *ends = (_fixed(v, places) for v in (value, low, high))
        return f"{shown} ({ends[0]} to {ends[1]}){space}{unit}"
    return f"{_fixed(value, places)} ± {_fixed(half, places)}{space}{unit}"


def amplitude_text(figure: Figure) -> str:
    """Amplitude in degrees."""
    return angle_text(figure.amplitude)


def angle_text(angle: float) -> str:
    """An angle [rad] in degrees."""
    return f"{number(math.degrees(angle), 3)}°"


def number(value: float, digits: int = 4) -> str:
    """A number of so many significant digits, with a true minus, without an exponent if short."""
    if not math.isfinite(value):
        return "–"
    if abs(value) < NOTHING:
        return "0"
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 < abs(value) < 1e7:
        text = f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return text.replace("-", "−")


def _places(half: float, most: int) -> int:
    """Decimal places that show two digits of a half interval; -1 if `most` places show none."""
    if half < 0.5 * 10.0**-most or half < NOTHING:
        return -1
    return min(most, max(0, 1 - math.floor(math.log10(half))))


def _fixed(value: float, places: int) -> str:
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "−")


def _trimmed(value: float, most: int) -> str:
    """Four significant digits, and at most so many decimal places."""
    return number(round(value, most) + 0.0)
