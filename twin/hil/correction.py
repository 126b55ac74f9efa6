"""The mechanism's exact kinematics on top of a calibration that only knows straight lines.

A calibration drives to four limit switches and draws a straight line from pulses to angles. Horns
and rods bend it: the shipped mechanism needs 20.7° of shaft for +9° and 24.3° for −9°, so a
straight line through the switches is 0.7° off in between. The bend is known from the drawings.
With k(a) the exact shaft angles of gimbal angles a, and a ≈ L·(k − k₀) the straight line through
the switch angles, a calibration measures pulses = z + S·k with any servo zero z and travel S as the
line M = L·S⁻¹, zero z + S·k₀. Asking it for L·(k(a) − k₀) in place of a therefore gives z + S·k(a).
"""

from math import radians

import numpy as np
from numpy.typing import NDArray

from hardware.frames import Pair
from twin.physics.mechanism import Kinematics

Array = NDArray[np.float64]
BESIDE = radians(40e-6 / 10.3e-6)  # shaft of the other servo meanwhile, `CalibrationRig.offsets`
_RATIO, _ROUNDS = 0.4, 12  # gimbal per shaft, roughly; the search gains 0.9 digits a round


class Drawing:
    """Straight line and bend of one mechanism.

    Parameters
    ----------
    kinematics : of the mechanism
    switches : angles at which a calibration's switches +x, −x, +y, −y close [rad]

    Attributes
    ----------
    matrix, shaft : L (2, 2) and k₀ (2,) [1], [rad]
    """

    def __init__(self, kinematics: Kinematics, switches: tuple[float, float, float, float]) -> None:
        self._kinematics = kinematics
        seen, shafts = _standing(kinematics, switches)
        # A switch tells one angle only, the one it stands for: each row of L by its own switches.
        self.matrix, self.shaft = _lines(seen, shafts)
        self._forward = [[float(v) for v in row] for row in self.matrix]
        self._middle = float(self.shaft[0]), float(self.shaft[1])

    def straightened(self, angle: Pair) -> Pair:
        """What to ask a straight-line calibration for, to get a gimbal angle [rad]."""
        x, y = self._kinematics.servo_from_gimbal_fast(*angle)
        u, v = x - self._middle[0], y - self._middle[1]
        (a, b), (c, d) = self._forward
        return a * u + b * v, c * u + d * v

    def bent(self, angle: Pair) -> Pair:
        """The inverse: the gimbal angle at which a straight-line calibration says `angle` [rad]."""
        shafts = np.linalg.solve(self.matrix, np.array(angle)) + self.shaft
        x, y = self._kinematics.gimbal_from_servo(shafts).tolist()
        return x, y


def _standing(
    kinematics: Kinematics, switches: tuple[float, float, float, float]
) -> tuple[Array, Array]:
    """Gimbal angles and shafts (12, 2) at each switch, the other servo at its three places."""
    angles = np.zeros((12, 2))
    held = np.tile([0.0, BESIDE, -BESIDE], 4)
    own = np.repeat([0, 0, 1, 1], 3)
    rows = np.arange(12)
    angles[rows, own] = np.repeat(switches, 3)
    for _ in range(_ROUNDS):
        held_apart = held - kinematics.servo_from_gimbal(angles)[rows, 1 - own]
        angles[rows, 1 - own] += _RATIO * held_apart
    return angles, kinematics.servo_from_gimbal(angles)


def _lines(angles: Array, shafts: Array) -> tuple[Array, Array]:
    """L and k₀ of the lines that are exact in the mean at each axis's own switches."""
    half = len(angles) // 2
    rows, offsets = np.zeros((2, 2)), np.zeros(2)
    for axis, own in enumerate((slice(0, half), slice(half, None))):
        design = np.column_stack([shafts[own], np.ones(half)])
        *slope, constant = np.linalg.lstsq(design, angles[own, axis], rcond=None)[0].tolist()
        rows[axis], offsets[axis] = slope, constant
    middle: Array = -np.linalg.solve(rows, offsets).astype(np.float64)
    return rows, middle
