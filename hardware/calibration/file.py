"""A calibration as a JSON file: written beside and renamed, used only after every check.

Version 2 holds the whole map from angles to pulse widths; version 1 held a straight line, and is
read as one.
"""

import json
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from hardware.calibration.errors import CalibrationError
from hardware.calibration.fields import Array, array, covariance, identity, mapping, triangle
from hardware.calibration.linearisation import HIGHEST_DEGREE, Linearisation, Matrix, Rows
from hardware.calibration.result import Calibration, Covariance, GyroMap, PotentiometerMap
from hardware.frames import AXES, POTENTIOMETER_NAMES, Pair
from hardware.parts import POTENTIOMETER_TRAVEL

SCHEMA = "tvc-twin/calibration/2"
STRAIGHT = "tvc-twin/calibration/1"
LARGEST_FILE = 64 * 1024
LARGEST_TILT_ERROR = 0.2  # of the accelerometer's scale
_US = 1e-6
_PER_US = radians(1) / _US
_COMMAND = np.array([_US, _US, _PER_US, _PER_US, _PER_US, _PER_US])  # zero, matrix
_NAMES = tuple(name.removeprefix("potentiometer_") for name in POTENTIOMETER_NAMES)


def write(path: Path, calibration: Calibration) -> None:
    """Write a calibration; a file of that name is replaced as a whole.

    Raises
    ------
    CalibrationError : the file cannot be written, or `read` would refuse it
    """
    content = to_dict(calibration)
    from_dict(content)
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise CalibrationError(f"cannot write {path}: {error.strerror}") from None


def read(path: Path, rig: int | None = None) -> Calibration:
    """Read a calibration from a file of any origin.

    Parameters
    ----------
    path : JSON file
    rig : serial number of the board at hand; None takes any

    Raises
    ------
    CalibrationError : missing file, another format, implausible, or of another rig
    """
    try:
        if not path.is_file():  # a device or FIFO would not end
            path.stat()
            raise CalibrationError(f"cannot read {path}: not a regular file")
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}") from None
    if len(data) > LARGEST_FILE:
        raise CalibrationError(
            f"{path} is larger than {LARGEST_FILE} bytes, too large for a calibration"
        )
    calibration = parsed(data, str(path))
    if rig is not None and calibration.rig != rig:
        raise CalibrationError(
            f"{path} is of rig {calibration.rig:08x}, this one is {rig:08x}; "
            "run `twin calibrate` on it, or give the --unit that was calibrated"
        )
    return calibration


def parsed(data: bytes | str, name: str) -> Calibration:
    """Read a calibration from the text of a file.

    Parameters
    ----------
    name : of the file, for messages

    Raises
    ------
    CalibrationError : another format, or implausible
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
        "matrix_deg_per_us": [[v / _PER_US for v in row] for row in c.matrix],
        "covariance_us_deg_per_us": _in_units(c.covariance, _COMMAND),
        "linearisation": _linearisation_dict(c.linearisation),
        "hysteresis_deg": [degrees(v) for v in c.hysteresis],
        "hysteresis_sigma_deg": [degrees(v) for v in c.hysteresis_sigma],
        "repeatability_deg": [degrees(v) for v in c.repeatability],
        "deviation_deg": [degrees(v) for v in c.deviation],
        "switch_angle_deg": [degrees(v) for v in c.switch_angle],
        **_angles_dict(c),
        "gyro": {
            "bias_deg_s": [degrees(v) for v in c.gyro.bias],
            "matrix": [list(row) for row in c.gyro.matrix],
            "sigma": c.gyro.sigma,
            "bias_sigma_deg_s": degrees(c.gyro.bias_sigma),
        },
    }


def _angles_dict(c: Calibration) -> dict[str, Any]:
    """What shows the angles: four potentiometers, or the tilts of a rig without them."""
    if c.minimal:
        tilts = {
            axis: {
                "zero_deg": degrees(p.zero),
                "scale": p.gain,
                "covariance": _in_units(p.covariance, np.array([1.0, 1.0])),
            }
            for axis, p in zip(AXES, c.potentiometers[::2], strict=True)
        }
        return {"potentiometers": None, "accelerometer": tilts}
    units = np.array([1.0, radians(1)])
    return {
        # rounded, the flag's own value comes back: serial numbers of simulated rigs depend on it
        "potentiometer_deg": round(degrees(c.track), 9),
        "potentiometers": {
            name: {
                "zero": p.zero,
                "gain_deg": degrees(p.gain),
                "covariance_deg": _in_units(p.covariance, units),
            }
            for name, p in zip(_NAMES, c.potentiometers, strict=True)
        },
    }


def _linearisation_dict(map_: Linearisation) -> dict[str, Any]:
    return {
        "extent_deg": degrees(map_.extent),
        "sigma_deg": degrees(map_.sigma),
        "x_deg": [[degrees(a) for a in row] for row in map_.x],
        "y_deg": [[degrees(a) for a in row] for row in map_.y],
    }


def from_dict(content: object) -> Calibration:
    """Return the calibration of a file's content, of version 1 or 2.

    Raises
    ------
    CalibrationError : a key is missing, a value has another shape, is not finite or not plausible
    """
    top = mapping(content, "file")
    schema = top.get("schema")
    if schema not in (SCHEMA, STRAIGHT):
        raise CalibrationError(f"schema is {schema!r:.60}, must be {SCHEMA!r}")
    angles = np.radians(array(top, "switch_angle_deg", 4)).tolist()
    minimal = "potentiometers" in top and top["potentiometers"] is None
    if minimal:
        tilts = mapping(top.get("accelerometer"), "accelerometer")
        maps = [_tilt(mapping(tilts.get(n), f"accelerometer.{n}"), n) for n in "xxyy"]
    else:
        pots = mapping(top.get("potentiometers"), "potentiometers")
        maps = [_potentiometer(mapping(pots.get(n), f"potentiometers.{n}"), n) for n in _NAMES]
    return Calibration(
        rig=identity(top.get("rig")),
        zero=_pair(array(top, "zero_us", 2) * _US),
        matrix=_command_matrix(top),
        potentiometers=(maps[0], maps[1], maps[2], maps[3]),
        gyro=_gyro(mapping(top.get("gyro"), "gyro")),
        switch_angle=(angles[0], angles[1], angles[2], angles[3]),
        covariance=_covariance(top),
        hysteresis=_pair(np.radians(array(top, "hysteresis_deg", 2))),
        hysteresis_sigma=_pair(np.radians(array(top, "hysteresis_sigma_deg", 2))),
        repeatability=_pair(np.radians(array(top, "repeatability_deg", 2))),
        deviation=_deviation(top),
        linearisation=_linearisation(top),
        minimal=minimal,
        track=_track(top),
    )


def _track(top: dict[str, Any]) -> float:
    if "potentiometer_deg" not in top:  # of a minimal rig, and in older files
        return POTENTIOMETER_TRAVEL
    return radians(float(array(top, "potentiometer_deg")))


def _command_matrix(top: dict[str, Any]) -> Matrix:
    matrix = array(top, "matrix_deg_per_us", 2, 2) * _PER_US
    if abs(np.linalg.det(matrix)) < 1e-3 * float(np.abs(matrix).max()) ** 2 or not matrix.any():
        raise CalibrationError("matrix_deg_per_us is singular; both servos move the same axis")
    return _matrix(matrix)


def _covariance(top: dict[str, Any]) -> Covariance:
    if top["schema"] == SCHEMA:
        return covariance(top, "covariance_us_deg_per_us", _COMMAND)
    joint = np.zeros((6, 6))  # version 1 kept no correlation of zero and matrix
    joint[:2, :2] = covariance(top, "zero_covariance_us2", _COMMAND[:2])
    joint[2:, 2:] = covariance(top, "matrix_covariance_deg2_per_us2", _COMMAND[2:])
    return _nested(joint)


def _deviation(top: dict[str, Any]) -> Pair:
    return (
        (0.0, 0.0)
        if top["schema"] == STRAIGHT
        else _pair(np.radians(array(top, "deviation_deg", 2)))
    )


def _linearisation(top: dict[str, Any]) -> Linearisation:
    if top["schema"] == STRAIGHT:
        return Linearisation()
    entry = mapping(top.get("linearisation"), "linearisation")
    return Linearisation(
        x=_rows(entry, "x_deg"),
        y=_rows(entry, "y_deg"),
        extent=radians(float(array(entry, "extent_deg"))),
        sigma=radians(float(array(entry, "sigma_deg"))),
    )


def _rows(entry: dict[str, Any], key: str) -> Rows:
    return tuple(
        tuple(np.radians(row).tolist()) for row in triangle(entry, key, HIGHEST_DEGREE - 1)
    )


def _gyro(entry: dict[str, Any]) -> GyroMap:
    bias = np.radians(array(entry, "bias_deg_s", 3)).tolist()
    matrix = array(entry, "matrix", 2, 2)
    if abs(np.linalg.det(matrix)) < 0.1:
        raise CalibrationError("gyro.matrix is singular")
    return GyroMap(
        bias=(bias[0], bias[1], bias[2]),
        matrix=_matrix(matrix),
        sigma=float(array(entry, "sigma")),
        bias_sigma=radians(float(array(entry, "bias_sigma_deg_s"))),
    )


def _potentiometer(entry: dict[str, Any], name: str) -> PotentiometerMap:
    gain = radians(float(array(entry, "gain_deg")))
    if abs(gain) < radians(10.0):
        raise CalibrationError(f"potentiometers.{name}.gain_deg is {degrees(gain):g}, too small")
    units = np.array([1.0, radians(1)])
    return PotentiometerMap(
        float(array(entry, "zero")), gain, covariance(entry, "covariance_deg", units)
    )


def _tilt(entry: dict[str, Any], axis: str) -> PotentiometerMap:
    scale = float(array(entry, "scale"))
    if not abs(scale - 1.0) < LARGEST_TILT_ERROR:
        raise CalibrationError(f"accelerometer.{axis}.scale is {scale:g}, must be near 1")
    zero = radians(float(array(entry, "zero_deg")))
    return PotentiometerMap(zero, scale, covariance(entry, "covariance", np.array([1.0, 1.0])))


def _in_units(matrix: Covariance, units: Array) -> list[list[float]]:
    values: list[list[float]] = (np.array(matrix) / np.outer(units, units)).tolist()
    return values


def _nested(matrix: Array) -> Covariance:
    return tuple(tuple(float(v) for v in row) for row in matrix)


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])


def _matrix(values: Array) -> Matrix:
    return _pair(values[0]), _pair(values[1])
