"""Two motions side by side: simulated against measured, rig against model."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.comparison.motion import FEWEST, bridged, in_gap, unbroken
from analysis.comparison.spectrum import Spectrum, spectrum_of
from analysis.identify.problem.noise import clipped_rms, resolution
from analysis.plain import Plain, plain
from analysis.recording.series import TimeSeries
from analysis.schema import AnalysisError

_LONGEST = 0.25  # s of delay searched
_LEAST = 100.0 * (1.0 - math.sqrt(0.5))  # %; of a perfect model whose motion equals its noise


@dataclass(frozen=True, slots=True)
class Errors(Plain):
    """How far one motion is from another.

    Attributes
    ----------
    rmse, mae, worst : of the difference [rad]
    fit : NRMSE fit, `100·(1 − |difference|/|reference − mean|)` [%]
    vaf : variance accounted for, 100·(1 − var(difference)/var(reference)) [%]
    fit_moving : as `fit`, around the mean difference [%]: the fit of `twin identify`
    """

    rmse: float
    mae: float
    worst: float
    fit: float
    vaf: float
    fit_moving: float


@dataclass(frozen=True, slots=True)
class AxisComparison(Plain):
    """One axis of two motions.

    Attributes
    ----------
    axis : its name
    delay : of the other motion behind the reference [s], sub-sample; it is reported, and only
        `aligned` has it taken out; NaN for an axis that was not commanded
    as_is : errors without any alignment
    aligned : errors after the delay is taken out
    repeats : errors as they are, per repeat
    spectrum : gain, phase and coherence, without alignment, over the longest stretch without a hole
    samples : compared
    left_out : share of the reference's readings that lie in holes of the other and are not
        compared, 0 … 1
    commanded : whether its command changed; the fit of an axis that was to stand still is that of
        its noise, and counts for nothing
    noise : of the reference's readings [rad]
    moved : root mean square of the larger of both motions around its mean [rad]
    limit : smallest fit that a perfect model must be able to reach for the axis to count [%]
    tolerance : difference that does not matter [rad]; an axis that moves and differs by less than
        twice that does not count
    """

    axis: str
    delay: float
    as_is: Errors
    aligned: Errors
    repeats: tuple[Errors, ...]
    spectrum: Spectrum
    samples: int
    left_out: float = 0.0
    commanded: bool = True
    noise: float = 0.0
    moved: float = math.inf
    limit: float = _LEAST
    tolerance: float = 0.0

    @property
    def hardly_moved(self) -> bool:
        """Whether motion and difference are too small to matter."""
        return max(self.moved, self.as_is.rmse) < 2.0 * self.tolerance

    @property
    def reachable(self) -> float:
        """Fit of a perfect model [%]: what the noise of the readings leaves."""
        return 100.0 * (1.0 - self.noise / self.moved) if self.moved > 0.0 else -math.inf


@dataclass(frozen=True, slots=True)
class Comparison(Plain):
    """Two motions side by side, axis by axis."""

    reference: str
    other: str
    axes: tuple[AxisComparison, ...]

    @property
    def fit(self) -> float:
        """Smallest NRMSE fit [%], as it is, of the axes that count; NaN if none does."""
        out = self.uncounted
        return min((a.as_is.fit for a in self.axes if a.axis not in out), default=math.nan)

    @property
    def uncounted(self) -> dict[str, str]:
        """Axes that no limit is held against, and why."""
        found = {a.axis: "not commanded" for a in self.axes if not a.commanded}
        for a in (a for a in self.axes if a.commanded):
            if math.isnan(a.as_is.fit):
                found[a.axis] = "the reference stood still"
            elif a.hardly_moved:
                moved, least = (f"{math.degrees(v):.2g}°" for v in (a.moved, a.tolerance))
                found[a.axis] = (
                    f"hardly moved, {moved} rms; differences below {least} do not matter"
                )
            elif max(a.reachable, a.as_is.fit) < a.limit and a.as_is.rmse < 2.0 * a.noise:
                moved, noise = (f"{math.degrees(v):.2g}°" for v in (a.moved, a.noise))
                found[a.axis] = (
                    f"not moved enough to be judged: {moved} rms, with {noise} of noise"
                    f" (a perfect model reaches {a.reachable:.0f} %)"
                )
        return found

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON; NaN becomes None."""
        return {**Plain.to_dict(self), "fit": plain(self.fit), "uncounted": self.uncounted}


def compare(
    reference: TimeSeries,
    other: TimeSeries,
    *,
    repeats: Mapping[str, Sequence[float]] = MappingProxyType({}),
    longest_delay: float = _LONGEST,
    still: Collection[str] = (),
    noise: Mapping[str, float] = MappingProxyType({}),
    limit: float | None = None,
    tolerance: float = 0.0,
) -> Comparison:
    """Compare two motions over the time and the axes they share.

    The other motion is interpolated at the stamps of the reference, but not across its holes.

    Parameters
    ----------
    reference : usually what was measured
    other : usually what was simulated
    repeats : of an axis, the times [s] at which its repeats begin, and at which the last one ends
    longest_delay : of either motion behind the other [s]
    still : axes that were not commanded
    noise : of the reference's readings where it is known [rad]; else by their second differences,
        or their step over √12
    limit : fit that is asked for [%]; an axis counts if its noise lets a perfect model reach that,
        or if it is off by more than twice that noise
    tolerance : difference that does not matter [rad]: an axis that moves and differs by less than
        twice that does not count

    Raises
    ------
    AnalysisError : they share no axis, or not enough time
    """
    shared = [c for c in reference.components if c in other.components]
    if not shared:
        raise AnalysisError(
            f"no axis in common: {reference.name} has {', '.join(reference.components)}; "
            f"{other.name} has {', '.join(other.components)}"
        )
    axes = tuple(
        replace(
            _axis(reference, other, c, repeats.get(c, ()), longest_delay, c in still, noise.get(c)),
            limit=max(_LEAST, limit or _LEAST),
            tolerance=tolerance,
        )
        for c in shared
    )
    return Comparison(reference.name, other.name, axes)


def _axis(
    reference: TimeSeries,
    other: TimeSeries,
    axis: str,
    repeats: Sequence[float],
    longest: float,
    still: bool,
    noise: float | None,
) -> AxisComparison:
    (t, y), (s, x) = _column(reference, axis), _column(other, axis)
    shared = (t >= s[0]) & (t <= s[-1])
    there = bridged(t, s, x)
    both = np.isfinite(there)
    if both.sum() < FEWEST:
        raise AnalysisError(
            f"axis '{axis}': {int(both.sum())} samples in common; {reference.name} covers "
            f"{t[0]:g} to {t[-1]:g} s, {other.name} {s[0]:g} to {s[-1]:g} s"
            + (", with holes" if shared.sum() > both.sum() else "")
        )
    delay = math.nan if still else _delay(t, y, s, x, longest)
    shifted = bridged(t, s, x, 0.0 if still else delay)
    inside = both & np.isfinite(shifted)
    as_is = errors(y[both], there[both])
    aligned = errors(y[inside], shifted[inside]) if inside.sum() >= FEWEST else as_is
    t, y, there = t[both], y[both], there[both]
    edges = np.searchsorted(t, np.asarray(repeats, dtype=np.float64)).tolist()
    return AxisComparison(
        axis,
        delay,
        as_is,
        aligned,
        tuple(errors(y[a:b], there[a:b]) for a, b in pairwise(edges) if b - a > 2),
        spectrum_of(*unbroken(t, y, there)),
        len(t),
        1.0 - float(both.sum()) / float(shared.sum()),
        not still,
        _noise(y) if noise is None else noise,
        float(max(np.std(y), np.std(there))),
    )


def _noise(y: Array) -> float:
    rounded = resolution(y) / math.sqrt(12.0)
    return max(clipped_rms(np.diff(y, 2) / math.sqrt(6.0)) if len(y) > 2 else 0.0, rounded)


def errors(reference: ArrayLike, other: ArrayLike) -> Errors:
    """Errors of one signal (n,) against another; `fit` and `vaf` are NaN for a constant."""
    y, x = np.asarray(reference, dtype=np.float64), np.asarray(other, dtype=np.float64)
    e = x - y
    spread, varied = float(np.linalg.norm(y - y.mean())), float(np.var(y))
    return Errors(
        rmse=float(np.sqrt(np.mean(e**2))),
        mae=float(np.mean(np.abs(e))),
        worst=float(np.abs(e).max()),
        fit=100.0 * (1.0 - float(np.linalg.norm(e)) / spread) if spread else math.nan,
        vaf=100.0 * (1.0 - float(np.var(e)) / varied) if varied else math.nan,
        fit_moving=100.0 * (1.0 - float(np.std(e) / np.std(y))) if spread else math.nan,
    )


def _column(motion: TimeSeries, axis: str) -> tuple[Array, Array]:
    known = motion.select((axis,)).known()
    if len(known.time) < FEWEST:
        raise AnalysisError(
            f"{motion.name}: axis '{axis}' has {len(known.time)} readings; {FEWEST} are needed"
        )
    return known.time, known.value


def _delay(t: Array, y: Array, s: Array, x: Array, longest: float) -> float:
    """Delay of x behind y [s] that leaves the least difference around its own mean."""
    from scipy.optimize import minimize_scalar

    span = min(t[-1], s[-1]) - max(t[0], s[0])
    longest = min(longest, 0.25 * span)
    if longest <= 0.0:
        return 0.0
    period = min(float(np.median(np.diff(t))), float(np.median(np.diff(s))))
    inside = (t - longest >= s[0]) & (t + longest <= s[-1]) & ~in_gap(t, s, margin=longest)
    if inside.sum() < FEWEST:  # short records: what is beyond the ends stands still
        inside = ~in_gap(t, s)
    t, y = t[inside], y[inside]
    if np.ptp(y) == 0.0 or np.ptp(x) == 0.0:
        return 0.0

    def loss(delay: float) -> float:
        e = np.interp(t + delay, s, x) - y
        return float(np.var(e))

    grid = np.linspace(-longest, longest, min(2 * math.ceil(longest / period) + 1, 2001))
    best = int(np.argmin([loss(d) for d in grid]))
    step = float(grid[1] - grid[0])
    low, high = float(grid[best]) - step, float(grid[best]) + step
    found = minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": 1e-7})
    return float(found.x)
