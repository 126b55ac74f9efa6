"""The loop equations of the two pushrods, compiled for use in a control tick.

A loop is a row of `SIZE` numbers: anchor of x, anchor of y, ball on the holder, anchor of the
servo, ball on the horn, axes of x, y and servo (3 each, home pose, frame of the mount), length of
the rod, branch.
"""

import math

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
SIZE = 26
LENGTH, BRANCH = 24, 25
ITERATIONS, SOLVED = 20, 1e-13  # rad; 5 iterations are usual


def pack(geometry: Array, length: float) -> Array:
    """Row without its branch from 8 vectors and the rod's length."""
    return np.append(geometry, length)


@njit()
def _turn(ux: float, uy: float, uz: float, angle: float, x: float, y: float, z: float) -> Vector:
    """Rotate (x, y, z) about the unit vector u: Rodrigues."""
    c, s = math.cos(angle), math.sin(angle)
    k = (ux * x + uy * y + uz * z) * (1 - c)
    return (
        c * x + s * (uy * z - uz * y) + k * ux,
        c * y + s * (uz * x - ux * z) + k * uy,
        c * z + s * (ux * y - uy * x) + k * uz,
    )


@njit()
def _ball(g: Array, x: float, y: float) -> Vector:
    """Ball on the holder at gimbal angles x, y: about the inner axis, then about the outer."""
    px, py, pz = _turn(g[18], g[19], g[20], y, g[6] - g[3], g[7] - g[4], g[8] - g[5])
    px, py, pz = _turn(g[15], g[16], g[17], x, px + g[3] - g[0], py + g[4] - g[1], pz + g[5] - g[2])
    return px + g[0], py + g[1], pz + g[2]


@njit()
def _servo(g: Array, x: float, y: float) -> tuple[float, float]:
    """Servo angle, and the excess over 1 of its cosine (≤ 0 within reach)."""
    px, py, pz = _ball(g, x, y)
    dx, dy, dz = px - g[9], py - g[10], pz - g[11]
    ax, ay, az = g[12] - g[9], g[13] - g[10], g[14] - g[11]
    wx, wy, wz = g[21], g[22], g[23]
    along = ax * wx + ay * wy + az * wz
    dx, dy, dz = dx - along * wx, dy - along * wy, dz - along * wz
    ax, ay, az = ax - along * wx, ay - along * wy, az - along * wz
    a = dx * ax + dy * ay + dz * az
    b = dx * (wy * az - wz * ay) + dy * (wz * ax - wx * az) + dz * (wx * ay - wy * ax)
    square = dx * dx + dy * dy + dz * dz + ax * ax + ay * ay + az * az - g[24] * g[24]
    cosine = square / (2 * math.hypot(a, b))
    angle = math.atan2(b, a) + g[25] * math.acos(min(1.0, max(-1.0, cosine)))
    return angle - 2 * math.pi * math.floor((angle + math.pi) / (2 * math.pi)), abs(cosine) - 1


@njit()
def servo_pair(loops: Array, x: float, y: float) -> tuple[float, float]:
    """Servo angles (x, y) [rad] for gimbal angles, clipped to the reach of the rods."""
    return _servo(loops[0], x, y)[0], _servo(loops[1], x, y)[0]


@njit()
def servo_angles(loops: Array, gimbal: Array) -> Array:
    """Servo angles (n, 2) for gimbal angles (n, 2) [rad], NaN beyond reach."""
    out = np.empty_like(gimbal)
    for n in range(len(gimbal)):
        for k in range(2):
            angle, beyond = _servo(loops[k], gimbal[n, 0], gimbal[n, 1])
            out[n, k] = angle if beyond <= 0 else math.nan
    return out


@njit()
def _residual(g: Array, x: float, y: float, servo: float) -> Vector:
    """`|p - h|² - L²` of one loop and its slopes over x and y."""
    px, py, pz = _ball(g, x, y)
    hx, hy, hz = _turn(g[21], g[22], g[23], servo, g[12] - g[9], g[13] - g[10], g[14] - g[11])
    dx, dy, dz = px - hx - g[9], py - hy - g[10], pz - hz - g[11]
    # velocity of the ball: outer axis at its anchor, inner axis carried by the outer rotation
    rx, ry, rz = px - g[0], py - g[1], pz - g[2]
    slope_x = (
        dx * (g[16] * rz - g[17] * ry)
        + dy * (g[17] * rx - g[15] * rz)
        + dz * (g[15] * ry - g[16] * rx)
    )
    ux, uy, uz = _turn(g[15], g[16], g[17], x, g[18], g[19], g[20])
    ox, oy, oz = _turn(g[15], g[16], g[17], x, g[3] - g[0], g[4] - g[1], g[5] - g[2])
    rx, ry, rz = rx - ox, ry - oy, rz - oz
    slope_y = dx * (uy * rz - uz * ry) + dy * (uz * rx - ux * rz) + dz * (ux * ry - uy * rx)
    return dx * dx + dy * dy + dz * dz - g[24] * g[24], 2 * slope_x, 2 * slope_y


@njit()
def _gimbal(loops: Array, servo_x: float, servo_y: float) -> tuple[float, float]:
    """Newton from home on both loops at once."""
    x, y = 0.0, 0.0
    for _ in range(ITERATIONS):
        f, fx, fy = _residual(loops[0], x, y, servo_x)
        e, ex, ey = _residual(loops[1], x, y, servo_y)
        determinant = fx * ey - fy * ex
        if determinant == 0:
            return math.nan, math.nan
        step_x, step_y = (f * ey - fy * e) / determinant, (fx * e - f * ex) / determinant
        x, y = x - step_x, y - step_y
        if abs(step_x) + abs(step_y) < SOLVED:
            return x, y
    return math.nan, math.nan


@njit()
def gimbal_angles(loops: Array, servo: Array) -> Array:
    """Gimbal angles (n, 2) for servo angles (n, 2) [rad], NaN where Newton does not converge."""
    out = np.empty_like(servo)
    for n in range(len(servo)):
        out[n, 0], out[n, 1] = _gimbal(loops, servo[n, 0], servo[n, 1])
    return out
