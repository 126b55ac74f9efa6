"""Checked access to the values of a calibration file; every failure is one line with the key."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.calibration.errors import CalibrationError
from hardware.calibration.result import Covariance

Array = NDArray[np.float64]

# key → (lowest, highest) in the file's own unit; values beyond do not belong to any gimbal.
LIMITS = {
    "zero_us": (500.0, 2500.0),
    "matrix_deg_per_us": (-1.0, 1.0),
    "hysteresis_deg": (-1.0, 10.0),
    "hysteresis_sigma_deg": (0.0, 10.0),
    "repeatability_deg": (0.0, 10.0),
    "deviation_deg": (0.0, 10.0),
    "switch_angle_deg": (-45.0, 45.0),
    "zero": (0.05, 0.95),
    "zero_deg": (-20.0, 20.0),
    "scale": (0.5, 2.0),
    "gain_deg": (-3600.0, 3600.0),
    "potentiometer_deg": (90.0, 360.0),
    "bias_deg_s": (-500.0, 500.0),
    "matrix": (-2.0, 2.0),
    "sigma": (0.0, 1.0),
    "bias_sigma_deg_s": (0.0, 500.0),
    "extent_deg": (1.0, 45.0),
    "sigma_deg": (0.0, 1.0),
    "x_deg": (-45.0, 45.0),
    "y_deg": (-45.0, 45.0),
}


def mapping(value: object, name: str) -> dict[str, Any]:
    """Return a value that must be a JSON object."""
    if not isinstance(value, dict):
        raise CalibrationError(f"{name} must be an object")
    return value


def identity(value: object) -> int:
    """Return the serial number of a board from its eight hexadecimal digits."""
    if isinstance(value, str) and len(value) == 8:
        try:
            return int.from_bytes(bytes.fromhex(value))
        except ValueError:
            pass
    raise CalibrationError(f"rig is {value!r:.40}, must be eight hexadecimal digits")


def array(entry: dict[str, Any], key: str, *shape: int) -> Array:
    """Return numbers of a shape, each within the limits of its key."""
    values = numbers(entry, key, shape)
    low, high = LIMITS[key]
    if values.min() < low or values.max() > high:
        worst = values.max() if values.max() > high else values.min()
        raise CalibrationError(f"{key} holds {worst:g}, must be {low:g}…{high:g}")
    return values


def triangle(entry: dict[str, Any], key: str, most: int) -> list[Array]:
    """Return rows of 3, 4, 5 … numbers, at most `most` of them, each within its limits."""
    rows = entry.get(key)
    if not isinstance(rows, list) or len(rows) > most:
        raise CalibrationError(f"{key} must be a list of at most {most} rows")
    return [array({key: row}, key, 3 + k) for k, row in enumerate(rows)]


def covariance(entry: dict[str, Any], key: str, units: Array) -> Covariance:
    """Return a covariance matrix in SI units.

    Parameters
    ----------
    units : SI per unit of the file, for each of the n variables (n,)
    """
    n = len(units)
    values = numbers(entry, key, (n, n))
    size = np.sqrt(np.abs(np.diag(values))) + 1e-30
    normal = values / np.outer(size, size)
    valid = np.diag(values).min() >= 0 and np.allclose(normal, normal.T, atol=1e-6)
    if not valid or float(np.linalg.eigvalsh(normal).min()) < -1e-6:
        raise CalibrationError(f"{key} is not a covariance: not symmetric or not positive")
    return tuple(tuple(float(v) for v in row) for row in values * np.outer(units, units))


def numbers(entry: dict[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape."""

    def check(value: object, depth: int) -> object:
        if depth == len(shape):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise CalibrationError(f"{key} holds {value!r:.40}, must be numbers")
            if abs(value) > 1e15 or not math.isfinite(value):
                raise CalibrationError(f"{key} holds {value!r:.40}, must be finite")
            return float(value)
        if not isinstance(value, list) or len(value) != shape[depth]:
            raise CalibrationError(f"{key} must be {' × '.join(map(str, shape))} numbers")
        return [check(v, depth + 1) for v in value]

    if key not in entry:
        raise CalibrationError(f"{key} is missing")
    return np.array(check(entry[key], 0), dtype=float)
