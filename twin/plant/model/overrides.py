"""Any named parameter of a compiled model: read it and change it."""

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

import mujoco
import numpy as np

from twin.errors import TwinError

NAME = re.compile(r"(?P<owner>[A-Za-z0-9_/-]+)(?:\.(?P<attribute>[a-z]+))?(?:\[(?P<index>\d+)\])?")

# attribute -> (object type, how the compiled model stores it)
ATTRIBUTES: Mapping[str, tuple[mujoco.mjtObj, str]] = {
    "mass": (mujoco.mjtObj.mjOBJ_BODY, "body_mass"),
    "inertia": (mujoco.mjtObj.mjOBJ_BODY, "body_inertia"),
    "pos": (mujoco.mjtObj.mjOBJ_BODY, "body_pos"),
    "stiffness": (mujoco.mjtObj.mjOBJ_JOINT, "jnt_stiffness"),
    "range": (mujoco.mjtObj.mjOBJ_JOINT, "jnt_range"),
    "damping": (mujoco.mjtObj.mjOBJ_JOINT, "dof_damping"),
    "armature": (mujoco.mjtObj.mjOBJ_JOINT, "dof_armature"),
    "frictionloss": (mujoco.mjtObj.mjOBJ_JOINT, "dof_frictionloss"),
    "ctrlrange": (mujoco.mjtObj.mjOBJ_ACTUATOR, "actuator_ctrlrange"),
    "forcerange": (mujoco.mjtObj.mjOBJ_ACTUATOR, "actuator_forcerange"),
}
DOFS = {
    mujoco.mjtJoint.mjJNT_FREE: 6,
    mujoco.mjtJoint.mjJNT_BALL: 3,
    mujoco.mjtJoint.mjJNT_SLIDE: 1,
    mujoco.mjtJoint.mjJNT_HINGE: 1,
}
OPTIONS = ("gravity",)
NOT_NEGATIVE = ("stiffness", "damping", "armature", "frictionloss")
# MuJoCo uses a range only where this flag is set
LIMITED = {
    "range": "jnt_limited",
    "ctrlrange": "actuator_ctrllimited",
    "forcerange": "actuator_forcelimited",
}
# parameters that something else determines: what, and what to set instead
BURNS = "the propellant changes while it burns; set motor_propellant_mass, motor_grain_length"
WRITTEN = "it is computed when a model is loaded"
DECIDED: Mapping[str, str] = {
    "gimbal_propellant.mass": BURNS,
    "gimbal_propellant.inertia": BURNS,
    "motor_loaded_mass": (
        "it only describes the installed motor; set gimbal_motor.mass for the casing,"
        " motor_propellant_mass for the propellant, or give --motor FILE"
    ),
    "motor_length": "it only describes the installed motor; --motor FILE replaces it",
    "motor_diameter": "it only describes the installed motor; --motor FILE replaces it",
    "wind_modes": f"{WRITTEN}; set wind_seed, wind_length",
    "native_index": WRITTEN,
}


def apply(model: mujoco.MjModel, overrides: Mapping[str, float]) -> None:
    """Write overrides into a compiled model and update what MuJoCo derives from them.

    A name is a numeric (`wind_speed`, `air_strip[3]`), an element and attribute
    (`vehicle.mass`, `gimbal_x.damping`, `gimbal_x.range[1]`) or an option (`gravity[2]`).
    A body's inertia follows an overridden mass in proportion; a ball or free joint takes one value
    for all its axes; a range that is set is also enabled.

    Raises
    ------
    TwinError : no such name, with the nearest ones; an impossible value; a parameter without
        effect, with the one to set instead
    """
    ranges: dict[tuple[str, str], set[int]] = {}
    for name, value in overrides.items():
        match = NAME.fullmatch(name)
        if match is None:
            raise TwinError(f"{name!r} is not a parameter name; give a numeric, {_examples()}")
        owner, attribute, at = match["owner"], match["attribute"], match["index"]
        _write(model, name, value, owner, attribute, at)
        if attribute in LIMITED:
            ranges.setdefault((owner, attribute), set()).add(int(at or 0))
    for (owner, attribute), places in ranges.items():
        _limit(model, owner, attribute, places)
    for name in overrides:
        _refuse_decided(model, name)
    _check_inertia(model, {n.partition(".")[0] for n in overrides if ".inertia" in n})
    if overrides:
        mujoco.mj_setConst(model, mujoco.MjData(model))


def value(model: mujoco.MjModel, name: str) -> float:
    """Value of a parameter of a compiled model, by the name that `apply` takes.

    Raises
    ------
    TwinError : no such name, with the nearest ones
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise TwinError(f"{name!r} is not a parameter name; give a numeric, {_examples()}")
    array, index = _place(model, name, match["owner"], match["attribute"], match["index"])
    return float(array[index])


def parameters(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Values of every parameter of a compiled model, by its name without an index."""
    named = [*_names(model, mujoco.mjtObj.mjOBJ_NUMERIC), *OPTIONS]
    for attribute, (kind, _) in ATTRIBUTES.items():
        for owner in _names(model, kind):
            massless = attribute in ("mass", "inertia") and not model.body(owner).mass[0] > 0
            free = attribute in ("pos", "range") and _is_free(model, owner, attribute)
            if owner != "world" and not massless and not free:
                named.append(f"{owner}.{attribute}")
    found = {}
    for name in named:
        owner, _, attribute = name.partition(".")
        array, at = _place(model, name, owner, attribute or None, "0")
        of_axes = not attribute or ATTRIBUTES[attribute][1].startswith("dof_") or array.ndim == 1
        found[name] = np.array(array if of_axes else array[at])
    return found


def _write(
    model: mujoco.MjModel,
    name: str,
    value: float,
    owner: str,
    attribute: str | None,
    at: str | None,
) -> None:
    array, index = _place(model, name, owner, attribute, at)
    if attribute in NOT_NEGATIVE and value < 0:
        raise TwinError(f"{name} = {value:g}: must be 0 or more")
    if attribute == "inertia" and value <= 0:
        raise TwinError(f"{name} = {value:g} kg m²: must be greater than 0")
    if attribute == "mass":
        if value <= 0:
            raise TwinError(f"{name} = {value:g} kg: must be greater than 0")
        body = model.body(owner).id
        if not model.body_mass[body] > 0:
            raise TwinError(
                f"{name}: this body has no mass in the file to scale its inertia from; set the mass"
                " of another part"
            )
        model.body_inertia[body] *= value / model.body_mass[body]
    if at is None and array.size > 1:  # all axes of a joint
        array[:] = value
    else:
        array[index] = value


def _limit(model: mujoco.MjModel, owner: str, attribute: str, places: set[int]) -> None:
    """Enable a range that was written."""
    kind, field = ATTRIBUTES[attribute]
    index = mujoco.mj_name2id(model, kind, owner)
    limited, (low, high) = getattr(model, LIMITED[attribute]), getattr(model, field)[index]
    name = f"{owner}.{attribute}"
    if not limited[index] and places != {0, 1}:
        missing = 1 if 0 in places else 0
        raise TwinError(
            f"{name}: the file has no such limit, so set both ends; {name}[{missing}] is missing"
        )
    if not low < high:
        raise TwinError(f"{name} = {low:g} to {high:g}: {name}[0] must be less than {name}[1]")
    limited[index] = 1


def _refuse_decided(model: mujoco.MjModel, name: str) -> None:
    """Refuse a parameter without effect."""
    plain = name.partition("[")[0]
    reason = DECIDED.get(plain, "")
    if reason == BURNS and not _burns(model):
        return
    owner, _, attribute = plain.partition(".")
    if attribute in ("pos", "range") and _is_free(model, owner, attribute):
        reason = "a free joint determines the position and has no range"
        if owner == "vehicle":
            reason = "the ramp determines the start; set ramp_position, ramp_elevation"
    if reason:
        raise TwinError(f"{name} has no effect: {reason}")


def _burns(model: mujoco.MjModel) -> bool:
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "motor_thrust")
    return found >= 0 and bool(model.numeric("motor_thrust").data.any())


def _is_free(model: mujoco.MjModel, owner: str, attribute: str) -> bool:
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, owner)
    if attribute == "pos":
        body = model.body(owner)
        joint = int(body.jntadr[0]) if body.jntnum[0] == 1 else -1
    return joint >= 0 and bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)


def _check_inertia(model: mujoco.MjModel, bodies: Iterable[str]) -> None:
    """Refuse impossible inertias: none may exceed the sum of the other two."""
    for body in bodies:
        a, b, c = sorted(model.body(body).inertia.tolist())
        if c > (a + b) * (1 + 1e-9):
            raise TwinError(
                f"{body}.inertia = {a:g}, {b:g}, {c:g} kg m²: the largest must not exceed the sum"
                " of the other two"
            )


def _place(
    model: mujoco.MjModel, name: str, owner: str, attribute: str | None, at: str | None
) -> tuple[np.ndarray, int]:
    """The array of a parameter and the index in it."""
    if attribute is None:
        return _indexed(_plain(model, owner), at, name)
    if attribute not in ATTRIBUTES:
        raise TwinError(f"{name}: no attribute {attribute!r}; valid: {', '.join(ATTRIBUTES)}")
    kind, field = ATTRIBUTES[attribute]
    index = mujoco.mj_name2id(model, kind, owner)
    if index < 0:
        known = _names(model, kind)
        raise TwinError(f"{name}: no {_kind(kind)} {owner!r}; {_nearest(owner, known)}")
    array = getattr(model, field)
    if field.startswith("dof_"):
        first, axes = int(model.jnt_dofadr[index]), DOFS[mujoco.mjtJoint(model.jnt_type[index])]
        return _indexed(array[first : first + axes], at or "0", name)
    return _indexed(array[index : index + 1] if array.ndim == 1 else array[index], at, name)


def _plain(model: mujoco.MjModel, owner: str) -> np.ndarray:
    """The array of a numeric or of an option."""
    if owner in OPTIONS:
        option = getattr(model.opt, owner)
        if isinstance(option, np.ndarray):
            return option
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, owner)
    if index < 0:
        known = [*_names(model, mujoco.mjtObj.mjOBJ_NUMERIC), *OPTIONS]
        raise TwinError(f"no parameter {owner!r}; {_nearest(owner, known)}")
    start = int(model.numeric_adr[index])
    return np.asarray(model.numeric_data[start : start + int(model.numeric_size[index])])


def _indexed(array: np.ndarray, at: str | None, name: str) -> tuple[np.ndarray, int]:
    if at is None and array.size > 1:
        raise TwinError(
            f"{name}: has {array.size} values; give {name}[0] to {name}[{array.size - 1}]"
        )
    index = int(at or 0)
    if index >= array.size:
        raise TwinError(f"{name}: index {index} must be at most {array.size - 1}")
    return array, index


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj) -> list[str]:
    names = []
    index = 0
    count = {
        mujoco.mjtObj.mjOBJ_BODY: model.nbody,
        mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_ACTUATOR: model.nu,
        mujoco.mjtObj.mjOBJ_NUMERIC: model.nnumeric,
    }[kind]
    for index in range(count):
        name = mujoco.mj_id2name(model, kind, index)
        if name:
            names.append(name)
    return names


def _kind(kind: mujoco.mjtObj) -> str:
    return str(kind.name).removeprefix("mjOBJ_").lower()


def _nearest(name: str, known: list[str]) -> str:
    near = get_close_matches(name, known, n=3)
    every = "`twin parameters` lists all"
    return f"did you mean {' or '.join(near)}? {every}" if near else every


def _examples() -> str:
    return "or BODY.mass, JOINT.damping, ACTUATOR.forcerange[1], gravity[2]"
