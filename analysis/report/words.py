"""Figures in words: units people read, and no more digits than the interval allows."""

import math

from analysis.response import Figure

NOTHING = 1e-4  # °, ms, %, Hz: rounding errors of a simulation are no figures
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


def figure_text(figure: Figure) -> str:
    """Value with its interval, amplitude and number of repeats: `54.2 ± 0.3 ms at +5°, n = 6`."""
    shown = value_text(figure)
    at = f" at {amplitude_text(figure)}" if math.isfinite(figure.amplitude) else ""
    return f"{shown}{at}, n = {figure.n}" if figure.n else f"{shown}{at}"


def value_text(figure: Figure) -> str:
    """Value and half interval in the unit people read; a lopsided interval is written out."""
    unit, scale = READ.get(figure.unit, (figure.unit, 1.0))
    space = "" if unit in ("°", "°/s", "") else " "
    if not math.isfinite(figure.value):
        return "not measurable"
    value, (low, high) = figure.value * scale, (x * scale for x in figure.interval)
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"{number(value)}{space}{unit}"
    half = 0.5 * (high - low)
    if abs(value - 0.5 * (low + high)) > max(0.1 * half, NOTHING):
        return f"{number(value)} ({number(low, 3)} to {number(high, 3)}){space}{unit}"
    return f"{_rounded(value, half)} ± {number(half, 2)}{space}{unit}"


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


def _rounded(value: float, half: float) -> str:
    """The value to the second significant place of its half interval, four digits at least."""
    if half < NOTHING or abs(value) < NOTHING:
        return number(value)
    places = max(0, 1 - math.floor(math.log10(half)))
    wanted = max(0, 3 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(places, max(wanted, 1))}f}".replace("-", "−")
