"""What a mechanism's file says about the motor it carries: where it sits and what fits."""

import math
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np

from hardware.frames import AXES
from twin.physics import guard
from twin.physics.vehicle.design import Design, VehicleError


@dataclass(frozen=True)
class Carrier:
    """Place of the motor in a gimbal.

    Attributes
    ----------
    forward : forward end of the motor, towards the nose from the pivot [m]
    bore : diameter of the motor it was drawn for [m]
    mass : of all moving and fixed parts, without the motor [kg]
    centre : centre of mass of these parts, forward of the pivot [m]
    swing : largest tilt, both axes at their stops [rad]
    tube : inner radius of the tube that it was built for [m]; 0 where the file does not say
    reach : forward end of what fills that tube, forward of the pivot [m]
    """

    forward: float
    bore: float
    mass: float
    centre: float
    swing: float
    tube: float
    reach: float


def mechanism_file(design: Design) -> Path:
    """MJCF file of a design's mechanism; the shipped one where it names none."""
    assert design.gimbal is not None
    if not design.gimbal.mechanism:
        return Path(str(files("mjcf"))) / "mechanism.xml"
    return design.beside(design.gimbal.mechanism).resolve()


def check_is_model(path: Path) -> None:
    """Refuse a mechanism's description in place of its MJCF.

    Raises
    ------
    VehicleError : the command that builds it
    """
    if path.suffix.lower() == ".toml":
        raise VehicleError(
            f"mechanism {path}: is a description; run `twin mechanism build {path}` and give the"
            " .xml file that it writes"
        )


def carrier(path: Path) -> Carrier:
    """Read a mechanism: body `motor` with a cylinder, joints `x` and `y`, site `tube` if any.

    Raises
    ------
    VehicleError : it cannot be compiled, or lacks one of these
    TwinError : it exceeds a limit for files of unknown origin
    """
    check_is_model(path)
    guard.approve(guard.examine([path]), path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise VehicleError(
            f"{path} is not a mechanism that MuJoCo can read: {' '.join(str(error).split())[:200]}"
        ) from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    names = [model.body(k).name for k in range(model.nbody)]
    if missing := [name for name in ("mount", "motor", "propellant") if name not in names]:
        raise VehicleError(f"{path} has no body {missing[0]!r}; docs/mechanism.md lists them")
    geom = _casing(model, path)
    motor, mount = model.body("motor").id, model.body("mount").id
    axis = data.xmat[mount].reshape(3, 3).T
    middle = float((axis @ (data.geom_xpos[geom] - data.xpos[mount]))[2])
    burning = [motor, model.body("propellant").id]
    motors = float(model.body_mass[burning].sum())
    mass = float(model.body_subtreemass[mount]) - motors
    moment = model.body_subtreemass[mount] * (data.subtree_com[mount] - data.xpos[mount])
    moment -= model.body_mass[burning] @ (data.xipos[burning] - data.xpos[mount])
    joints = [k for k in range(model.njnt) if model.joint(k).name in AXES]
    level = math.prod(math.cos(float(np.abs(model.jnt_range[k]).max())) for k in joints)
    tube = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "tube")
    radius, half = model.site_size[tube][:2] if tube >= 0 else (0.0, 0.0)
    ahead = float((axis @ (data.site_xpos[tube] - data.xpos[mount]))[2] + half)
    return Carrier(
        forward=middle + float(model.geom_size[geom][1]),
        bore=2 * float(model.geom_size[geom][0]),
        mass=mass,
        centre=float((axis @ moment)[2]) / mass,
        swing=math.acos(min(max(level, -1.0), 1.0)),
        tube=float(radius),
        reach=ahead if tube >= 0 else 0.0,
    )


def _casing(model: mujoco.MjModel, path: Path) -> int:
    body = model.body("motor")
    first, count = int(body.geomadr[0]), int(body.geomnum[0])
    for geom in range(first, first + count):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            return geom
    raise VehicleError(f"{path}: body 'motor' has no cylinder that shows the motor's size")
