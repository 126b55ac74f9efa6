"""The propellant burns away: mass, centre of mass and inertia of `gimbal_propellant` in flight."""

from bisect import bisect_right

import mujoco
import numpy as np

from twin.physics.motor.curve import Array, impulse_at
from twin.physics.motor.grain import Grain

BODY = "gimbal_propellant"
NUMERICS = ("time", "thrust", "ignition", "propellant_mass", "grain_length", "grain_radius", "burn")


class Depletion:
    """Keeps the propellant of one model in step with its thrust curve.

    Propellant goes with the impulse delivered. The plant calls `update` once per control tick
    and every 4 ms of longer ones: mass that leaves in between is milligrams. A model without a
    motor is left alone. Weights that MuJoCo derives for its constraint solver (`body_invweight0`)
    keep their loaded values.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, BODY)
        numeric = mujoco.mjtObj.mjOBJ_NUMERIC
        known = all(mujoco.mj_name2id(model, numeric, f"motor_{n}") >= 0 for n in NUMERICS)
        self._active = body >= 0 and known
        if not self._active:
            return
        time, thrust, ignition, mass, length, radius, burn = (
            model.numeric(f"motor_{name}").data.copy() for name in NUMERICS
        )
        self._grain = Grain("end" if burn[0] else "core", length[0], radius[0], mass[0])
        self._ignition = float(ignition[0])
        delivered = impulse_at(time, thrust, time)
        self._total = float(delivered[-1])
        self._active = self._total > 0
        slope = np.diff(thrust) / np.where(np.diff(time) > 0, np.diff(time), 1.0)
        self._time, self._thrust = time.tolist(), thrust.tolist()
        self._delivered, self._slope = delivered.tolist(), slope.tolist()
        self._view(model, body)

    def _view(self, model: mujoco.MjModel, body: int) -> None:
        """Memory views of what is written: a fifth of the time of NumPy indexing."""
        # written ipos would be ignored on a body whose centre MuJoCo takes for its origin
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_iquat[body] = (1.0, 0.0, 0.0, 0.0)
        model.body_ipos[body, :2] = 0.0
        self._body = body
        self._mass = _doubles(model.body_mass)
        self._ipos = _doubles(model.body_ipos[body])
        self._inertia = _doubles(model.body_inertia[body])
        self._subtree = _doubles(model.body_subtreemass)
        self._chain = [body]
        while self._chain[-1] != 0:
            self._chain.append(int(model.body_parentid[self._chain[-1]]))

    def burnt(self, t: float) -> float:
        """Fraction of the propellant gone at simulation time t [s], 0 to 1."""
        since = t - self._ignition
        time = self._time
        if since <= time[0]:
            return 0.0
        if since >= time[-1]:
            return 1.0
        k = bisect_right(time, since) - 1
        into = since - time[k]
        done = self._delivered[k] + into * (self._thrust[k] + 0.5 * self._slope[k] * into)
        return float(done / self._total)

    def update(self, t: float) -> None:
        """Rewrite the propellant as of simulation time t [s], and all masses above it."""
        if not self._active:
            return
        mass, ahead, transverse, axial = self._grain.remaining(self.burnt(t))
        change = mass - self._mass[self._body]
        if change == 0.0:
            return
        self._mass[self._body] = mass
        self._ipos[2] = ahead
        inertia, subtree = self._inertia, self._subtree
        inertia[0] = inertia[1] = transverse
        inertia[2] = axial
        for body in self._chain:
            subtree[body] += change


def _doubles(array: Array) -> "memoryview[float]":  # a generic at run time from 3.14 on
    return array.data.cast("B").cast("d")
