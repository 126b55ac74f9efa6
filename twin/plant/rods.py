"""The pushrod loops of a plant: gaps at their ends, and angles of the servo shafts."""

import math
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from hardware.frames import AXES

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Rods:
    """Loop closure and servo angles of a linkage; no signals where the model has no rods.

    Attributes
    ----------
    closure : (2,) gap of the x and the y loop at the last `derive` [m]; zero without rods
    servo : (2,) angle of the servo shafts at the last `derive` [rad]
    signals : views by name of `analysis.schema`
    sites, loops : places of all sites, and the pairs that the rods join (2, 2)
    qpos, shafts : of the model, and the places of both shafts in it (2,)
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.sites, self.qpos = data.site_xpos, data.qpos
        self.loops, self.shafts = _loops(model), np.zeros(2, np.int64)
        self.closure: Array = np.zeros(2)
        self.servo: Array = np.zeros(2)
        self.signals: Mapping[str, Array] = {}
        if self.loops.size:
            self.shafts[:] = [model.joint(f"gimbal_servo_{a}").qposadr[0] for a in AXES]
            self.signals = {"linkage/closure": self.closure, "linkage/servo": self.servo}

    def derive(self) -> None:
        """Compute both from the model's present state."""
        if self.loops.size:
            find_gaps(self.closure, self.sites, self.loops)
            self.servo[:] = self.qpos[self.shafts]


def _loops(model: mujoco.MjModel) -> Indices:
    """Pairs of sites that the rods' loops close, (2, 2), or (0, 2) without rods."""
    site = mujoco.mjtObj.mjOBJ_SITE
    names = [(f"gimbal_rod_{axis}_end", f"gimbal_holder_{axis}_ball") for axis in AXES]
    pairs = np.array([[mujoco.mj_name2id(model, site, n) for n in pair] for pair in names])
    return pairs.astype(np.int64) if (pairs >= 0).all() else np.empty((0, 2), np.int64)


@njit(nogil=True)
def find_gaps(out: Array, sites: Array, loops: Indices) -> None:
    """Write the distance between the two sites of each loop to `out` (2,) [m]."""
    for k in range(loops.shape[0]):
        a, b = loops[k]
        gap = 0.0
        for i in range(3):
            gap += (sites[a, i] - sites[b, i]) ** 2
        out[k] = math.sqrt(gap)
