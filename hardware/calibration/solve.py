"""Switch events of a calibration run to a calibration, with covariance and plausibility checks."""

from math import cos, degrees, radians, sqrt

import numpy as np

from hardware.calibration.axis import (
    KA,
    KB,
    M1,
    M2,
    MINUS,
    OA,
    OB,
    PLUS,
    Array,
    Axis,
    C,
    H,
    events_of,
    first_guess,
    solve_axis,
    stand,
    tabulate,
)
from hardware.calibration.errors import CalibrationError
from hardware.calibration.log import SWITCHES, CalibrationRig, Log
from hardware.calibration.potentiometers import check_readings, check_tracks
from hardware.calibration.result import Calibration, Covariance, GyroMap, PotentiometerMap
from hardware.frames import AXES, Pair

LARGEST_SPREAD = radians(0.4)  # of one switch's approaches; dead band and quantisation give 0.1°
TILT_TOLERANCE = 0.1  # scale ±3 % and across ±2 %, MPU-6050 product specification 6.2, twice
GYRO_TOLERANCE = 0.06  # scale ±3 % by the data sheet, and as much again
PASSES = 2  # the other axis's angle enters little: 0.1° of it moves a linearised angle by 0.01°


def solve(log: Log, rig: CalibrationRig, identity: int) -> Calibration:
    """Return the calibration of a run's events.

    Raises
    ------
    CalibrationError : implausible; the message names the switch or sensor
    """
    if not rig.minimal:
        check_readings(log, rig)
    axes = _axes(log, rig)
    for index, axis in enumerate(axes):
        _check_axis(index, axis, log, rig)
    x, y = axes
    matrix = np.array([x.value[[M1, M2]], y.value[[M1, M2]]])
    if abs(np.linalg.det(matrix)) < 0.5 * abs(matrix[0, 0] * matrix[1, 1]):
        raise CalibrationError("both servos move the same axis; check linkage and servo plugs")
    zero = np.linalg.solve(matrix, np.array([x.value[C], y.value[C]]))
    maps = _maps(x, minimal=rig.minimal) + _maps(y, minimal=rig.minimal)
    return Calibration(
        rig=identity,
        zero=_pair(zero),
        matrix=(_pair(matrix[0]), _pair(matrix[1])),
        potentiometers=(maps[0], maps[1], maps[2], maps[3]),
        gyro=_gyro(log, axes, rig),
        switch_angle=rig.switch_angle,
        covariance=_nested(_covariance(axes, matrix, zero)),
        hysteresis=(float(x.value[H]), float(y.value[H])),
        hysteresis_sigma=(sqrt(x.covariance[H, H]), sqrt(y.covariance[H, H])),
        repeatability=(x.repeatability, y.repeatability),
        deviation=_deviation(log, axes, rig),
        linearisation=rig.linearisation,
        minimal=rig.minimal,
        track=rig.track,
    )


def _axes(log: Log, rig: CalibrationRig) -> tuple[Axis, Axis]:
    """Solve both axes, each with the other where its potentiometers show it."""
    x, y = tabulate(log, rig, 0), tabulate(log, rig, 1)
    values = guess = first_guess(x), first_guess(y)
    for _ in range(PASSES):
        other_x = np.array([stand(e, values)[1] for e in events_of(log, 0)])
        other_y = np.array([stand(e, values)[0] for e in events_of(log, 1)])
        axes = solve_axis(x, guess[0], other_x), solve_axis(y, guess[1], other_y)
        values = axes[0].value, axes[1].value
    return axes


def _deviation(log: Log, axes: tuple[Axis, Axis], rig: CalibrationRig) -> Pair:
    """Root mean square of potentiometers against the map, where each axis stood held [rad]."""
    values = axes[0].value, axes[1].value
    result = []
    for k, v in enumerate(values):
        places: dict[tuple[int, int], list[tuple[int, float]]] = {}
        for event in events_of(log, 1 - k):
            seen = rig.linearisation.linearised(stand(event, values))[k]
            commanded = float(v[[M1, M2]] @ event.settled - v[C])
            place = event.switch, round(event.settled[k] / rig.fine)
            places.setdefault(place, []).append((event.came, seen - commanded))
        result.append(sqrt(np.mean([_mean(p, float(v[H])) ** 2 for p in places.values()])))
    return result[0], result[1]


def _mean(place: list[tuple[int, float]], hysteresis: float) -> float:
    """Mean of both approach directions; half the hysteresis stands in for one that is missing."""
    ways = [[d for came, d in place if came == way] for way in (1, -1)]
    if all(ways):
        return float(np.mean([np.mean(way) for way in ways]))
    return float(np.mean([d + came * hysteresis / 2 for came, d in place]))


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])


def _nested(matrix: Array) -> Covariance:
    return tuple(tuple(float(v) for v in row) for row in matrix)


def _maps(axis: Axis, *, minimal: bool = False) -> list[PotentiometerMap]:
    maps = []
    for o, k in ((OA, KA), (OA, KA) if minimal else (OB, KB)):
        gain = 1 / axis.value[k]
        # zero = o; gain = 1/k
        J = np.array([[1.0, 0.0], [0.0, -gain * gain]])
        covariance = J @ axis.covariance[np.ix_([o, k], [o, k])] @ J.T
        maps.append(PotentiometerMap(float(axis.value[o]), float(gain), _nested(covariance)))
    return maps


def _covariance(axes: tuple[Axis, Axis], matrix: Array, zero: Array) -> Array:
    """Covariance of (zero, matrix) (6, 6); the axes' events are independent."""
    inverse = np.linalg.inv(matrix)
    total = np.zeros((6, 6))
    for row, axis in enumerate(axes):
        # δzero = M⁻¹ (δc − δM · zero)
        J = np.zeros((6, 3))
        J[:2] = np.outer(inverse[:, row], [-zero[0], -zero[1], 1.0])
        J[2 + 2 * row, 0] = J[3 + 2 * row, 1] = 1.0
        total += J @ axis.covariance[np.ix_([M1, M2, C], [M1, M2, C])] @ J.T
    return total


def _gyro(log: Log, axes: tuple[Axis, Axis], rig: CalibrationRig) -> GyroMap:
    """Return scale and misalignment from the motions between switches."""
    centre = np.array(log.gyro_bias)
    values = axes[0].value, axes[1].value
    angle = [stand(e, values) for e in log.events]
    moves, readings = [], []
    for before, after, a, b in zip(
        log.events[:-1], log.events[1:], angle[:-1], angle[1:], strict=True
    ):
        duration = after.time - before.time
        if abs(b[0] - a[0]) + abs(b[1] - a[1]) < radians(3.0) or duration > 10:
            continue
        cosine = cos((a[1] + b[1]) / 2)
        moves.append(((b[0] - a[0]) * cosine, b[1] - a[1], duration))
        change = np.array(after.gyro) - np.array(before.gyro) - centre * duration
        readings.append(change[:2])
    A, B = np.array(moves), np.array(readings)
    solution, _, rank, _ = np.linalg.lstsq(A, B, rcond=None)
    if rank < 3:
        raise CalibrationError("the gyro saw no motion; check the holder IMU at 0x68")
    rest = B - A @ solution
    sigma = sqrt(float((rest**2).sum()) / max(1, rest.size - 6))
    spread = np.linalg.inv(A.T @ A)
    matrix = solution[:2].T
    for i in range(2):
        scale = float(matrix[i, i])
        if abs(scale - 1) > GYRO_TOLERANCE:
            apart = degrees(rig.switch_angle[2 * i] - rig.switch_angle[2 * i + 1])
            raise CalibrationError(
                f"switches {SWITCHES[2 * i]} and {SWITCHES[2 * i + 1]} are {apart * scale:.1f}° "
                f"apart by the gyro, {apart:.1f}° by the calibration rig; one of them is misplaced "
                "or the holder IMU is mounted another way round"
            )
    x, y, z = centre.tolist()
    dx, dy = solution[2].tolist()
    return GyroMap(
        bias=(x + dx, y + dy, z),
        matrix=(_pair(matrix[0]), _pair(matrix[1])),
        sigma=max(1e-3, sigma * sqrt(float(spread[:2, :2].diagonal().max()))),
        bias_sigma=radians(1.0),  # it drifts from day to day, mostly with temperature
    )


def _check_axis(index: int, axis: Axis, log: Log, rig: CalibrationRig) -> None:
    events = events_of(log, index)
    for switch in (2 * index, 2 * index + 1):
        scatter = [r for r, e in zip(axis.scatter, events, strict=True) if e.switch == switch]
        spread = float(np.std(scatter))
        if spread > LARGEST_SPREAD:
            raise CalibrationError(
                f"switch {SWITCHES[switch]} is not repeatable: {degrees(spread):.2f}° between "
                f"approaches, expected less than {degrees(LARGEST_SPREAD):.1f}°; is it loose?"
            )
        off = axis.value[PLUS if switch % 2 == 0 else MINUS]
        if abs(off) > 5 * rig.switch_sigma:
            raise CalibrationError(
                f"switch {SWITCHES[switch]} closes {degrees(off):+.2f}° from where the calibration "
                "rig should hold it"
            )
    if abs(axis.value[M1 + index]) < abs(axis.value[M2 - index]):
        raise CalibrationError(
            f"servo {AXES[1 - index]} moves axis {AXES[index]} more than servo {AXES[index]} does;"
            " servos are swapped"
        )
    if rig.minimal:
        _check_tilt(index, float(axis.value[KA]), rig)
    else:
        check_tracks(index, axis.value, log, rig)


def _check_tilt(index: int, scale: float, rig: CalibrationRig) -> None:
    if abs(scale - 1) > TILT_TOLERANCE:
        apart = degrees(rig.switch_angle[2 * index] - rig.switch_angle[2 * index + 1])
        raise CalibrationError(
            f"the holder's accelerometer saw {apart * scale:.1f}° about {AXES[index]} between"
            f" switches {apart:.1f}° apart; the rig must stand upright, and the IMU's x and y along"
            " the gimbal's axes"
        )
