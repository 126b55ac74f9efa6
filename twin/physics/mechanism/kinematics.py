"""Servo angles from gimbal angles and back, from the geometry alone.

The pushrod's length closes each loop: with `p` the ball on the holder and `h(α)` the ball on the
horn, `|p - h(α)|² = L²`. For a given gimbal pose that is `A cos α + B sin α = C`; the other way
it is two equations in the two gimbal angles, solved by Newton's method. MuJoCo's constraint solver
is not used, so that each can verify the other.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hardware.frames import AXES
from twin.physics.mechanism import loops
from twin.physics.mechanism.names import MechanismError, find, prefix, require

Array = NDArray[np.float64]
SITE, JOINT = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_JOINT
ASSEMBLED = 1e-6  # m; largest gap of a rod at the home pose


@dataclass(frozen=True)
class Workspace:
    """Servo angles for the range of the gimbal.

    Attributes
    ----------
    gimbal : grid of gimbal angles, (n, n, 2) [rad]
    servo : servo angles for them, NaN where a rod cannot reach, (n, n, 2) [rad]
    ratio : ∂gimbal/∂servo, rows gimbal, columns servo, (n, n, 2, 2)
    """

    gimbal: Array
    servo: Array
    ratio: Array

    @property
    def text(self) -> str:
        """One line."""
        if np.isnan(self.servo).any():
            return "the rods do not reach everywhere between the stops"
        low, high = (np.degrees(f(self.servo)) for f in (np.min, np.max))
        x, y = np.abs(self.ratio[..., 0, 0]), np.abs(self.ratio[..., 1, 1])
        least, most = min(x.min(), y.min()), max(x.max(), y.max())
        return (
            f"servos at {low:.1f}° to {high:.1f}° for all of it, {least:.2f} to {most:.2f}° of"
            " gimbal per degree of servo"
        )


class Kinematics:
    """Kinematic solution of a gimbal: linkage with pushrods, or servos on the axes themselves.

    Attributes
    ----------
    direct : whether the servos are on the gimbal axes, so that their angles are equal
    geometry : (2, SIZE) rows of `loops`; zeros where direct
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Read the geometry of a compiled model at its home pose.

        Raises
        ------
        MechanismError : a name is missing, or the rods do not fit
        """
        self._prefix = prefix(model)
        self._range = np.array([model.joint(f"{self._prefix}{a}").range for a in AXES])
        self.direct = _is_direct(model, self._prefix)
        self._balls: tuple[tuple[int, int], ...] = ()
        self.geometry = np.zeros((2, loops.SIZE))
        if self.direct:
            return
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._balls = tuple(
            (
                require(model, SITE, f"{self._prefix}rod_{a}_end"),
                require(model, SITE, f"{self._prefix}holder_{a}_ball"),
            )
            for a in AXES
        )
        self.geometry = np.stack([_loop(model, data, self._prefix, a) for a in AXES])
        self.geometry.setflags(write=False)
        if np.abs(self.servo_from_gimbal(np.zeros(2))).max() > 1e-3:
            raise MechanismError("the home pose of the mechanism does not have its servos at zero")

    def servo_from_gimbal(self, angles: ArrayLike) -> Array:
        """Servo shaft angles that put the gimbal at `angles`.

        Parameters
        ----------
        angles : gimbal (x, y), (..., 2) [rad]

        Returns
        -------
        (..., 2) [rad]; NaN where the rod cannot reach
        """
        gimbal = _pairs(angles)
        if self.direct:
            return gimbal.copy()
        servo: Array = loops.servo_angles(self.geometry, gimbal.reshape(-1, 2))
        return servo.reshape(gimbal.shape)

    def gimbal_from_servo(self, angles: ArrayLike) -> Array:
        """Gimbal angles at which the rods fit servos at `angles`.

        Parameters
        ----------
        angles : servo shafts (x, y), (..., 2) [rad]

        Returns
        -------
        (..., 2) [rad]; NaN where no pose near home fits
        """
        servo = _pairs(angles)
        if self.direct:
            return servo.copy()
        gimbal: Array = loops.gimbal_angles(self.geometry, servo.reshape(-1, 2))
        return gimbal.reshape(servo.shape)

    def servo_from_gimbal_fast(self, x: float, y: float) -> tuple[float, float]:
        """`servo_from_gimbal` for one pair in a control tick, clipped to the reach of the rods."""
        if self.direct:
            return x, y
        pair: tuple[float, float] = loops.servo_pair(self.geometry, x, y)
        return pair

    def workspace(self, n: int = 21) -> Workspace:
        """Solve a grid of `n` × `n` gimbal angles over the range between the stops."""
        x, y = (np.linspace(low, high, n) for low, high in self._range)
        gimbal = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        step = 1e-6
        columns = [
            (self.servo_from_gimbal(gimbal + e) - self.servo_from_gimbal(gimbal - e)) / (2 * step)
            for e in step * np.eye(2)
        ]
        ratio = np.linalg.inv(np.stack(columns, axis=-1))
        return Workspace(gimbal, self.servo_from_gimbal(gimbal), ratio)

    def closure(self, data: mujoco.MjData) -> Array:
        """Distance between the end of each rod and its ball, (2,) [m]; zeros without rods."""
        if self.direct:
            return np.zeros(2)
        return np.array(
            [np.linalg.norm(data.site_xpos[a] - data.site_xpos[b]) for a, b in self._balls]
        )


def _pairs(angles: ArrayLike) -> Array:
    array = np.asarray(angles, np.float64)
    if array.ndim == 0 or array.shape[-1] != 2:
        raise MechanismError(f"angles of shape {array.shape}; the last axis must hold (x, y)")
    return array


def _is_direct(model: mujoco.MjModel, before: str) -> bool:
    for axis in AXES:
        actuator = find(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{before}servo_{axis}")
        joint = require(model, JOINT, f"{before}{axis}")
        hinged = actuator >= 0 and model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
        if not hinged or int(model.actuator_trnid[actuator, 0]) != joint:
            return False
    return True


def _loop(model: mujoco.MjModel, data: mujoco.MjData, before: str, axis: str) -> Array:
    """Geometry of one loop in the frame of `mount`, in the order of `loops`."""
    joint_x, joint_y = (require(model, JOINT, f"{before}{a}") for a in AXES)
    servo = require(model, JOINT, f"{before}servo_{axis}")
    horn, rod, holder = (
        require(model, SITE, f"{before}{name}")
        for name in (f"horn_{axis}_ball", f"rod_{axis}_end", f"holder_{axis}_ball")
    )
    if np.linalg.norm(data.site_xpos[rod] - data.site_xpos[holder]) > ASSEMBLED:
        raise MechanismError(
            f"rod {axis} does not reach its ball at home: sites '{before}rod_{axis}_end' and"
            f" '{before}holder_{axis}_ball' must coincide"
        )
    frame = int(model.body_parentid[model.jnt_bodyid[joint_x]])
    origin, turn = data.xpos[frame], data.xmat[frame].reshape(3, 3)
    points = [data.xanchor[joint_x], data.xanchor[joint_y], data.site_xpos[holder]]
    points += [data.xanchor[servo], data.site_xpos[horn]]
    axes = [data.xaxis[joint_x], data.xaxis[joint_y], data.xaxis[servo]]
    geometry = np.concatenate([(np.array(points) - origin) @ turn, np.array(axes) @ turn])
    length = float(np.linalg.norm(data.site_xpos[rod] - data.site_xpos[horn]))
    return np.append(loops.pack(geometry.ravel(), length), _branch(geometry))


def _branch(geometry: Array) -> float:
    """Sign that selects, of the two horn angles that fit, the one that is zero at home."""
    holder, anchor, ball, w = geometry[2], geometry[3], geometry[4], geometry[7]
    arm = ball - anchor
    across = np.cross(w, arm - (arm @ w) * w)
    # d/dα of A cos α + B sin α at α = 0 is B; acos enters with the opposite sign
    return -float(np.sign((holder - anchor) @ across)) or 1.0
