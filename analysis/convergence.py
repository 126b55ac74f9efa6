"""How a flight converges as the time step shrinks: errors, observed orders, a reference to trust.

The flight is handed in, so anything that can be flown with a named integrator at a given step can
be studied. Orders are observed, never assumed.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain
from analysis.schema import AnalysisError

ABOVE_FLOOR = 10.0  # errors closer to the reference's own uncertainty say nothing about an order
SAFETY = 1.25  # of a Richardson estimate from three solutions (Roache 1998, grid convergence index)
PLAUSIBLE = (0.5, 6.0)  # an observed order outside means that nothing has converged yet
QUANTITIES = {"position": "m", "attitude": "rad"}


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Where a vehicle was at the instants that all flights of a study share.

    Attributes
    ----------
    time : (n,) [s]
    position : (n, 3) [m]
    attitude : (n, 4) unit quaternions of one continuous sign
    """

    time: Array
    position: Array
    attitude: Array

    def __post_init__(self) -> None:
        """Check shapes once; arrays are read-only afterwards.

        Raises
        ------
        AnalysisError : shapes that do not fit, or numbers that are not finite
        """
        n = len(self.time)
        if not n or self.position.shape != (n, 3) or self.attitude.shape != (n, 4):
            raise AnalysisError(
                f"a trajectory of {n} instants with positions {self.position.shape} and attitudes"
                f" {self.attitude.shape}; (n, 3) and (n, 4) are right"
            )
        for array in (self.time, self.position, self.attitude):
            if not np.isfinite(array).all():
                raise AnalysisError("a trajectory holds numbers that are not finite")
            array.setflags(write=False)


# Flies with an integrator at a step [s]; None where it left the finite numbers.
Flight = Callable[[str, float], Trajectory | None]


@dataclass(frozen=True, slots=True)
class Distance(Plain):
    """Largest separation of two trajectories: position [m], angle between attitudes [rad]."""

    position: float
    attitude: float


NOWHERE = Distance(math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Series:
    """One integrator over time steps, coarse to fine.

    Attributes
    ----------
    steps : (m,) [s]
    errors : against the reference; NaN where the flight diverged
    trajectories : None where the flight diverged
    order : observed, per quantity; NaN where fewer than two errors stand clear of the floor
    """

    integrator: str
    steps: Array
    errors: tuple[Distance, ...]
    trajectories: tuple[Trajectory | None, ...]
    order: Mapping[str, float]

    def error_at(self, step: float, quantity: str = "position") -> float:
        """Error expected at a step [s], by the observed order from the finest error resolved."""
        errors = np.array([getattr(e, quantity) for e in self.errors])
        known = np.flatnonzero(np.isfinite(errors))
        if not known.size:
            return math.nan
        last = int(known[-1])
        return float(errors[last] * (step / self.steps[last]) ** self.order[quantity])


@dataclass(frozen=True, slots=True)
class Reference:
    """What all flights are measured against, and how far it may be trusted.

    Attributes
    ----------
    step : finest flown [s]
    order : observed from three steps, as extrapolated with; NaN where it was not plausible, and
        then the finest flight itself is the reference
    uncertainty : of the reference
    """

    trajectory: Trajectory
    integrator: str
    step: float
    order: float
    uncertainty: Distance


@dataclass(frozen=True, slots=True)
class Study:
    """Errors and orders of several integrators on one flight."""

    reference: Reference
    series: tuple[Series, ...]

    def of(self, integrator: str) -> Series:
        """Return the series of one integrator.

        Raises
        ------
        AnalysisError : it was not studied
        """
        for series in self.series:
            if series.integrator == integrator:
                return series
        studied = ", ".join(s.integrator for s in self.series)
        raise AnalysisError(f"integrator {integrator!r} was not studied; there are {studied}")


def distance(a: Trajectory, b: Trajectory) -> Distance:
    """Largest separation over time of two trajectories at the same instants.

    Raises
    ------
    AnalysisError : their instants differ
    """
    if len(a.time) != len(b.time) or np.abs(a.time - b.time).max() > 1e-9:
        raise AnalysisError("trajectories at different instants cannot be compared")
    gap = np.linalg.norm(a.position - b.position, axis=1).max()
    # the chord of unit quaternions is twice the sine of a quarter of the angle between them
    chord = np.linalg.norm(a.attitude - b.attitude, axis=1).max()
    return Distance(float(gap), float(4.0 * np.arcsin(min(0.5 * chord, 1.0))))


def richardson(flight: Flight, integrator: str, step: float) -> Reference:
    """Reference by extrapolation from a step, its half and its quarter.

    The order p is observed from the three, and the error of the finest, (f₃ − f₂)/(2ᵖ − 1), taken
    out (L. F. Richardson 1911; P. J. Roache, Verification and Validation in Computational Science
    and Engineering, 1998, ch. 5).

    Parameters
    ----------
    step : the coarsest of the three [s]

    Raises
    ------
    AnalysisError : one of the three flights diverged
    """
    flown = [flight(integrator, step / 2**k) for k in range(3)]
    coarse, middle, fine = flown
    if coarse is None or middle is None or fine is None:
        raise AnalysisError(
            f"the reference flight diverged: {integrator} at {step * 1e3:g} ms or finer"
        )
    before, after = distance(coarse, middle), distance(middle, fine)
    order = _log2(before.position, after.position)
    if not PLAUSIBLE[0] < order < PLAUSIBLE[1]:
        return Reference(fine, integrator, step / 4, math.nan, after)
    gain = 1.0 / (2.0**order - 1.0)
    attitude = fine.attitude + gain * (fine.attitude - middle.attitude)
    best = Trajectory(
        fine.time.copy(),
        fine.position + gain * (fine.position - middle.position),
        attitude / np.linalg.norm(attitude, axis=1, keepdims=True),
    )
    taken = SAFETY * gain
    uncertainty = Distance(taken * after.position, taken * after.attitude)
    return Reference(best, integrator, step / 4, order, uncertainty)


def observed_order(steps: Array, errors: Array, floor: float = 0.0) -> float:
    """Order as the slope of log error over log step, of the errors clear of the floor.

    Of those the three finest are taken: the order is what holds as the step goes to zero.

    Parameters
    ----------
    steps, errors : (m,), coarse to fine; NaN errors are left out
    floor : uncertainty of the reference, in the unit of the errors
    """
    clear = np.flatnonzero(np.isfinite(errors) & (errors > ABOVE_FLOOR * floor) & (errors > 0.0))
    clear = clear[-3:]
    if clear.size < 2:
        return math.nan
    x, y = np.log(steps[clear]), np.log(errors[clear])
    x = x - x.mean()
    return float(x @ y / (x @ x))


def study(
    flight: Flight, integrators: Sequence[str], steps: Sequence[float], reference: Reference
) -> Study:
    """Fly every integrator at every step and measure each against the reference.

    Parameters
    ----------
    steps : any order; the study has them coarse to fine [s]

    Raises
    ------
    AnalysisError : fewer than two steps, or no integrator
    """
    sizes = np.array(sorted(set(steps), reverse=True), dtype=np.float64)
    if sizes.size < 2 or not integrators or not (sizes > 0).all():
        raise AnalysisError("a convergence study needs an integrator and two different steps")
    return Study(reference, tuple(_series(flight, name, sizes, reference) for name in integrators))


def _series(flight: Flight, name: str, sizes: Array, reference: Reference) -> Series:
    flown = tuple(flight(name, float(h)) for h in sizes)
    errors = tuple(NOWHERE if t is None else distance(t, reference.trajectory) for t in flown)
    order = {
        quantity: observed_order(
            sizes,
            np.array([getattr(e, quantity) for e in errors]),
            getattr(reference.uncertainty, quantity),
        )
        for quantity in QUANTITIES
    }
    return Series(name, sizes, errors, flown, order)


def _log2(a: float, b: float) -> float:
    return math.log2(a / b) if a > 0.0 and b > 0.0 else math.nan
