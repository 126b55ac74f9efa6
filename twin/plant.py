"""The one owner of a run's MjModel and MjData."""

import time
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin import integrators
from twin.errors import DivergenceError, TwinError
from twin.model import AXES, TwinModel
from twin.motor import Depletion

Array = NDArray[np.float64]

# Beyond these a small vehicle's state is numerical nonsense, long before it overflows.
LARGEST_SPEED = 5e3  # m/s and rad/s


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Where the vehicle is and how it moves.

    Attributes
    ----------
    position : of the gimbal pivot, world frame, (3,) [m]
    velocity : of the gimbal pivot, world frame, (3,) [m/s]
    attitude : body to world, quaternion wxyz, (4,)
    rate : angular velocity in the body frame, (3,) [rad/s]
    """

    position: Array
    velocity: Array
    attitude: Array
    rate: Array


class Plant:
    """Steps one model and reads it; every consumer sees the same consistent instant.

    After `advance` state, poses and site positions belong to the instant `time_ns`; MuJoCo's
    sensors, forces and centres of mass are those of the beginning of the last step.
    """

    def __init__(self, twin: TwinModel, integrator: str = "implicitfast") -> None:
        self.twin = twin
        self.model = twin.mj
        self.data = mujoco.MjData(self.model)
        self.dt_ns: int = round(self.model.opt.timestep * 1e9)
        if abs(self.dt_ns * 1e-9 - self.model.opt.timestep) > 1e-15:
            raise TwinError(f"dt {self.model.opt.timestep} s is not a whole number of nanoseconds")
        self.steps = 0
        self.computing_s = 0.0
        self._stepper = integrators.make(integrator)
        self._propellant = Depletion(self.model)
        self._view()
        self.reset()

    def _view(self) -> None:
        """Bind views of the state once; MuJoCo's arrays stay where they are for life."""
        data, model = self.data, self.model
        self._qvel = data.qvel
        self.has_vehicle = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "vehicle") >= 0
        if self.has_vehicle:
            joint = model.joint("vehicle")
            q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
            self.position, self.attitude = data.qpos[q : q + 3], data.qpos[q + 3 : q + 7]
            self.velocity, self.rate = data.qvel[v : v + 3], data.qvel[v + 3 : v + 6]
        if self.twin.gimbal != "fixed":
            joints = [model.joint(f"gimbal_{axis}") for axis in AXES]
            q, v = int(joints[0].qposadr[0]), int(joints[0].dofadr[0])
            if int(joints[1].qposadr[0]) != q + 1 or int(joints[1].dofadr[0]) != v + 1:
                raise TwinError("joint 'gimbal_y' must follow 'gimbal_x' without a joint between")
            self.gimbal_angle, self.gimbal_rate = data.qpos[q : q + 2], data.qvel[v : v + 2]
        else:
            self.gimbal_angle, self.gimbal_rate = np.zeros(2), np.zeros(2)

    def reset(self) -> None:
        """Return to the model's initial state at time zero."""
        self._propellant.update(0.0)
        mujoco.mj_resetData(self.model, self.data)
        self._stepper = self._stepper.fresh()
        self.steps = 0
        mujoco.mj_forward(self.model, self.data)

    @property
    def time_ns(self) -> int:
        """Simulation time as step count × dt, never accumulated [ns]."""
        return self.steps * self.dt_ns

    def advance(self, n: int) -> None:
        """Take `n` physics steps.

        Raises
        ------
        DivergenceError : the state left the finite numbers, or MuJoCo warned of it
        """
        self._propellant.update(self.time_ns * 1e-9)
        began = time.perf_counter()
        self._stepper.step(self.model, self.data, n)
        # a step leaves poses where it began; what is drawn and measured belongs to its end
        mujoco.mj_kinematics(self.model, self.data)
        self.computing_s += time.perf_counter() - began
        self.steps += n
        if not self._qvel @ self._qvel < LARGEST_SPEED**2:  # also where it is NaN
            self._diverged()

    def vehicle(self) -> VehicleState:
        """Copy of the vehicle's state."""
        return VehicleState(
            self.position.copy(), self.velocity.copy(), self.attitude.copy(), self.rate.copy()
        )

    def warnings(self) -> dict[str, int]:
        """MuJoCo's warnings so far, by name, with their counts."""
        counts = self.data.warning.number
        names = (mujoco.mjtWarning(k).name for k in range(len(counts)))
        return {
            n.removeprefix("mjWARN_").lower(): int(c)
            for n, c in zip(names, counts, strict=True)
            if c
        }

    def _diverged(self) -> None:
        worst = int(
            np.nanargmax(np.where(np.isfinite(self.data.qvel), np.abs(self.data.qvel), np.inf))
        )
        joint = self.model.joint(int(self.model.dof_jntid[worst]))
        raise DivergenceError(
            f"the simulation diverged at {self.time_ns * 1e-9:.4f} s: velocity of joint"
            f" {joint.name!r} is {self.data.qvel[worst]:.3g}; a smaller --dt may help"
        )
