"""The bench scene as the mechanism of a simulated rig: pulses move its servos and rods."""

from math import cos, sin

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.emulator import Drive, Wear
from hardware.frames import AXES, Pair, Triple
from twin.errors import DivergenceError, TwinError
from twin.physics.mechanism.servo import GAIN, VOLTAGE
from twin.plant.divergence import LARGEST_SPEED
from twin.plant.model.model import TwinModel

# kg·m², N·m·s/rad: a blocked gear train turns 0.01°/s by the 0.02 N·m of a leaning motor. Damping
# alone, which MuJoCo's solver does not see, lets the rods of a moving gimbal diverge.
JAM = 1.0, 100.0
LIMP_GROUP = 30  # of actuators, MuJoCo's last; switched off
TURN = "turntable"  # joint and actuator that turn the base


class BenchPlant:
    """A mechanism, clamped or on a turntable, as a `hardware.emulator.Plant`.

    Needs `native.installed()`. The clock of the firmware sets the physics step, so that a device
    with a fast clock takes whole steps of its own millisecond.

    Parameters
    ----------
    twin : a scene without vehicle, with servos; no other component may step or change it

    Raises
    ------
    TwinError : the gimbal of the scene has no servos
    """

    def __init__(self, twin: TwinModel) -> None:
        if twin.gimbal != "linkage":
            raise TwinError(
                f"a simulated rig needs servos; the gimbal of this scene is {twin.gimbal!r}"
            )
        self.model = model = twin.mj
        self.data = mujoco.MjData(model)
        # Runge–Kutta would evaluate the dead band four times a step.
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # views of the state; MuJoCo never moves its arrays
        self._ctrl, self._qpos, self._qvel = self.data.ctrl, self.data.qpos, self.data.qvel
        self._dt = model.opt.timestep
        self._free: dict[int, Pair] = {}  # inertia and damping of servos that are not jammed
        self._new: dict[int, Pair] = {}  # friction and half backlash of servos
        self._supply, self._worn = 1.0, np.ones(2)  # voltages over the nominal ones
        self._servos = [int(model.actuator(f"gimbal_servo_{a}").id) for a in AXES]
        self._drives = self.model.actuator_gainprm[self._servos][:, [GAIN, VOLTAGE]]
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
        """Actuator and state indices of the joint that turns the base; None on a fixed base."""
        if mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, TURN) < 0:
            return None
        joint = self.model.joint(TURN)
        self._base_force = self._sensor("base_accelerometer")
        servo = int(self.model.actuator(TURN).id)
        return servo, int(joint.qposadr[0]), int(joint.dofadr[0])

    def advance(self, dt: float, shaft: Triple) -> None:
        """Advance by dt [s] with the shaft angles that the pulses command [rad].

        Raises
        ------
        DivergenceError : a velocity is not finite or far too large
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

    def set_drive(self, servo: int, drive: Drive) -> None:
        """Change how servo 0 (x) or 1 (y) is driven from now on."""
        model, actuator = self.model, self._servos[servo]
        dof = int(model.joint(f"gimbal_servo_{AXES[servo]}").dofadr[0])
        free = float(model.dof_armature[dof]), float(model.dof_damping[dof])
        free = self._free.setdefault(dof, free)
        jammed = drive is Drive.JAMMED
        model.dof_armature[dof], model.dof_damping[dof] = JAM if jammed else free
        if jammed:
            self._qvel[dof] = 0.0
        model.opt.disableactuator |= 1 << LIMP_GROUP
        model.actuator_group[actuator] = 0 if drive is Drive.NORMAL else LIMP_GROUP

    def set_supply(self, share: float) -> None:
        """Set the voltage of both servos from now on, over the nominal one [1].

        Gain and limit of a servo's controller are proportional to it.
        """
        self._supply = share
        self._set_drives()

    def set_wear(self, servo: int, wear: Wear) -> None:
        """Change how worn servo 0 (x) or 1 (y) is from now on; one without backlash keeps none."""
        model = self.model
        dof = int(model.joint(f"gimbal_servo_{AXES[servo]}").dofadr[0])
        play = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"gimbal_play_{AXES[servo]}")
        new = self._new.setdefault(
            servo, (float(model.dof_frictionloss[dof]), float(model.jnt_range[play, 1]))
        )
        model.dof_frictionloss[dof] = new[0] * wear.friction
        if play >= 0:
            half = new[1] + wear.backlash / 2
            model.jnt_range[play] = -half, half
        self._worn[servo] = wear.voltage
        self._set_drives()

    def _set_drives(self) -> None:
        drives = self._drives * (self._supply * self._worn)[:, None]
        self.model.actuator_gainprm[self._servos, GAIN] = drives[:, 0]
        self.model.actuator_gainprm[self._servos, VOLTAGE] = drives[:, 1]

    def angles(self) -> Pair:
        """True gimbal angles [rad]."""
        q = self._qpos
        return float(q[self._q[0]]), float(q[self._q[1]])

    def rates(self) -> Pair:
        """True gimbal rates [rad/s]."""
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

        The rate is computed from the joints, because MuJoCo's sensors belong to the beginning of
        the last step; the force is that of the sensor.
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
