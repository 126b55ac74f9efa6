"""Flights side by side and flights repeated: paths, where the nose pointed, and steps of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain, plain
from analysis.recording.series import Recording
from analysis.response.metrics import StepMetrics, measure
from analysis.response.steps import cut_steps
from analysis.schema import AnalysisError

PERIOD = 0.02  # s between the instants compared
NEEDED = ("vehicle/position", "vehicle/attitude")
LONGEST = 36_000.0  # s
JUMP = math.radians(0.1)  # of a setpoint; programmes that steer smoothly move less in a tick


@dataclass(frozen=True, slots=True)
class FlightPath:
    """A recorded flight at instants `PERIOD` apart.

    Attributes
    ----------
    time : (n,) [s]
    position : (n, 3) [m]
    nose : (n, 3) where it points, unit vectors in the world; one motor leaves roll to itself, so
        roll is no part of an attitude here
    steered : how many of the instants lie before the thrust has ended
    """

    time: Array
    position: Array
    nose: Array
    steered: int

    @property
    def length(self) -> float:
        """Distance flown [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True)
class PathDifference(Plain):
    """How far two flights lie apart while both were steered, or flew.

    Attributes
    ----------
    time : for how long [s]
    attitude_rms, attitude_worst : angle between the noses [rad]
    path_rms, path_worst : distance at equal times [m]
    length : flown by the first meanwhile [m]
    """

    time: float
    attitude_rms: float
    attitude_worst: float
    path_rms: float
    path_worst: float
    length: float

    @property
    def share(self) -> float:
        """Largest distance over the length flown [1]."""
        return self.path_worst / self.length if self.length > 0.0 else math.nan

    def text(self) -> str:
        """One line with the figures people compare flights by."""
        return (
            f"nose {math.degrees(self.attitude_rms):.2f}° rms apart, path {self.path_worst:.2f} m"
            f" at most, {100.0 * self.share:.2f} % of {self.length:.0f} m"
        )

    def to_dict(self) -> dict[str, object]:
        """JSON values in SI; None for the share of a path of no length."""
        return {**Plain.to_dict(self), "path_share": plain(self.share)}


@dataclass(frozen=True, slots=True)
class Spread:
    """How repeated flights scatter about their mean while all were steered.

    Attributes
    ----------
    n : flights
    time : (k,) [s]
    mean : mean path (k, 3) [m]
    distance : standard deviation of the flights about it (k,) [m]: √(Σd²/(n − 1)) of the distances
    worst : largest distance of any flight at any instant [m]
    attitude : likewise of the angles between the noses and their mean, over all instants [rad]
    length : of the mean path [m]
    """

    n: int
    time: Array
    mean: Array
    distance: Array
    worst: float
    attitude: float
    length: float

    def to_dict(self) -> dict[str, float]:
        """JSON values in SI."""
        return {
            "n": self.n,
            "time": float(self.time[-1]),
            "distance_at_end": float(self.distance[-1]),
            "distance_worst": self.worst,
            "attitude_rms": self.attitude,
            "length": self.length,
        }


def holds_flight(recording: Recording) -> bool:
    """Whether a vehicle flew in it."""
    return all(name in recording.series for name in NEEDED)


def flight_path(recording: Recording) -> FlightPath:
    """The path of a recorded flight.

    Raises
    ------
    AnalysisError : there is none, or it is shorter than two instants
    """
    if not holds_flight(recording):
        raise AnalysisError("no vehicle flew in this recording")
    position, attitude = (recording[name] for name in NEEDED)
    if not len(position.time) or not len(attitude.time):
        raise AnalysisError("the vehicle of this recording was nowhere")
    if not position.time[-1] <= LONGEST:
        raise AnalysisError(f"a flight of {position.time[-1]:.3g} s; {LONGEST:g} s can be compared")
    time = PERIOD * np.arange(math.floor(position.time[-1] / PERIOD) + 1)
    if len(time) < 2:
        raise AnalysisError(f"a flight of {position.time[-1]:.3g} s is too short to compare")
    along = np.stack([np.interp(time, position.time, c) for c in position.values.T], axis=1)
    w, x, y, z = attitude.values.T
    axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    nose = np.stack([np.interp(time, attitude.time, c) for c in axis], axis=1)
    nose /= np.linalg.norm(nose, axis=1, keepdims=True)
    return FlightPath(time, along, nose, _steered(recording, time))


def _steered(recording: Recording, time: Array) -> int:
    thrust = recording.series.get("vehicle/thrust")
    if thrust is None:
        return len(time)
    burning = np.flatnonzero(thrust.values[:, 0] > 0.0)
    end = thrust.time[burning[-1]] if burning.size else time[-1]
    return max(2, int(np.searchsorted(time, end, side="right")))


def path_difference(a: FlightPath, b: FlightPath, *, whole: bool = False) -> PathDifference:
    """How far two flights lie apart while both were steered, or while both flew (`whole`)."""
    n = min(len(a.time), len(b.time)) if whole else min(a.steered, b.steered)
    turned, apart = _angle(a.nose[:n], b.nose[:n]), _gap(a.position[:n], b.position[:n])
    flown = np.linalg.norm(np.diff(a.position[:n], axis=0), axis=1).sum()
    return PathDifference(
        time=float(a.time[n - 1]),
        attitude_rms=_rms(turned),
        attitude_worst=float(turned.max()),
        path_rms=_rms(apart),
        path_worst=float(apart.max()),
        length=float(flown),
    )


def spread(paths: Sequence[FlightPath]) -> Spread:
    """How repeated flights scatter about their mean while all were steered.

    Raises
    ------
    AnalysisError : fewer than two
    """
    if len(paths) < 2:
        raise AnalysisError(f"{len(paths)} flight; two or more have a spread")
    n = min(p.steered for p in paths)
    positions = np.stack([p.position[:n] for p in paths])  # (flights, n, 3)
    noses = np.stack([p.nose[:n] for p in paths])
    mean, nose = positions.mean(axis=0), noses.mean(axis=0)
    nose /= np.linalg.norm(nose, axis=1, keepdims=True)
    apart = np.linalg.norm(positions - mean, axis=2)
    turned = np.stack([_angle(one, nose) for one in noses])
    few = math.sqrt(len(paths) / (len(paths) - 1))  # the mean is their own and lies too near
    return Spread(
        n=len(paths),
        time=paths[0].time[:n],
        mean=mean,
        distance=few * np.sqrt((apart**2).mean(axis=0)),
        worst=float(apart.max()),
        attitude=few * _rms(turned),
        length=float(np.linalg.norm(np.diff(mean, axis=0), axis=1).sum()),
    )


def attitude_step(recording: Recording) -> StepMetrics | None:
    """Metrics of the vehicle's answer to the one step of its setpoint; None for other programmes.

    The nose's tilt is taken along the step, from the step to the end of the thrust.
    """
    series = recording.series
    if "control/setpoint" not in series or "vehicle/tilt" not in series:
        return None
    wanted, tilt = series["control/setpoint"], series["vehicle/tilt"]
    known = np.isfinite(wanted.values).all(axis=1)
    time, asked = wanted.time[known], wanted.values[known]
    jumps = np.flatnonzero(np.linalg.norm(np.diff(asked, axis=0), axis=1) > JUMP) + 1
    if len(jumps) != 1 or np.ptp(asked[jumps[0] :], axis=0).max() > JUMP:
        return None
    at = int(jumps[0])
    way = asked[at] - asked[at - 1]
    size = float(np.linalg.norm(way))
    along = (tilt.values - asked[at - 1]) @ (way / size)
    inside = tilt.time <= time[-1]
    command = np.array([0.0, size])
    stamps = np.array([time[0], time[at]])
    steps = cut_steps(tilt.time[inside], along[inside], stamps, command)
    try:
        return measure(steps[0]) if steps else None
    except AnalysisError:  # it does not move
        return None


def _angle(a: Array, b: Array) -> Array:
    """Angle between unit vectors (n, 3) [rad]; exact for small ones, unlike an arc cosine."""
    chord = np.linalg.norm(a - b, axis=1)
    angle: Array = 2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
    return angle


def _gap(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(a - b, axis=1), dtype=np.float64)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
