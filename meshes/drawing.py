"""What the parts are drawn around: positions and dimensions read from MJCF, in millimetres."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

MJCF = Path(__file__).resolve().parents[1] / "mjcf"
MILLIMETRE = 1000.0


@dataclass(frozen=True)
class Drawing:
    """Home pose of a mechanism without its meshes; every getter answers in millimetres.

    Attributes
    ----------
    model : compiled from the MJCF with each mesh geom replaced by a point
    data : forward kinematics at home
    """

    model: mujoco.MjModel
    data: mujoco.MjData

    @classmethod
    def read(cls, path: Path) -> "Drawing":
        """Compile `path` without its meshes, which need not exist yet.

        Raises
        ------
        ValueError : the file is no MJCF
        """
        spec = mujoco.MjSpec.from_file(str(path))
        for geom in spec.geoms:
            if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                geom.meshname = ""
                geom.type = mujoco.mjtGeom.mjGEOM_SPHERE
                geom.size = [1e-3, 0, 0]
        for mesh in list(spec.meshes):
            spec.delete(mesh)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return cls(model, data)

    def site(self, name: str) -> NDArray[np.float64]:
        """Position of a site at home in the frame of `mount`, (3,) [mm]."""
        return np.asarray(self.data.site(name).xpos) * MILLIMETRE

    def site_size(self, name: str) -> NDArray[np.float64]:
        """Sizes of a site, (3,) [mm]."""
        return np.asarray(self.model.site(name).size) * MILLIMETRE

    def body(self, name: str) -> NDArray[np.float64]:
        """Position of a body at home in the frame of `mount`, (3,) [mm]."""
        return np.asarray(self.data.body(name).xpos) * MILLIMETRE

    def geom(self, name: str) -> NDArray[np.float64]:
        """Position of a geom at home in the frame of `mount`, (3,) [mm]."""
        return np.asarray(self.data.geom(name).xpos) * MILLIMETRE

    def local(self, geom: str, body: str) -> NDArray[np.float64]:
        """Position of a geom at home in the frame of a body, (3,) [mm]."""
        frame = self.data.body(body)
        away = self.data.geom(geom).xpos - frame.xpos
        return np.asarray(away @ frame.xmat.reshape(3, 3)) * MILLIMETRE

    def geom_size(self, name: str) -> NDArray[np.float64]:
        """Sizes of a geom, (3,) [mm]."""
        return np.asarray(self.model.geom(name).size) * MILLIMETRE

    def numeric(self, name: str) -> list[float]:
        """Values of a `<numeric>` that holds lengths [mm]."""
        return [float(v) * MILLIMETRE for v in self.model.numeric(name).data]

    def has(self, numeric: str) -> bool:
        """Whether the model has a `<numeric>` of that name."""
        return bool(mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_NUMERIC, numeric) >= 0)
