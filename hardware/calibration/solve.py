"""Switch events to maps with covariance: one weighted least-squares problem per axis.

At an event of switch s the axis stands at θ = ±(α_s + ε_s), less the switch's differential travel
δ when it opened. Command, with d the direction of motion, and each potentiometer then say

    M p − c − d h/2 = θ        f = o + k (M p' − c − d h/2)

for matrix row M, offset c, hysteresis h, and the pulses p' at which it came to rest behind the
switch; there a potentiometer knows nothing of where in its last step the servo met the switch. The
angles ε are held by how well the rig was built.
"""

from dataclasses import dataclass
from math import cos, degrees, radians, sqrt

import numpy as np
from numpy.typing import NDArray

from hardware.calibration.log import SWITCHES, CalibrationRig, Event, Log
from hardware.calibration.result import (
    Calibration,
    CalibrationError,
    Covariance,
    GyroMap,
    PotentiometerMap,
)
from hardware.frames import Pair

Array = NDArray[np.float64]

TRAVEL = radians(240.0)
LARGEST_SPREAD = radians(0.4)  # of one switch's approaches; dead band and quantisation give 0.1°
COARSE_SIGMA = radians(0.1)
GYRO_TOLERANCE = 0.06  # scale ±3 % by the data sheet, and as much again
M1, M2, C, H, DELTA, PLUS, MINUS, OA, KA, OB, KB = range(11)


@dataclass(frozen=True, slots=True)
class _Axis:
    """Solution of one axis; parameters in the order of the constants above."""

    value: Array  # (11,)
    covariance: Array  # (11, 11)
    scatter: Array  # residual of the command equation per event [rad]
    repeatability: float


def solve(log: Log, rig: CalibrationRig, identity: int) -> Calibration:
    """Return the calibration that a run's events give.

    Raises
    ------
    CalibrationError : implausible; the message names the switch or sensor
    """
    axes = (_solve_axis(log, rig, 0), _solve_axis(log, rig, 1))
    for index, axis in enumerate(axes):
        _check_axis(index, axis, log, rig)
    x, y = axes
    matrix = np.array([x.value[[M1, M2]], y.value[[M1, M2]]])
    if abs(np.linalg.det(matrix)) < 0.5 * abs(matrix[0, 0] * matrix[1, 1]):
        raise CalibrationError("both servos move the same axis; check linkage and servo plugs")
    zero = np.linalg.solve(matrix, np.array([x.value[C], y.value[C]]))
    gyro = _gyro(log, axes, rig)
    maps = _maps(x) + _maps(y)
    return Calibration(
        rig=identity,
        zero=_pair(zero),
        matrix=(_pair(matrix[0]), _pair(matrix[1])),
        potentiometers=(maps[0], maps[1], maps[2], maps[3]),
        gyro=gyro,
        switch_angle=rig.switch_angle,
        zero_covariance=_nested(_zero_covariance(axes, matrix, zero)),
        matrix_covariance=_nested(_matrix_covariance(axes)),
        hysteresis=(float(x.value[H]), float(y.value[H])),
        hysteresis_sigma=(sqrt(x.covariance[H, H]), sqrt(y.covariance[H, H])),
        repeatability=(x.repeatability, y.repeatability),
    )


def _pair(values: Array) -> Pair:
    return float(values[0]), float(values[1])


def _nested(matrix: Array) -> Covariance:
    return tuple(tuple(float(v) for v in row) for row in matrix)


def _events(log: Log, axis: int) -> list[Event]:
    return [e for e in log.events if e.switch // 2 == axis]


@dataclass(frozen=True, slots=True)
class _Table:
    """Events of one axis as arrays (n,) or (n, 2)."""

    sign: Array  # +1 at the positive switch
    opened: Array  # 1 when it opened
    pulses: Array  # (n, 2) [s]
    settled: Array  # (n, 2) where the sensors were read [s]
    readings: Array  # (n, 2) [1]
    nominal: Array  # closing angle of its switch [rad]


def _table(log: Log, rig: CalibrationRig, axis: int) -> _Table:
    events = _events(log, axis)
    return _Table(
        sign=np.array([1.0 if e.switch % 2 == 0 else -1.0 for e in events]),
        opened=np.array([0.0 if e.closed else 1.0 for e in events]),
        pulses=np.array([e.pulses for e in events]),
        settled=np.array([e.settled for e in events]),
        readings=np.array([e.potentiometer[2 * axis : 2 * axis + 2] for e in events]),
        nominal=np.array([rig.switch_angle[e.switch] for e in events]),
    )


def _angles(v: Array, t: _Table) -> Array:
    error = np.where(t.sign > 0, v[PLUS], v[MINUS])
    angles: Array = t.nominal + error - t.sign * t.opened * v[DELTA]
    return angles


def _follow(v: Array, t: _Table, pulses: Array) -> Array:
    """Angles (n,) [rad] that pulses (n, 2) about the centre [s] lead to, hysteresis included."""
    way = t.sign * (1 - 2 * t.opened)  # direction of motion along the axis
    angles: Array = pulses @ v[[M1, M2]] - v[C] - way * v[H] / 2
    return angles


def _residuals(v: Array, t: _Table, centre: Array) -> tuple[Array, Array, Array]:
    """Return command residuals [rad] and both potentiometers' [1], each (n,)."""
    rest = _follow(v, t, t.settled - centre)
    return (
        _follow(v, t, t.pulses - centre) - _angles(v, t),
        t.readings[:, 0] - v[OA] - v[KA] * rest,
        t.readings[:, 1] - v[OB] - v[KB] * rest,
    )


def _solve_axis(log: Log, rig: CalibrationRig, axis: int) -> _Axis:
    t = _table(log, rig, axis)
    centre = np.array(rig.neutral)
    v = _first_guess(t, centre)
    sigma = np.array([COARSE_SIGMA, 5e-4, 5e-4])
    n, dof = len(t.sign), max(1.0, len(t.sign) - 4.0)
    covariance = np.eye(11)
    for _ in range(6):
        scale = np.repeat(1 / sigma, n)
        r = np.concatenate(_residuals(v, t, centre)) * scale
        J = _jacobian(v, t, centre) * scale[:, None]
        prior = np.zeros((2, 11))
        prior[0, PLUS] = prior[1, MINUS] = 1 / rig.switch_sigma
        J, r = np.vstack([J, prior]), np.concatenate([r, prior @ v])
        # Columns differ by orders of magnitude: scaled, or the rank is misjudged.
        size = np.linalg.norm(J, axis=0)
        v = v - np.linalg.lstsq(J / size, r, rcond=None)[0] / size
        inverse = np.linalg.pinv((J / size).T @ (J / size))
        covariance = inverse / np.outer(size, size)
        parts = _residuals(v, t, centre)
        floor = (rig.fine * abs(v[M1 + axis]) / sqrt(12.0), 1e-5, 1e-5)
        sigma = np.array([max(f, sqrt(p @ p / dof)) for p, f in zip(parts, floor, strict=True)])
    # c was measured about the neutral pulses; bring it to zero pulse width.
    shift = np.eye(11)
    shift[C, [M1, M2]] = centre
    v, covariance = shift @ v, shift @ covariance @ shift.T
    return _Axis(v, covariance, parts[0], float(sigma[0]))


def _first_guess(t: _Table, centre: Array) -> Array:
    v = np.zeros(11)
    A = np.column_stack([t.pulses - centre, -np.ones(len(t.sign))])
    size = np.array([1e-4, 1e-4, 1.0])  # columns of equal order
    v[[M1, M2, C]] = np.linalg.lstsq(A * [1e4, 1e4, 1], t.nominal, rcond=None)[0] / size
    for o, k, column in ((OA, KA, 0), (OB, KB, 1)):
        k_value, o_value = np.polyfit(t.nominal, t.readings[:, column], 1)
        v[o], v[k] = o_value, k_value
    return v


def _jacobian(v: Array, t: _Table, centre: Array) -> Array:
    """Return the derivative of the stacked residuals (3n, 11)."""
    angle = np.zeros((len(t.sign), 11))
    angle[:, PLUS], angle[:, MINUS] = t.sign > 0, t.sign < 0
    angle[:, DELTA] = -t.sign * t.opened
    stacked = [_slope(t, t.pulses - centre) - angle]
    rest, slope = _follow(v, t, t.settled - centre), _slope(t, t.settled - centre)
    for o, k in ((OA, KA), (OB, KB)):
        rows = -v[k] * slope
        rows[:, o], rows[:, k] = -1, -rest
        stacked.append(rows)
    return np.vstack(stacked)


def _slope(t: _Table, pulses: Array) -> Array:
    """Return the derivative of `_follow` (n, 11)."""
    rows = np.zeros((len(t.sign), 11))
    rows[:, [M1, M2]], rows[:, C] = pulses, -1
    rows[:, H] = -t.sign * (1 - 2 * t.opened) / 2
    return rows


def _maps(axis: _Axis) -> list[PotentiometerMap]:
    maps = []
    for o, k in ((OA, KA), (OB, KB)):
        gain = 1 / axis.value[k]
        # zero = o; gain = 1/k
        J = np.array([[1.0, 0.0], [0.0, -gain * gain]])
        covariance = J @ axis.covariance[np.ix_([o, k], [o, k])] @ J.T
        maps.append(PotentiometerMap(float(axis.value[o]), float(gain), _nested(covariance)))
    return maps


def _zero_covariance(axes: tuple[_Axis, _Axis], matrix: Array, zero: Array) -> Array:
    inverse = np.linalg.inv(matrix)
    total = np.zeros((2, 2))
    for row, axis in enumerate(axes):
        # δzero = M⁻¹ (δc − δM · zero), one axis at a time: their events are independent.
        g = np.concatenate([-zero, [1.0]])
        variance = g @ axis.covariance[np.ix_([M1, M2, C], [M1, M2, C])] @ g
        total += np.outer(inverse[:, row], inverse[:, row]) * variance
    return total


def _matrix_covariance(axes: tuple[_Axis, _Axis]) -> Array:
    total = np.zeros((4, 4))
    for row, axis in enumerate(axes):
        total[2 * row : 2 * row + 2, 2 * row : 2 * row + 2] = axis.covariance[:2, :2]
    return total


def _gyro(log: Log, axes: tuple[_Axis, _Axis], rig: CalibrationRig) -> GyroMap:
    """Return scale and misalignment from the motions between switches."""
    centre = np.array(log.gyro_bias)
    angle = [_stand(e, axes) for e in log.events]
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


def _stand(event: Event, axes: tuple[_Axis, _Axis]) -> Pair:
    """Return both angles at an event by the potentiometers [rad]."""
    angles = []
    for k, axis in enumerate(axes):
        a, b = event.potentiometer[2 * k], event.potentiometer[2 * k + 1]
        v = axis.value
        angles.append(((a - v[OA]) / v[KA] + (b - v[OB]) / v[KB]) / 2)
    return angles[0], angles[1]


def _check_axis(index: int, axis: _Axis, log: Log, rig: CalibrationRig) -> None:
    events = _events(log, index)
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
            f"servo {'yx'[index]} moves axis {'xy'[index]} more than its own; servos are swapped"
        )
    for k, name in ((KA, "a"), (KB, "b")):
        turned = abs(axis.value[k]) * TRAVEL
        if not 0.8 < turned < 1.25:
            apart = degrees(rig.switch_angle[2 * index] - rig.switch_angle[2 * index + 1])
            raise CalibrationError(
                f"potentiometer_{'xy'[index]}_{name} turned {apart * turned:.1f}° between switches "
                f"{SWITCHES[2 * index]} and {SWITCHES[2 * index + 1]}, which are {apart:.1f}° "
                "apart; it is loose, not wired, or a switch is misplaced"
            )
