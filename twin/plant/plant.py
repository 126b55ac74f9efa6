"""The one owner of a run's MjModel and MjData."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES, GimbalState, Pair
from twin.errors import TwinError
from twin.physics.motor import Depletion
from twin.plant.actuation import Actuation
from twin.plant.divergence import LARGEST_SPEED, Limits
from twin.plant.flow import Flow
from twin.plant.following import Following
from twin.plant.model.model import TwinModel
from twin.plant.release import Release
from twin.plant.rods import Rods
from twin.plant.steps import integrators, stepping
from twin.plant.steps.smooth import SAME, division, longest_step, part, undivided

Array = NDArray[np.float64]

RENEWAL_NS = 4_000_000  # the reference motor burns 30 mg in it, 1/30000 of the vehicle


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Position, attitude and velocities of the vehicle.

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
    """Steps one model and gives its state; all consumers see the same instant.

    Parameters
    ----------
    release : motion of the vehicle at time zero; at rest if omitted

    After `advance`, state, poses and site positions belong to the instant `time_ns`; MuJoCo's
    sensors, forces and centres of mass belong to the beginning of the last step.

    Attributes
    ----------
    integrator : its name
    renewal_ns : longest time between two updates of the propellant mass [ns]
    divides : whether Runge-Kutta steps of a vehicle are divided where its forces change, and the
        propellant mass is that of the middle of each
    position, velocity, attitude, rate : views of the vehicle's state, as `VehicleState`
    gimbal_angle, gimbal_rate : (2,) views of the gimbal joints; zeros of a fixed motor [rad, rad/s]
    closure : (2,) gap of the two rod loops at the last `derive` [m]; zeros without rods
    thrust : (1,) of the motor at the last `derive` [N]; zero without a vehicle
    signals : what is recorded, views by name of `analysis.schema`
    """

    renewal_ns = RENEWAL_NS
    divides = True

    def __init__(
        self, twin: TwinModel, integrator: str = "implicitfast", release: Release | None = None
    ) -> None:
        self.twin = twin
        self._release = release
        self.model = twin.mj
        self.data = mujoco.MjData(self.model)
        self.dt_ns: int = round(self.model.opt.timestep * 1e9)
        if abs(self.dt_ns * 1e-9 - self.model.opt.timestep) > 1e-15:
            raise TwinError(f"dt {self.model.opt.timestep} s is not a whole number of nanoseconds")
        self.integrator = integrator
        self.steps = 0
        self.computing_s = 0.0
        self._stepper = integrators.make(integrator)
        self._propellant = Depletion(self.model)
        self._renewal = max(1, self.renewal_ns // self.dt_ns)
        self._actuation = Actuation(twin, self.data)
        self._view()
        self._limits = Limits(twin)
        self.signals = self._offer()
        self._following = Following()
        self._division = undivided()
        if self.divides and integrator == "rk4" and self.has_vehicle:
            identified = twin.gimbal == "transfer-function"
            drive = self._actuation.native
            self._division = division(
                self.model, self.position, self.velocity, self.rate, self._qvel, drive.ctrl,
                drive.places if identified else drive.places[:0], self.gimbal_angle,
            )  # fmt: skip
            if self.model.opt.timestep <= longest_step(self.model):
                # MuJoCo would have no constraint act within two steps
                self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_REFSAFE
        self._compiled: stepping.Steps | None = None
        self.reset()

    def _view(self) -> None:
        """Make the views of the state; MuJoCo never moves its arrays."""
        data, model = self.data, self.model
        self._qvel = data.qvel
        self._fixed = model.body_weldid[model.geom_bodyid] == 0
        self.has_vehicle = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "vehicle") >= 0
        if self.has_vehicle:
            joint = model.joint("vehicle")
            q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
            self.position, self.attitude = data.qpos[q : q + 3], data.qpos[q + 3 : q + 7]
            self.velocity, self.rate = data.qvel[v : v + 3], data.qvel[v + 3 : v + 6]
            root = model.body_rootid[model.body("vehicle").id]
            self._own = model.body_rootid[model.geom_bodyid] == root
        if self.twin.gimbal != "fixed":
            joints = [model.joint(f"gimbal_{axis}") for axis in AXES]
            q, v = int(joints[0].qposadr[0]), int(joints[0].dofadr[0])
            if int(joints[1].qposadr[0]) != q + 1 or int(joints[1].dofadr[0]) != v + 1:
                raise TwinError("joint 'gimbal_y' must follow 'gimbal_x' without a joint between")
            self.gimbal_angle, self.gimbal_rate = data.qpos[q : q + 2], data.qvel[v : v + 2]
        else:
            self.gimbal_angle, self.gimbal_rate = np.zeros(2), np.zeros(2)

    def _offer(self) -> Mapping[str, Array]:
        """Signals of the gimbal and, where there is one, of the vehicle."""
        self._rods = Rods(self.model, self.data)
        self.closure = self._rods.closure
        self._flow: Flow | None = None
        self.thrust: Array = np.zeros(1)
        what = "followed" if self.follows else "simulated"
        signals = {f"gimbal/{what}": self.gimbal_angle, f"gimbal/rate/{what}": self.gimbal_rate}
        signals |= self._rods.signals
        if self.has_vehicle:
            state = (self.position, self.velocity, self.attitude, self.rate)
            self._flow = Flow(self.model, self.data, *state)
            self.thrust = self._flow.thrust
            vehicle = int(self.model.body("vehicle").id)
            signals |= {
                "vehicle/position": self.position,
                "vehicle/velocity": self.velocity,
                "vehicle/attitude": self.attitude,
                "vehicle/rate": self.rate,
                "vehicle/mass": self.model.body_subtreemass[vehicle : vehicle + 1],
                **self._flow.signals,
            }
        return signals

    def derive(self, time_ns: int) -> None:
        """Compute the signals beyond the state, at `time_ns` of the experiment [ns].

        Raises
        ------
        DivergenceError : the rods are farther from their balls than `closure_limit`
        """
        self._rods.derive()
        x, y = self.closure.tolist()
        if not (x <= self._limits.gap and y <= self._limits.gap):
            raise self._limits.apart(x, y, self.time_ns)
        if self._flow is not None:
            self._flow.derive(time_ns)

    def reset(self) -> None:
        """Return to the model's initial state at time zero."""
        self._propellant.update(0.0)
        mujoco.mj_resetData(self.model, self.data)
        if self._release is not None and self.has_vehicle:
            self._release.apply(self.attitude, self.velocity, self.rate)
        self._stepper = self._stepper.fresh()
        self._division.on_rail[:] = self._division.ends.size > 0
        self.steps = 0
        self._following.reset()
        mujoco.mj_forward(self.model, self.data)

    def drive(self, angle: Pair) -> None:
        """Command a gimbal angle about x and y [rad]; a fixed motor ignores it."""
        self._actuation.drive(angle)

    @property
    def follows(self) -> bool:
        """Whether the gimbal joints take measured angles, from `follow`."""
        return self.twin.gimbal == "follow"

    def follow(self, angle: Pair, rate: Pair = (0.0, 0.0)) -> None:
        """Have the gimbal joints take a measured angle [rad], moving at its rate [rad/s].

        `Following` gives the rates that lead them there.

        Raises
        ------
        TwinError : the model moves its gimbal itself
        """
        if not self.follows:
            raise TwinError(f"a gimbal of kind {self.twin.gimbal!r} cannot follow measured angles")
        self._following.measured(angle, rate)

    def gimbal(self) -> GimbalState:
        """Exact angles and rates of the gimbal joints at `time_ns`."""
        x, y = self.gimbal_angle.tolist()
        u, v = self.gimbal_rate.tolist()
        return GimbalState(self.time_ns, (x, y), (u, v))

    @property
    def time_ns(self) -> int:
        """Simulation time as step count × dt, never accumulated [ns]."""
        return self.steps * self.dt_ns

    def advance(self, n: int) -> None:
        """Take `n` physics steps.

        Raises
        ------
        DivergenceError : a velocity is not finite or far too large, or the gimbal is past its stops
        """
        if self.follows:
            x, y = self.gimbal_angle.tolist()
            rates = self._following.rates((x, y), self.time_ns, n * self.dt_ns)
            if rates is not None:
                self._actuation.drive(rates)
        while n > self._renewal:  # commands below 250 Hz: update the propellant in between
            self._move(self._renewal)
            n -= self._renewal
        self._move(n)

    def _move(self, n: int) -> None:
        """Take `n` steps with constant propellant mass."""
        began = time.thread_time()
        if self._division.rates.size:
            self._step_in_parts(n)
        else:
            self._propellant.update(self.time_ns * 1e-9)
            self._stepper.step(self.model, self.data, n)
        # mj_step leaves poses at its beginning; those recorded belong to its end
        mujoco.mj_kinematics(self.model, self.data)
        if self._division.bare:
            mujoco.mj_collision(self.model, self.data)
        self.computing_s += time.thread_time() - began
        self.steps += n
        if not self._qvel @ self._qvel < LARGEST_SPEED**2:  # also where it is NaN
            raise self._limits.too_fast(self.data, self.time_ns)
        x, y = self.gimbal_angle.tolist()
        low_x, high_x, low_y, high_y = self._limits.stops
        inside = low_x <= x <= high_x and low_y <= y <= high_y
        if not (inside or self.landed):  # an impact bends the stops, until the tick ends
            raise self._limits.past_stop(x, y, self.time_ns)

    def native(self) -> stepping.Native | None:
        """The plant for compiled code; None where only this class can take its steps.

        Afterwards set `steps`, and call `judge` with how it ended.
        """
        steps = self._native_steps()
        if steps is None or self._flow is None or self.follows:
            return None
        rods, most = self._rods, self._limits.gap
        gaps = stepping.Gaps(
            self.closure, rods.sites, rods.loops, most, rods.servo, rods.qpos, rods.shafts
        )
        fuel, drive = self._propellant.fuel, self._actuation.native
        return stepping.Native(steps, fuel, drive, gaps, self._flow.air)

    def _native_steps(self) -> stepping.Steps | None:
        functions = stepping.functions()
        if functions is None or not isinstance(self._stepper, integrators.Native):
            return None
        self.model.opt.integrator = self._stepper.integrator
        if self._compiled is None:
            self._compiled = stepping.Steps(
                self.model._address, self.data._address, *functions, self.dt_ns, self._renewal,
                self._qvel, self.gimbal_angle, np.array(self._limits.stops), LARGEST_SPEED**2,
                self.position[2:3], self._own, self._fixed, self._division,
                *stepping.settings(self.model, self.data),
            )  # fmt: skip
        return self._compiled

    def judge(self, ended: int) -> None:
        """Raise what a native advance found.

        Raises
        ------
        DivergenceError : as `advance`
        """
        if ended == stepping.TOO_FAST:
            raise self._limits.too_fast(self.data, self.time_ns)
        if ended == stepping.PAST_STOP:
            x, y = self.gimbal_angle.tolist()
            raise self._limits.past_stop(x, y, self.time_ns)
        if ended == stepping.APART:
            x, y = self.closure.tolist()
            raise self._limits.apart(x, y, self.time_ns)

    def _step_in_parts(self, n: int) -> None:
        native = self._compiled or self._native_steps()
        if native is not None:
            stepping.step_divided(native, self._propellant.fuel, self.steps, n)
            return
        for k in range(self.steps, self.steps + n):
            t, end = k * self.dt_ns * 1e-9, (k + 1) * self.dt_ns * 1e-9
            while t < end - SAME:
                h = part(self._division, t, end)
                self._propellant.update(t + 0.5 * h)
                self._stepper.step(self.model, self.data, 1, h)
                t += h
            self.data.time = end

    @property
    def landed(self) -> bool:
        """Whether the vehicle touches a fixed geom, or its pivot is below z = 0.

        Contacts between parts of the vehicle do not count.
        """
        if self.data.ncon:
            one, other = self.data.contact.geom.T
            if (self._own[one] & self._fixed[other] | self._fixed[one] & self._own[other]).any():
                return True
        return self.has_vehicle and bool(self.position[2] < 0.0)

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
