"""Names of the gimbal in a model: their prefix, and a message for a missing one."""

import mujoco

from hardware.frames import AXES
from twin.errors import TwinError

PREFIXES = ("gimbal_", "")  # attached to a scene, or mechanism.xml by itself


class MechanismError(TwinError):
    """A model whose gimbal lacks a name or is not a gimbal of two axes."""


def prefix(model: mujoco.MjModel) -> str:
    """Prefix of the gimbal's names: `gimbal_` after attaching, nothing in its own file.

    Raises
    ------
    MechanismError : the model has no joints `gimbal_x` and `gimbal_y`, nor `x` and `y`
    """
    for candidate in PREFIXES:
        if all(find(model, mujoco.mjtObj.mjOBJ_JOINT, f"{candidate}{a}") >= 0 for a in AXES):
            return candidate
    joints = ", ".join(model.joint(k).name or "unnamed" for k in range(model.njnt))
    raise MechanismError(
        f"no gimbal: joints 'gimbal_x' and 'gimbal_y' are missing; the model has {joints or 'none'}"
    )


def find(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Index of a named element, -1 where there is none."""
    return int(mujoco.mj_name2id(model, kind, name))


def require(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Index of a named element.

    Raises
    ------
    MechanismError : there is none
    """
    index = find(model, kind, name)
    if index < 0:
        element = str(kind.name).removeprefix("mjOBJ_").lower()
        raise MechanismError(
            f"the mechanism lacks {element} {name!r}; docs/mechanism.md lists the names"
        )
    return index
