"""The bench scene as the mechanism of a simulated rig: pulses move MuJoCo's servos and rods."""

from math import cos, sin

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES, Pair, Triple
from twin.errors import DivergenceError, TwinError
from twin.plant.model import TwinModel
from twin.plant.plant import LARGEST_SPEED

TURN = "turntable"  # joint and actuator that turn the base


class BenchPlant:
    """A mechanism, clamped or on a turntable, behind `hardware.emulator.Plant`.

    It needs `native.installed()`.

    The firmware's clock sets the physics step, so that a device whose clock is fast moves through
    its world in whole steps of its own millisecond.

    Parameters
    ----------
    twin : a scene without vehicle whose gimbal is moved by servos; stepped and changed here only

    Raises
    ------
    TwinError : the scene has another gimbal
    """

    def __init__(self, twin: TwinModel) -> None:
        if twin.gimbal != "linkage":
            raise TwinError(f"a simulated rig needs servos, this model's gimbal is {twin.gimbal}")
        self.model = model = twin.mj
        self.data = mujoco.MjData(model)
        # Runge–Kutta would call the dead band four times a step; the shipped scenes use this one.
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # views of the state; MuJoCo's arrays stay where they are for life
        self._ctrl, self._qpos, self._qvel = self.data.ctrl, self.data.qpos, self.data.qvel
        self._dt = model.opt.timestep
        self._servos = [int(model.actuator(f"gimbal_servo_{a}").id) for a in AXES]
        self._turn = self._turntable()
        joints = [model.joint(f"gimbal_{a}") for a in AXES]
        self._q = [int(joint.qposadr[0]) for joint in joints]
        self._v = [int(joint.dofadr[0]) for joint in joints]
        self._force = self._sensor("accelerometer")
        mujoco.mj_forward(model, self.data)
        up = -model.opt.gravity
        mount = self.data.body("gimbal_mount").xmat.reshape(3, 3)
        x, y, z = (mount.T @ up).tolist()
        self._rest: Triple = (x, y, z)

    def _sensor(self, name: str) -> NDArray[np.float64]:
        """View of a sensor of three numbers."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, name) < 0:
            raise TwinError(f"a simulated rig's scene needs a sensor {name!r}; see mjcf/bench.xml")
        at = int(self.model.sensor(name).adr[0])
        view: NDArray[np.float64] = self.data.sensordata[at : at + 3]
        return view

    def _turntable(self) -> tuple[int, int, int] | None:
        """Actuator, place and velocity of the joint that turns the base; None where it stands."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, TURN) < 0:
            return None
        joint = self.model.joint(TURN)
        self._base_force = self._sensor("base_accelerometer")
        servo = int(self.model.actuator(TURN).id)
        return servo, int(joint.qposadr[0]), int(joint.dofadr[0])

    def advance(self, dt: float, shaft: Triple) -> None:
        """Move for dt [s] with the shaft angles the pulses ask for [rad].

        Raises
        ------
        DivergenceError : the state left the finite numbers
        """
        if dt != self._dt:
            self.model.opt.timestep = self._dt = dt
        ctrl, (x, y) = self._ctrl, self._servos
        ctrl[x], ctrl[y] = shaft[0], shaft[1]
        if self._turn is not None:
            ctrl[self._turn[0]] = shaft[2]
        mujoco.mj_step(self.model, self.data)
        speed = self._qvel
        if not speed @ speed < LARGEST_SPEED**2:
            raise DivergenceError(f"the simulated rig diverged at {self.data.time:.3f} s")

    def angles(self) -> Pair:
        """Gimbal angles as they are [rad]."""
        q = self._qpos
        return float(q[self._q[0]]), float(q[self._q[1]])

    def rates(self) -> Pair:
        """Their time derivatives [rad/s]."""
        v = self._qvel
        return float(v[self._v[0]]), float(v[self._v[1]])

    def turn(self) -> Pair:
        """Angle of the base about x and its time derivative [rad], [rad/s]."""
        if self._turn is None:
            return 0.0, 0.0
        _, q, v = self._turn
        return float(self._qpos[q]), float(self._qvel[v])

    def holder_imu(self) -> tuple[Triple, Triple]:
        """Angular rate and specific force on the holder [rad/s], [m/s²].

        The rate follows from the joints, because MuJoCo's sensors are of the instant before the
        last step; the force, which nothing here depends on closely, is that sensor's.
        """
        (dx, dy), y = self.rates(), float(self._qpos[self._q[1]])
        dx += self.turn()[1]  # the base turns about the axis of the ring
        a, b, c = self._force.tolist()
        return (dx * cos(y), dy, dx * sin(y)), (a, b, c)

    def base_imu(self) -> tuple[Triple, Triple]:
        """The same on the base."""
        if self._turn is None:
            return (0.0, 0.0, 0.0), self._rest
        a, b, c = self._base_force.tolist()
        return (self.turn()[1], 0.0, 0.0), (a, b, c)
