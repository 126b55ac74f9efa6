"""A calibration as a JSON file: written beside and renamed, believed only after every check."""

import json
import math
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from hardware.calibration.result import (
    Calibration,
    CalibrationError,
    Covariance,
    GyroMap,
    Matrix,
    PotentiometerMap,
)
from hardware.frames import Pair

SCHEMA = "tvc-twin/calibration/1"
LARGEST_FILE = 64 * 1024
_US = 1e-6

# key → (lowest, highest) in the file's own unit; a value beyond is no gimbal.
_LIMITS = {
    "zero_us": (500.0, 2500.0),
    "matrix_deg_per_us": (-1.0, 1.0),
    "hysteresis_deg": (-1.0, 10.0),
    "hysteresis_sigma_deg": (0.0, 10.0),
    "repeatability_deg": (0.0, 10.0),
    "switch_angle_deg": (-45.0, 45.0),
    "zero": (0.05, 0.95),
    "gain_deg": (-3600.0, 3600.0),
    "bias_deg_s": (-500.0, 500.0),
    "matrix": (-2.0, 2.0),
    "sigma": (0.0, 1.0),
    "bias_sigma_deg_s": (0.0, 500.0),
}
_NAMES = ("x_a", "x_b", "y_a", "y_b")


def write(path: Path, calibration: Calibration) -> None:
    """Write a calibration; a file of that name is replaced as a whole.

    Raises
    ------
    CalibrationError : the place cannot be written
    """
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_text(json.dumps(to_dict(calibration), indent=1) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise CalibrationError(f"cannot write {path}: {error.strerror}") from None


def read(path: Path, rig: int | None = None) -> Calibration:
    """Read a calibration that anybody may have written.

    Parameters
    ----------
    path : JSON file
    rig : serial number of the board at hand; None takes any

    Raises
    ------
    CalibrationError : not there, not this format, implausible, or of another rig
    """
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}") from None
    if len(data) > LARGEST_FILE:
        raise CalibrationError(f"{path} is larger than {LARGEST_FILE} bytes; no calibration is")
    calibration = parsed(data, str(path))
    if rig is not None and calibration.rig != rig:
        raise CalibrationError(
            f"{path} is of rig {calibration.rig:08x}, this one is {rig:08x}; "
            "run `twin calibrate` on it"
        )
    return calibration


def parsed(data: bytes | str, name: str) -> Calibration:
    """Read a calibration from a text that calls itself `name`.

    Raises
    ------
    CalibrationError : not this format, or implausible
    """
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        raise CalibrationError(f"{name} is not JSON; make one with `twin calibrate`") from None
    try:
        return from_dict(content)
    except CalibrationError as error:
        raise CalibrationError(f"{name}: {error}") from None


def to_dict(c: Calibration) -> dict[str, Any]:
    """Return the file's content: degrees, microseconds, and the unit in every key."""
    return {
        "schema": SCHEMA,
        "rig": f"{c.rig:08x}",
        "zero_us": [v / _US for v in c.zero],
        "zero_covariance_us2": _scaled(c.zero_covariance, _US**-2),
        "matrix_deg_per_us": _scaled(c.matrix, degrees(1) * _US),
        "matrix_covariance_deg2_per_us2": _scaled(c.matrix_covariance, (degrees(1) * _US) ** 2),
        "hysteresis_deg": [degrees(v) for v in c.hysteresis],
        "hysteresis_sigma_deg": [degrees(v) for v in c.hysteresis_sigma],
        "repeatability_deg": [degrees(v) for v in c.repeatability],
        "switch_angle_deg": [degrees(v) for v in c.switch_angle],
        "potentiometers": {
            name: {
                "zero": p.zero,
                "gain_deg": degrees(p.gain),
                "covariance_deg": _congruent(p.covariance, (1.0, degrees(1))),
            }
            for name, p in zip(_NAMES, c.potentiometers, strict=True)
        },
        "gyro": {
            "bias_deg_s": [degrees(v) for v in c.gyro.bias],
            "matrix": [list(row) for row in c.gyro.matrix],
            "sigma": c.gyro.sigma,
            "bias_sigma_deg_s": degrees(c.gyro.bias_sigma),
        },
    }


def from_dict(content: object) -> Calibration:
    """Return the calibration of a file's content.

    Raises
    ------
    CalibrationError : a key is missing, a value has another shape, is not finite or not plausible
    """
    top = _object(content, "file")
    if top.get("schema") != SCHEMA:
        raise CalibrationError(f"schema is {top.get('schema')!r:.60}, must be {SCHEMA!r}")
    pots = _object(top.get("potentiometers"), "potentiometers")
    gyro = _object(top.get("gyro"), "gyro")
    maps = [_potentiometer(_object(pots.get(n), f"potentiometers.{n}"), n) for n in _NAMES]
    zero = _array(top, "zero_us", 2) * _US
    matrix = np.radians(_array(top, "matrix_deg_per_us", 2, 2)) / _US
    if abs(np.linalg.det(matrix)) < 1e-3 * float(np.abs(matrix).max()) ** 2 or not matrix.any():
        raise CalibrationError("matrix_deg_per_us is singular; both servos move the same axis")
    bias = np.radians(_array(gyro, "bias_deg_s", 3)).tolist()
    gyro_matrix = _array(gyro, "matrix", 2, 2)
    if abs(np.linalg.det(gyro_matrix)) < 0.1:
        raise CalibrationError("gyro.matrix is singular")
    angles = np.radians(_array(top, "switch_angle_deg", 4)).tolist()
    scale = radians(1) / _US
    return Calibration(
        rig=_identity(top.get("rig")),
        zero=_pair(zero),
        matrix=_matrix(matrix),
        potentiometers=(maps[0], maps[1], maps[2], maps[3]),
        gyro=GyroMap(
            bias=(bias[0], bias[1], bias[2]),
            matrix=_matrix(gyro_matrix),
            sigma=float(_array(gyro, "sigma")),
            bias_sigma=radians(float(_array(gyro, "bias_sigma_deg_s"))),
        ),
        switch_angle=(angles[0], angles[1], angles[2], angles[3]),
        zero_covariance=_covariance(top, "zero_covariance_us2", np.full(2, _US)),
        matrix_covariance=_covariance(top, "matrix_covariance_deg2_per_us2", np.full(4, scale)),
        hysteresis=_pair(np.radians(_array(top, "hysteresis_deg", 2))),
        hysteresis_sigma=_pair(np.radians(_array(top, "hysteresis_sigma_deg", 2))),
        repeatability=_pair(np.radians(_array(top, "repeatability_deg", 2))),
    )


def _potentiometer(entry: dict[str, Any], name: str) -> PotentiometerMap:
    gain = radians(float(_array(entry, "gain_deg")))
    if abs(gain) < radians(10.0):
        raise CalibrationError(f"potentiometers.{name}.gain_deg is {degrees(gain):g}, too small")
    units = np.array([1.0, radians(1)])
    return PotentiometerMap(
        float(_array(entry, "zero")), gain, _covariance(entry, "covariance_deg", units)
    )


def _object(value: object, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise CalibrationError(f"{name} must be an object")
    return value


def _identity(value: object) -> int:
    if isinstance(value, str) and len(value) == 8:
        try:
            return int.from_bytes(bytes.fromhex(value))
        except ValueError:
            pass
    raise CalibrationError(f"rig is {value!r:.40}, must be eight hexadecimal digits")


def _numbers(entry: dict[str, Any], key: str, shape: tuple[int, ...]) -> "np.ndarray[Any, Any]":
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


def _array(entry: dict[str, Any], key: str, *shape: int) -> "np.ndarray[Any, Any]":
    values = _numbers(entry, key, shape)
    low, high = _LIMITS[key]
    if values.min() < low or values.max() > high:
        worst = values.max() if values.max() > high else values.min()
        raise CalibrationError(f"{key} holds {worst:g}, must be {low:g}…{high:g}")
    return values


def _covariance(entry: dict[str, Any], key: str, units: "np.ndarray[Any, Any]") -> Covariance:
    n = len(units)
    values = _numbers(entry, key, (n, n))
    size = np.sqrt(np.abs(np.diag(values))) + 1e-30
    normal = values / np.outer(size, size)
    sound = np.diag(values).min() >= 0 and np.allclose(normal, normal.T, atol=1e-6)
    if not sound or float(np.linalg.eigvalsh(normal).min()) < -1e-6:
        raise CalibrationError(f"{key} is not a covariance: not symmetric or not positive")
    return tuple(tuple(float(v) for v in row) for row in values * np.outer(units, units))


def _scaled(matrix: Covariance | Matrix, scale: float) -> list[list[float]]:
    return [[v * scale for v in row] for row in matrix]


def _congruent(matrix: Covariance, units: tuple[float, float]) -> list[list[float]]:
    return [[matrix[i][j] * units[i] * units[j] for j in (0, 1)] for i in (0, 1)]


def _pair(values: "np.ndarray[Any, Any]") -> Pair:
    return float(values[0]), float(values[1])


def _matrix(values: "np.ndarray[Any, Any]") -> Matrix:
    return _pair(values[0]), _pair(values[1])
