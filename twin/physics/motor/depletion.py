"""The propellant burns away: mass, centre of mass and inertia of `gimbal_propellant` in flight."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.physics.motor.curve import Array, impulse_at
from twin.physics.motor.grain import remaining

BODY = "gimbal_propellant"
NUMERICS = ("time", "thrust", "ignition", "propellant_mass", "grain_length", "grain_radius", "burn")


class Fuel(NamedTuple):
    """What `burn` reads and the views of a model that it writes; without a motor all are empty.

    Attributes
    ----------
    curve : (4, n) time [s], thrust [N], impulse delivered [N s] and slope of the thrust [N/s]
    fixed : (5,) ignition [s], 1 for an end burner, length, radius [m] and mass [kg] of the grain
    chain : the propellant's body and all that carry it
    mass, subtree : of all bodies [kg]
    ipos, inertia : (3,) of the propellant [m, kg m²]
    """

    curve: Array
    fixed: Array
    chain: NDArray[np.int64]
    mass: Array
    subtree: Array
    ipos: Array
    inertia: Array


class Depletion:
    """Keeps the propellant of one model in step with its thrust curve.

    Propellant goes with the impulse delivered. The plant calls `update` for the middle of every
    Runge-Kutta step, with other methods once per control tick and every 4 ms of longer ones, since
    mass that leaves in between is milligrams. A model without a motor is left alone.
    Weights that MuJoCo derives for its constraint solver (`body_invweight0`) keep their loaded
    values.

    Attributes
    ----------
    fuel : for compiled code, which calls `burn`
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, BODY)
        numeric = mujoco.mjtObj.mjOBJ_NUMERIC
        known = all(mujoco.mj_name2id(model, numeric, f"motor_{n}") >= 0 for n in NUMERICS)
        nothing = np.empty(0)
        chain = np.empty(0, np.int64)
        self.fuel = Fuel(np.empty((4, 0)), nothing, chain, nothing, nothing, nothing, nothing)
        if body < 0 or not known:
            return
        time, thrust, ignition, mass, length, radius, burn = (
            model.numeric(f"motor_{name}").data.copy() for name in NUMERICS
        )
        delivered = impulse_at(time, thrust, time)
        if not delivered[-1] > 0:
            return
        span = np.diff(time, append=time[-1])
        slope = np.diff(thrust, append=thrust[-1]) / np.where(span > 0, span, 1.0)
        curve = np.stack([time, thrust, delivered, slope])
        fixed = np.array([ignition[0], float(bool(burn[0])), length[0], radius[0], mass[0]])
        # written ipos would be ignored on a body whose centre MuJoCo takes for its origin
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_iquat[body] = (1.0, 0.0, 0.0, 0.0)
        model.body_ipos[body, :2] = 0.0
        self.fuel = Fuel(
            curve, fixed, _chain(model, body), model.body_mass, model.body_subtreemass,
            model.body_ipos[body], model.body_inertia[body],
        )  # fmt: skip

    def burnt(self, t: float) -> float:
        """Fraction of the propellant gone at simulation time t [s], 0 to 1."""
        fuel = self.fuel
        return float(_burnt(t, fuel.curve, fuel.fixed[0])) if fuel.chain.size else 0.0

    def update(self, t: float) -> None:
        """Rewrite the propellant as of simulation time t [s], and all masses above it."""
        if self.fuel.chain.size:
            burn(t, self.fuel)


def _chain(model: mujoco.MjModel, body: int) -> NDArray[np.int64]:
    chain = [body]
    while chain[-1] != 0:
        chain.append(int(model.body_parentid[chain[-1]]))
    return np.array(chain, np.int64)


@njit(nogil=True)
def _burnt(t: float, curve: Array, ignition: float) -> float:
    """`Depletion.burnt` with a thrust curve, see `Fuel`."""
    since = t - ignition
    time = curve[0]
    if since <= time[0]:
        return 0.0
    if since >= time[-1]:
        return 1.0
    k = np.searchsorted(time, since, side="right") - 1
    into = since - time[k]
    done = curve[2, k] + into * (curve[1, k] + 0.5 * curve[3, k] * into)
    return float(done / curve[2, -1])


@njit(nogil=True)
def burn(t: float, fuel: Fuel) -> None:
    """`Depletion.update`."""
    if fuel.chain.size == 0:
        return
    fixed, body = fuel.fixed, fuel.chain[0]
    gone = _burnt(t, fuel.curve, fixed[0])
    mass, ahead, transverse, axial = remaining(fixed[1] > 0.0, fixed[2], fixed[3], fixed[4], gone)
    change = mass - fuel.mass[body]
    if change == 0.0:
        return
    fuel.mass[body] = mass
    fuel.ipos[2] = ahead
    fuel.inertia[0] = transverse
    fuel.inertia[1] = transverse
    fuel.inertia[2] = axial
    for k in range(fuel.chain.size):
        fuel.subtree[fuel.chain[k]] += change
