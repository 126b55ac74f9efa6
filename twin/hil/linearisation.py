"""A mechanism's kinematics as the linearisation that a calibration carries."""

from dataclasses import dataclass
from itertools import pairwise
from math import radians

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.calibration import Linearisation
from hardware.frames import AXES
from twin.errors import TwinError
from twin.physics.mechanism import Kinematics

Array = NDArray[np.float64]

DEGREE = 5  # 0.004° off at worst over ±10° on the shipped mechanism; 4 is 0.016° off
NODES = 2 * DEGREE + 6  # Chebyshev nodes per axis: close to the least largest error
UNLIMITED = radians(10.0)  # extent for a joint without stops
SMALLEST, LARGEST = radians(1.0), radians(45.0)


@dataclass(frozen=True)
class MechanismMap:
    """Gimbal angles to servo shafts: `shaft = offset + matrix @ linearised(angle)`.

    Attributes
    ----------
    linearisation : fitted to the kinematics between the stops
    matrix : shaft per gimbal angle at zero, rows servos, (2, 2) [1]
    offset : shafts at zero angle (2,) [rad]
    """

    linearisation: Linearisation
    matrix: Array
    offset: Array


def mechanism_map(model: mujoco.MjModel) -> MechanismMap:
    """Fit a polynomial to the kinematics of a bench scene's mechanism.

    Raises
    ------
    TwinError : the rods reach too few angles between the stops
    hardware.calibration.CalibrationError : the kinematics are not monotone between the stops
    """
    extent = _extent(model)
    place = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    nodes = np.stack(np.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 2)
    shafts = Kinematics(model).servo_from_gimbal(nodes * extent)
    reached = np.isfinite(shafts).all(axis=1)
    powers = [(d - j, j) for d in range(DEGREE + 1) for j in range(d + 1)]
    if reached.sum() < 2 * len(powers):
        raise TwinError(
            f"the mechanism's rods reach {reached.mean():.0%} of the range of its stops"
        )
    design = np.stack([nodes[reached, 0] ** i * nodes[reached, 1] ** j for i, j in powers], axis=1)
    factors = np.linalg.lstsq(design, shafts[reached], rcond=None)[0]
    matrix = factors[1:3].T / extent
    angles = np.linalg.inv(matrix)  # angle per shaft
    error = (design @ factors - shafts[reached]) @ angles.T
    x, y = (factors[3:] @ angles.T).T.tolist()
    linearisation = Linearisation(_rows(x), _rows(y), extent, float(np.sqrt(np.mean(error**2))))
    return MechanismMap(linearisation, matrix, factors[0])


def _extent(model: mujoco.MjModel) -> float:
    """Half width of the square between the stops [rad]."""
    joints = [model.joint(f"gimbal_{axis}").id for axis in AXES]
    if not all(model.jnt_limited[j] for j in joints):
        return UNLIMITED
    return float(np.clip(np.abs(model.jnt_range[joints]).max(), SMALLEST, LARGEST))


def _rows(factors: list[float]) -> tuple[tuple[float, ...], ...]:
    """Coefficients of degree 2 and more, a row for each degree."""
    starts = [(d - 2) * (d + 3) // 2 for d in range(2, DEGREE + 2)]
    return tuple(tuple(factors[a:b]) for a, b in pairwise(starts))
