"""Wind and temperature over height from a file, as the compiled forces read them."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.parts import STANDARD_GRAVITY
from twin.physics.aerodynamics.atmosphere import GAS_CONSTANT, density, temperature
from twin.physics.vehicle.design import VehicleError
from twin.physics.vehicle.text import numbers_of

Array = NDArray[np.float64]
FREEZING: Final = 273.15  # K
STEP: Final = 50.0  # m between levels; density is linear between them within 5e-6
MOST: Final = 2000  # levels
COLUMNS: Final = (
    "height above ground [m], wind speed [m/s], direction it comes from [° from north over east]"
    " and, if known, temperature [°C]"
)
LIMITS: Final = ((-500.0, 5e4), (0.0, 150.0), (-360.0, 720.0), (-120.0, 60.0))


def read_sounding(path: Path, altitude: float) -> Array:
    """Profile (5 n,) of a CSV file, columns as `COLUMNS`; see `aerodynamics.profile_at`.

    Wind is linear in its components between the levels of the file, temperature in itself; the
    density is hydrostatic from the standard pressure at the ground.

    Parameters
    ----------
    altitude : of the ground above mean sea level [m]

    Raises
    ------
    VehicleError : unreadable, or the line and what it must be
    """
    rows = numbers_of(path, "profile", COLUMNS, (3, 4), LIMITS)
    table = np.array([numbers for _, numbers in rows]).T
    for (line, now), (_, before) in zip(rows[1:], rows, strict=False):
        if now[0] <= before[0]:
            raise VehicleError(
                f"{path}, line {line}: height {now[0]:g} m must be above {before[0]:g} m of the"
                " line before"
            )
    count = int(np.ceil((table[0, -1] - table[0, 0]) / STEP)) + 1
    height = np.union1d(table[0], np.linspace(table[0, 0], table[0, -1], min(count, MOST)))
    toward = np.radians(table[2]) + np.pi  # where it blows to
    east = np.interp(height, table[0], table[1] * np.sin(toward))
    north = np.interp(height, table[0], table[1] * np.cos(toward))
    if len(table) == 4:
        kelvin = np.interp(height, table[0], table[3] + FREEZING)
        rho = _hydrostatic(height, kelvin, altitude)
    else:
        kelvin = np.array([temperature(h + altitude) for h in height])
        rho = np.array([density(h + altitude) for h in height])
    return np.concatenate([height, east, north, rho, kelvin])


def _hydrostatic(height: Array, kelvin: Array, altitude: float) -> Array:
    """Density (n,) [kg/m³] of a column of air that rests on the standard pressure at the ground.

    d ln p = -g dz / (R T), exact where T is linear: the mean of 1/T is ln(T₂/T₁) / (T₂ - T₁).
    """
    ratio = kelvin[1:] / kelvin[:-1] - 1.0
    flat = np.abs(ratio) < 1e-9
    mean = np.where(flat, 1.0, np.log1p(ratio) / np.where(flat, 1.0, ratio)) / kelvin[:-1]
    fall = STANDARD_GRAVITY / GAS_CONSTANT * np.diff(height) * mean
    sums = np.concatenate([[0.0], -np.cumsum(fall)])
    ground = density(altitude) * GAS_CONSTANT * temperature(altitude)
    pressure = ground * np.exp(sums - np.interp(0.0, height, sums))
    return np.asarray(pressure / (GAS_CONSTANT * kelvin))
