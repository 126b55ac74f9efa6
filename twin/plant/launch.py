"""Whether a vehicle can begin its flight: clear of the ground, and strong enough for its ramp."""

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.errors import TwinError
from twin.plant.authority import launch_of, numeric, thrust_curve

Array = NDArray[np.float64]
STEP: Final = 1e-3  # s, of the travel along the ramp
SLACK: Final = 1e-9  # m/s²


def check_launch(model: mujoco.MjModel) -> None:
    """Refuse a vehicle that starts inside the ground or cannot leave its ramp.

    Raises
    ------
    TwinError : what touches the ground, or thrust and weight
    """
    _check_ground(model)
    _check_ramp(model)


def _check_ground(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    height = launch_of(model)[1][2]
    if height < 0.0:
        raise TwinError(
            f"the gimbal pivot starts at z = {height:.3g} m, below the ground; {_raise(model)}"
        )
    root = model.body_rootid[model.body("vehicle").id]
    own = model.body_rootid[model.geom_bodyid] == root
    fixed = model.body_weldid[model.geom_bodyid] == 0
    for pair in data.contact.geom[: data.ncon]:
        for geom, other in (pair, pair[::-1]):
            if own[geom] and fixed[other]:
                names = [model.geom(g).name or f"number {g}" for g in (geom, other)]
                raise TwinError(
                    f"the vehicle starts inside the ground: its geom {names[0]!r} touches"
                    f" {names[1]!r}; {_raise(model)}"
                )


def _raise(model: mujoco.MjModel) -> str:
    foot = numeric(model, "ramp_position")
    return "raise it" if foot is None else f"raise ramp_position[2], now {foot[2]:g} m"


def _check_ramp(model: mujoco.MjModel) -> None:
    length, elevation = (numeric(model, f"ramp_{n}") for n in ("length", "elevation"))
    curve = thrust_curve(model)
    if length is None or elevation is None or curve is None or length[0] <= 0.0:
        return
    mass = float(model.body_subtreemass[model.body("vehicle").id])
    pull = float(np.linalg.norm(model.opt.gravity)) * math.sin(elevation[0])
    most = float(curve[1].max())
    if most <= mass * pull:
        raise TwinError(
            f"the vehicle cannot leave its ramp: its largest thrust is {most:.4g} N, its weight"
            f" along the ramp {mass * pull:.4g} N (launch mass {mass:.4g} kg)"
        )
    travel = _travel(*curve, mass, pull)
    if travel < length[0]:
        raise TwinError(
            f"the vehicle cannot leave its ramp: the motor takes {mass:.4g} kg {travel:.3g} m along"
            f" it, and ramp_length is {length[0]:g} m"
        )


@njit()
def _travel(times: Array, thrusts: Array, mass: float, pull: float) -> float:
    """Farthest travel along a ramp [m] without drag and friction, with the launch mass."""
    time = np.arange(times[0], times[-1] + STEP, STEP)
    gain = np.interp(time, times, thrusts) / mass - pull
    speed, travel = 0.0, 0.0
    for acceleration in gain:
        speed = max(0.0, speed + acceleration * STEP)  # the foot holds it up
        travel += speed * STEP
    return travel + speed**2 / (2 * max(pull, SLACK))
