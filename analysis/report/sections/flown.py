"""Numbers of one flight, from its recorded signals."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain
from analysis.recording.measurements import Measurement

POSITION, VELOCITY, ERROR, THRUST = (
    "vehicle/position", "vehicle/velocity", "control/error", "vehicle/thrust",
)  # fmt: skip
SLOW = 10.0  # m/s; below, the angle of attack means little


@dataclass(frozen=True, slots=True)
class Flown(Plain):
    """Numbers of a flight; NaN where the signal was not recorded.

    Attributes
    ----------
    highest : height above the start [m]
    apogee, apogee_time : the same [m] and its time [s]; NaN where the flight ended in its climb
    speed : largest speed up to the apogee [m/s]
    downrange : horizontal distance of the end from the start [m]
    duration, burnout : [s]; no burnout where the flight ended under power
    error_deg : attitude error about both axes under power, rms [°]
    attack_deg : largest angle of attack up to the apogee, from 10 m/s on [°]
    saturation : share of the powered time in which the command of an axis is at its limit [%]; as
        the error NaN where the gimbal never moved
    """

    name: str
    highest: float
    apogee: float
    apogee_time: float
    speed: float
    downrange: float
    duration: float
    burnout: float
    error_deg: float
    attack_deg: float
    saturation: float


def flown(run: Measurement) -> Flown | None:
    """Numbers of a run in which a vehicle flew, otherwise None."""
    series = run.recording.series
    if POSITION not in series:
        return None
    place = series[POSITION]
    start = place.values[0]
    height = place.column("z") - start[2]
    top = int(np.nanargmax(height))
    rising, highest = float(place.time[top]), float(height[top])
    passed = top < len(height) - 1
    powered = _last(run, THRUST)
    burnt = powered < run.recording[THRUST].time[-1] if np.isfinite(powered) else False
    moved = _moved(run)
    return Flown(
        run.name,
        highest,
        highest if passed else np.nan,
        rising if passed else np.nan,
        _largest(run, VELOCITY, rising),
        float(np.hypot(*(place.values[-1] - start)[:2])),
        float(place.time[-1] - place.time[0]),
        powered if burnt else np.nan,
        float(np.degrees(_rms(run, ERROR, powered))) if moved else np.nan,
        float(np.degrees(_attack(run, rising))),
        _saturation(run, powered) if moved else np.nan,
    )


def _moved(run: Measurement) -> bool:
    """Whether the gimbal moved; the controller of a fixed motor commands in vain."""
    series = run.recording.series
    angles = [series[n].values for n in ("gimbal/simulated", "gimbal/measured") if n in series]
    return not angles or any(np.any(values != 0.0) for values in angles)


def downrange(run: Measurement) -> tuple[Array, Array]:
    """Horizontal distance from the start and height above it (n,) [m]."""
    moved = run.recording[POSITION].values - run.recording[POSITION].values[0]
    return np.hypot(moved[:, 0], moved[:, 1]), moved[:, 2]


def _last(run: Measurement, signal: str) -> float:
    series = run.recording.series.get(signal)
    if series is None or not np.any(series.values[:, 0] > 0.0):
        return np.nan
    return float(series.time[np.flatnonzero(series.values[:, 0] > 0.0)[-1]])


def _largest(run: Measurement, signal: str, until: float) -> float:
    series = run.recording.series.get(signal)
    if series is None:
        return np.nan
    return float(np.nanmax(np.linalg.norm(series.values[series.time <= until], axis=1)))


def _rms(run: Measurement, signal: str, until: float) -> float:
    series = run.recording.series.get(signal)
    if series is None or not np.isfinite(until):
        return np.nan
    values = series.values[series.time <= until]
    return float(np.sqrt(np.nanmean(np.sum(values**2, axis=1)))) if len(values) else np.nan


def _attack(run: Measurement, until: float) -> float:
    series = run.recording.series
    angle, speed = series.get("vehicle/angle_of_attack"), series.get("vehicle/airspeed")
    if angle is None or speed is None:
        return np.nan
    fast = (np.interp(angle.time, speed.time, speed.values[:, 0]) > SLOW) & (angle.time <= until)
    return float(np.nanmax(angle.values[fast, 0])) if fast.any() else np.nan


def _saturation(run: Measurement, until: float) -> float:
    """A limit is a largest command that is held: two ticks or more of exactly one value."""
    command = run.command.rows(run.command.time <= until) if np.isfinite(until) else run.command
    size = np.abs(command.values)
    if not size.size:
        return np.nan
    at_limit = (size == size.max()) & (size > 0.0)
    held = at_limit[1:] & at_limit[:-1]
    return float(100.0 * at_limit.any(axis=1).mean()) if held.any() else 0.0
