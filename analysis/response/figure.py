"""One quoted figure: never a bare number."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.plain import Plain
from analysis.schema import AnalysisError

ALIKE = 0.05  # of the amplitude: figures of motions that close are of the same


# Differences below both are of no practical importance for a hobby-servo gimbal: a share of the
# measured value, and an absolute size in the figure's unit.
PRACTICAL_SHARE = 0.02
PRACTICAL_SIZE: dict[str, float] = {
    "rad": math.radians(0.05), "rad/s": math.radians(2.0), "deg": 1.0, "s": 0.5e-3, "%": 0.5,
    "1": 0.005, "Hz": 0.1,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Figure(Plain):
    """A figure with what it needs to be believed.

    Attributes
    ----------
    name, unit : what it is and in what it is measured
    value : NaN where it could not be measured
    amplitude : of the motion it was measured at [rad], NaN where it has none
    n : number of repeats behind it; 0 for a model
    interval : of 95 % confidence, NaN where one measurement tells none
    """

    name: str
    value: float
    unit: str
    amplitude: float = math.nan
    n: int = 1
    interval: tuple[float, float] = (math.nan, math.nan)


def over_repeats(name: str, values: ArrayLike, unit: str, amplitude: float = math.nan) -> Figure:
    """Mean of repeats with its interval (Student); NaN repeats do not count."""
    found = np.asarray(values, dtype=np.float64)
    found = found[np.isfinite(found)]
    if len(found) == 0:
        return Figure(name, math.nan, unit, amplitude, 0)
    mean = float(found.mean())
    if len(found) == 1:
        return Figure(name, mean, unit, amplitude, 1)
    half = student(len(found) - 1) * float(found.std(ddof=1)) / math.sqrt(len(found))
    return Figure(name, mean, unit, amplitude, len(found), (mean - half, mean + half))


def student(freedom: int) -> float:
    """Half width of a 95 % interval in estimated deviations: Student's, by degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))


def fitted_line(x: Array, y: Array) -> tuple[float, float, Array]:
    """Slope, offset and residual (n,) of the least-squares line.

    Raises
    ------
    AnalysisError : fewer than three points, or points over one place
    """
    if len(x) < 3 or np.ptp(x) == 0.0:
        equal = "equal " if len(x) > 1 and np.ptp(x) == 0.0 else ""
        points = "point" if len(x) == 1 else "points"
        raise AnalysisError(f"{len(x)} {equal}{points}; a line needs three that differ")
    slope, offset = np.polyfit(x, y, 1)
    return float(slope), float(offset), y - slope * x - offset


def disagreements(
    measured: Sequence[Figure], model: Sequence[Figure]
) -> tuple[tuple[Figure, Figure], ...]:
    """Pairs of a measured figure and the model's that differs from it.

    It differs if it lies outside the measured figure's interval and is further away than the
    practical tolerance: 2 % of the value, and 0.05°, 2 °/s, 0.5 ms, 0.5 %, 0.005 or 0.1 Hz.

    Figures are one another's if their names are equal and their amplitudes within 5 %. A linear
    model's are of any amplitude and direction: its `rise_time` is held against `rise_time up` and
    `rise_time down`, its peak and static error of a unit step are scaled by the amplitude.
    """
    found = []
    for m in measured:
        other = _counterpart(m, model)
        if other is None:
            continue
        value = other.value
        if (m.unit, other.unit) == ("rad", "1"):
            value *= abs(m.amplitude) if "peak" in m.name else m.amplitude
        known = all(map(math.isfinite, (*m.interval, value)))
        outside = known and not m.interval[0] <= value <= m.interval[1]
        if outside and abs(value - m.value) > _tolerance(m):
            found.append((m, other))
    return tuple(found)


def _tolerance(figure: Figure) -> float:
    return max(PRACTICAL_SHARE * abs(figure.value), PRACTICAL_SIZE.get(figure.unit, 0.0))


def _counterpart(figure: Figure, others: Sequence[Figure]) -> Figure | None:
    """The one of the same amplitude before that of any."""
    general = figure.name.removesuffix(" up").removesuffix(" down")
    alike = (f for f in others if f.name == figure.name and _same(f.amplitude, figure.amplitude))
    linear = (
        f for f in others if f.name in (figure.name, general) and not math.isfinite(f.amplitude)
    )
    return next(alike, next(linear, None))


def _same(a: float, b: float) -> bool:
    if math.isfinite(a) and math.isfinite(b):
        return abs(a - b) <= ALIKE * max(abs(a), abs(b)) + 1e-9
    return math.isfinite(a) == math.isfinite(b)
