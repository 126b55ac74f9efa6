"""Torque that the servos need to hold the moving parts, against what they can give."""

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from hardware.parts import STANDARD_GRAVITY
from twin.physics.mechanism.kinematics import Kinematics
from twin.physics.mechanism.names import prefix
from twin.physics.mechanism.servo import CONSTANT, RESISTANCE, VOLTAGE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Torque:
    """Torques at the servo shafts (x, y).

    Attributes
    ----------
    needed : largest over the workspace [N m]
    stall : that of the servo at rest [N m]; infinite where the file has no limit
    """

    needed: tuple[float, float]
    stall: tuple[float, float]

    @property
    def reserve(self) -> float:
        """Stall torque over needed torque, of the axis with less."""
        return min(s / n if n > 0 else np.inf for s, n in zip(self.stall, self.needed, strict=True))


def holding(model: mujoco.MjModel, load_g: float, n: int = 9) -> Torque:
    """Torque to hold ring, holder and motor under an acceleration across the tube, with friction.

    By virtual work: shaft torque = (∂gimbal/∂servo)ᵀ · torque about the gimbal axes. The worst
    direction across the tube and the worst of n × n gimbal angles count.

    Parameters
    ----------
    load_g : acceleration across the tube, in g; gravity on a tube that lies is 1
    """
    before, trial = prefix(model), copy(model)
    data = mujoco.MjData(trial)
    workspace = Kinematics(model).workspace(n)
    joints = [model.joint(f"{before}{a}") for a in AXES]
    places = [int(j.qposadr[0]) for j in joints]
    dofs = [int(j.dofadr[0]) for j in joints]
    friction = np.array([float(model.dof_frictionloss[d]) for d in dofs])
    shafts = [_shaft_friction(model, f"{before}servo_{a}") for a in AXES]
    frame = int(model.body_parentid[model.jnt_bodyid[joints[0].id]])
    needed = np.zeros(2)
    for i in range(n):
        for j in range(n):
            ratio = workspace.ratio[i, j]
            sides = []
            for axis in range(2):
                mujoco.mj_resetData(trial, data)
                mujoco.mj_kinematics(trial, data)
                turn = data.xmat[frame].reshape(3, 3)
                trial.opt.gravity[:] = load_g * STANDARD_GRAVITY * turn[:, axis]
                data.qpos[places] = workspace.gimbal[i, j]
                mujoco.mj_fwdPosition(trial, data)
                mujoco.mj_rne(trial, data, 0, data.qfrc_bias)
                sides.append(ratio.T @ data.qfrc_bias[dofs])
            worst = np.hypot(*sides) + np.abs(ratio.T) @ friction
            needed = np.maximum(needed, worst)
    needed += shafts
    return Torque((float(needed[0]), float(needed[1])), _stall(model, before))


def _shaft_friction(model: mujoco.MjModel, servo: str) -> float:
    joint = int(model.actuator_trnid[model.actuator(servo).id, 0])
    name = model.joint(joint).name
    return float(model.dof_frictionloss[model.jnt_dofadr[joint]]) if name == servo else 0.0


def _stall(model: mujoco.MjModel, before: str) -> tuple[float, float]:
    torques = []
    for axis in AXES:
        k = model.actuator(f"{before}servo_{axis}").id
        gain = model.actuator_gainprm[k]
        if model.actuator_gaintype[k] == mujoco.mjtGain.mjGAIN_DCMOTOR:
            torques.append(float(gain[CONSTANT] * gain[VOLTAGE] / gain[RESISTANCE]))
        elif model.actuator_forcelimited[k]:
            torques.append(float(np.abs(model.actuator_forcerange[k]).min()))
        else:
            torques.append(float("inf"))
    return torques[0], torques[1]
