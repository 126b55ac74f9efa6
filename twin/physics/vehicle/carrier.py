"""What a mechanism's file says about the motor it carries: where it sits and what fits."""

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import mujoco

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
    """

    forward: float
    bore: float
    mass: float


def mechanism_file(design: Design) -> Path:
    """MJCF file of a design's mechanism; the shipped one where it names none."""
    assert design.gimbal is not None
    if not design.gimbal.mechanism:
        return Path(str(files("mjcf"))) / "mechanism.xml"
    folder = design.source.parent if design.source is not None else Path()
    return (folder / design.gimbal.mechanism).resolve()


def carrier(path: Path) -> Carrier:
    """Read a mechanism: sites `motor_forward` or `nozzle`, body `motor` with a cylinder.

    Raises
    ------
    VehicleError : it cannot be compiled, or lacks one of these
    TwinError : it exceeds a limit for files of unknown origin
    """
    guard.approve(guard.examine([path]), path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise VehicleError(
            f"{path} is not a mechanism that MuJoCo can read: {' '.join(str(error).split())[:200]}"
        ) from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names = [model.body(k).name for k in range(model.nbody)]
    if missing := [name for name in ("mount", "motor", "propellant") if name not in names]:
        raise VehicleError(f"{path} has no body {missing[0]!r}; docs/mechanism.md lists them")
    geom = _casing(model, path)
    motor, mount = model.body("motor").id, model.body("mount").id
    axis = data.xmat[mount].reshape(3, 3).T
    middle = float((axis @ (data.geom_xpos[geom] - data.xpos[mount]))[2])
    burning = model.body_mass[motor] + model.body_mass[model.body("propellant").id]
    return Carrier(
        forward=middle + float(model.geom_size[geom][1]),
        bore=2 * float(model.geom_size[geom][0]),
        mass=float(model.body_subtreemass[mount] - burning),
    )


def _casing(model: mujoco.MjModel, path: Path) -> int:
    body = model.body("motor")
    first, count = int(body.geomadr[0]), int(body.geomnum[0])
    for geom in range(first, first + count):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            return geom
    raise VehicleError(f"{path}: body 'motor' has no cylinder that shows the motor's size")
