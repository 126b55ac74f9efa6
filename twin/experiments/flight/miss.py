"""Why a point was missed: the limit of the guidance, the stroke of the gimbal, or burnout."""

import math
from typing import Final

import numpy as np

from twin.control.guidance import FixedPoint
from twin.control.setpoint import Setpoint
from twin.experiments.flight.flight import PASSED
from twin.experiments.flight.result import FlightResult
from twin.experiments.flight.track import COMMAND, POSITION, TIME, VELOCITY, Track

NEAR: Final = 5.0  # m; the demonstration's claim
SHARE: Final = 0.1  # of the way, from which a limit explains a miss


def missed(
    result: FlightResult,
    programme: Setpoint,
    track: Track,
    burnout: float,
    within: float | None,
) -> tuple[str, ...]:
    """What kept a flight off its point, one text each; none where it came near enough.

    Parameters
    ----------
    burnout : its time [s]
    within : largest distance that counts as near enough [m]; `NEAR` if omitted
    """
    near = NEAR if within is None else within
    closest = result.closest_approach_m
    if not isinstance(programme, FixedPoint) or closest is None or closest <= near:
        return ()
    return _reasons(result, programme, track, burnout)


def _reasons(
    result: FlightResult, steering: FixedPoint, track: Track, burnout: float
) -> tuple[str, ...]:
    ticks = track.ticks
    away = np.linalg.norm(ticks[:, POSITION] - np.array(steering.target), axis=1)
    nearest = int(away.argmin())
    way = ticks[: nearest + 1]
    way = way[way[:, TIME] >= steering.begin]
    texts = []
    limit = track.limit
    arrival = float(ticks[nearest, TIME])
    if arrival > burnout:
        texts.append(f"the motor burned out {arrival - burnout:.1f} s before the closest approach")
    powered = way[way[:, TIME] <= burnout]
    if len(powered):
        stroke = float((np.abs(powered[:, COMMAND]) >= limit - 1e-6).any(axis=1).mean())
        if stroke >= SHARE:
            texts.append(
                f"the gimbal was at the limit of its stroke, {math.degrees(limit):.3g}°, for"
                f" {stroke:.0%} of the way under power"
            )
        held = float(
            np.mean([steering.limited(r[TIME], r[POSITION], r[VELOCITY]) for r in powered])
        )
        if held >= SHARE:
            texts.append(
                f"the limit of the angle of attack, {math.degrees(steering.most):.3g}°, acted for"
                f" {held:.0%} of the way under power"
            )
    if result.ended != PASSED:
        texts.append(f"the flight ended before it passed the point: {result.ended}")
    return tuple(texts) or ("disturbances in the last seconds",)
