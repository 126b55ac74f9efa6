"""Figures of a recorded flight: those that its run stored, else what its path shows."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.plain import Plain
from analysis.recording.series import POSITION, Recording

VELOCITY: Final = "vehicle/velocity"
GROUND: Final = "reached the ground"  # how a flight ends that lands
FAST: Final = 1 / 3  # of the largest airspeed; the dynamic pressure is a ninth of its largest
LARGEST: Final = 1e12  # of a stored number
LONGEST: Final = 200  # characters of a stored text
MOST: Final = 20  # stored notes
FIGURES: Final = (  # name as people read it, name in `twin fly --json`, unit, scale
    ("apogee", "apogee_m", " m", 1.0),
    ("time of the apogee", "apogee_s", " s", 1.0),
    ("highest point", "max_height_m", " m", 1.0),
    ("closest approach to the target", "closest_approach_m", " m", 1.0),
    ("static margin at launch", "margin_loaded", " calibres", 1.0),
    ("static margin, empty", "margin_empty", " calibres", 1.0),
    ("speed off the rail", "rail_exit_speed_m_s", " m/s", 1.0),
    ("angle of attack off the rail", "rail_exit_angle_of_attack_deg", "°", 1.0),
    ("time of burnout", "burnout_s", " s", 1.0),
    ("height at burnout", "burnout_height_m", " m", 1.0),
    ("speed at burnout", "burnout_speed_m_s", " m/s", 1.0),
    ("largest speed up to the apogee", "max_ascent_speed_m_s", " m/s", 1.0),
    ("largest Mach number", "max_mach", "", 1.0),
    ("largest acceleration", "max_acceleration_m_s2", " m/s²", 1.0),
    ("largest dynamic pressure", "max_dynamic_pressure_pa", " kPa", 1e-3),
    (
        "largest angle of attack from a third of the top speed on",
        "max_angle_of_attack_deg",
        "°",
        1.0,
    ),
    ("attitude error under power, rms", "attitude_error_rms_deg", "°", 1.0),
    ("gimbal command at its limit, of the burn", "gimbal_saturation", " %", 100.0),
    ("end of the flight", "flight_time_s", " s", 1.0),
    ("descent from the apogee", "descent_s", " s", 1.0),
    ("speed at the ground", "impact_speed_m_s", " m/s", 1.0),
    ("end, distance from the launch", "downrange_m", " m", 1.0),
    ("end, east of the launch", "end_east_m", " m", 1.0),
    ("end, north of the launch", "end_north_m", " m", 1.0),
)
"""Figures in the order in which they are shown."""


@dataclass(frozen=True, slots=True)
class Flown(Plain):
    """A flight in figures.

    Attributes
    ----------
    numbers : by their names in `FIGURES`, in SI unless the name gives another unit; finite
    texts : `ended`, `wind` and `missed`, those that there are
    target : point steered to, east, north, up from the launch point [m], or None
    notes : what the flight noted about its model and its launch
    """

    numbers: Mapping[str, float]
    texts: Mapping[str, str]
    target: tuple[float, float, float] | None
    notes: tuple[str, ...] = ()


def flown(recording: Recording) -> Flown | None:
    """Figures of a flight; None where no vehicle flew."""
    if POSITION not in recording.series or not len(path(recording)[0]):
        return None
    stored = recording.flight
    shown = {name: value for name, value in _path(recording).items() if name not in stored}
    numbers = shown | _finite(stored)
    margin = _vector(stored.get("static_margin"), 2)
    if margin is not None:
        numbers |= {"margin_loaded": margin[0], "margin_empty": margin[1]}
    if "apogee_m" in numbers:
        numbers.pop("max_height_m", None)
    known = _finite(stored)
    if {"apogee_s", "flight_time_s"} <= known.keys():
        numbers["descent_s"] = known["flight_time_s"] - known["apogee_s"]
    texts = {n: t[:LONGEST] for n in ("ended", "wind") if isinstance(t := stored.get(n), str) and t}
    missed = stored.get("missed")
    if isinstance(missed, list) and missed:
        texts["missed"] = "; ".join(str(m) for m in missed)[: 2 * LONGEST]
    target = _vector(stored.get("target_m"), 3)
    notes = stored.get("notes")
    kept = tuple(str(n)[: 2 * LONGEST] for n in notes[:MOST]) if isinstance(notes, list) else ()
    place = None if target is None else (target[0], target[1], target[2])
    return Flown(numbers, texts, place, kept)


def fast(airspeed: Array) -> NDArray[np.bool_]:
    """Where the angle of attack of an ascent (n,) counts: from a third of its largest airspeed on.

    The one definition of a largest angle of attack; slower, on the rail and about the apogee, the
    flow has too little pressure to matter.
    """
    return np.asarray(airspeed >= FAST * np.nanmax(airspeed, initial=0.0))


def path(recording: Recording) -> tuple[Array, Array]:
    """Times (n,) [s] and places relative to the first (n, 3) [m], where the place is known."""
    place = recording[POSITION]
    place = place.rows(np.asarray(np.isfinite(place.values).all(axis=1)))
    return place.time, np.asarray(place.values - place.values[:1])


def attack(recording: Recording, numbers: Mapping[str, float]) -> tuple[Array, Array]:
    """Times [s] and angles of attack [rad] (n,) of the ascent that count, see `fast`."""
    series = recording.series
    angle, speed = series.get("vehicle/angle_of_attack"), series.get("vehicle/airspeed")
    if angle is None or speed is None:
        return np.empty(0), np.empty(0)
    begin, end = numbers.get("rail_exit_s", -math.inf), numbers.get("apogee_s", math.inf)
    rows = (angle.time >= begin) & (angle.time <= end)
    time, values = angle.time[rows], angle.values[rows, 0]
    counts = fast(np.interp(time, speed.time, speed.values[:, 0])) if len(time) else rows[:0]
    return time[counts], values[counts]


def _path(recording: Recording) -> dict[str, float]:
    """What the path alone shows, of recordings without figures: tables, and runs cut off."""
    time, way = path(recording)
    top = int(way[:, 2].argmax())
    found = {
        "max_height_m": float(way[top, 2]),
        "flight_time_s": float(time[-1] - time[0]),
        "downrange_m": math.hypot(way[-1, 0], way[-1, 1]),
        "end_east_m": float(way[-1, 0]),
        "end_north_m": float(way[-1, 1]),
    }
    if 0 < top < len(time) - 1:
        found |= {"apogee_m": float(way[top, 2]), "apogee_s": float(time[top])}
        found["descent_s"] = float(time[-1] - time[top])
    if VELOCITY in recording.series:
        velocity = recording[VELOCITY]
        climbing = velocity.values[velocity.time <= time[top]]
        speed = np.linalg.norm(climbing, axis=1)
        found["max_ascent_speed_m_s"] = float(np.nanmax(speed, initial=0.0))
    return found


def _finite(stored: Mapping[str, object]) -> dict[str, float]:
    """Stored numbers that are shown; whatever else a file holds is left out."""
    names = (*(name for _, name, _, _ in FIGURES), "rail_exit_s")
    return {name: float(v) for name in names if (v := _number(stored.get(name))) is not None}


def _number(value: object) -> float | None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    fits = number and abs(value) < LARGEST  # type: ignore[arg-type]  # neither inf nor NaN
    return float(value) if fits else None  # type: ignore[arg-type]


def _vector(value: object, size: int) -> list[float] | None:
    if not isinstance(value, list | tuple) or len(value) != size:
        return None
    found = [number for v in value if (number := _number(v)) is not None]
    return found if len(found) == size else None
