"""The wind of a flight in words."""

import math
from typing import Final

import mujoco

from twin.plant.authority import numeric

POINTS: Final = (
    "north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest",
)  # fmt: skip


def wind_text(model: mujoco.MjModel) -> str:
    """Mean wind, where it comes from, and its gusts; empty without wind."""
    speed, azimuth, turbulence = (
        0.0 if (values := numeric(model, f"wind_{name}")) is None else float(values[0])
        for name in ("speed", "azimuth", "turbulence")
    )
    gusts = f", gusts {100 * turbulence:.0f} % rms of {speed:g} m/s" if speed and turbulence else ""
    if numeric(model, "air_profile") is not None:
        return f"by the launch's profile{gusts}"
    if not speed:
        return ""
    source = (270.0 - math.degrees(azimuth)) % 360.0  # blows to `azimuth`, from east to north
    point = POINTS[round(source / 45.0) % 8]
    return f"{speed:g} m/s from the {point} ({source:.0f}° from north over east){gusts}"
