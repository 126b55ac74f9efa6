"""Index of the numerics, bodies and sites of a model, for the compiled forces.

The index of a model is the numeric `native_index`: a mark, three ids, then start and
size of every numeric of `native.names` in `numeric_data`. `bind` writes it; a model that was not
bound is searched by name at every call, which is slower.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.aerodynamics import gust_modes
from twin.physics.aerodynamics.atmosphere import MODE
from twin.physics.native.cache import jit
from twin.physics.native.check import check
from twin.physics.native.layout import MODEL, characters, constant, floats, integers, size
from twin.physics.native.names import ALL, BODIES, INDEX, NUMERICS, SITES, SLOT
from twin.physics.native.ramp import launch_pose

MARK: Final = 20260101.0 + len(ALL)  # of a bound model, unlike older ones
VEHICLE, PROPELLANT, NOZZLE, FIRST = 1, 2, 3, 4  # slots before the numerics' (start, size) pairs
LENGTH: Final = FIRST + 2 * len(ALL)


def _packed(names: tuple[str, ...]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Names as zero-terminated bytes, and where each starts."""
    joined = [name.encode() + b"\0" for name in names]
    starts = np.cumsum([0] + [len(name) for name in joined[:-1]])
    return np.frombuffer(b"".join(joined), np.uint8), starts


_TEXT, _START = _packed((INDEX, *BODIES, *SITES, *(n.name for n in ALL)))
_OWN: Final = constant(0)  # of the packed names; the others follow in the order of their slots
_LEAST = np.array([n.size for n in ALL])
_NAMES, _NAMES_SIZE = MODEL["names"], MODEL["nnames"]
_NUMERICS, _NUMERIC_NAMES = MODEL["nnumeric"], MODEL["name_numericadr"]
_ADDRESS, _SIZE = MODEL["numeric_adr"], MODEL["numeric_size"]
_DATA, _DATA_SIZE = MODEL["numeric_data"], MODEL["nnumericdata"]
_BODIES, _BODY_NAMES = MODEL["nbody"], MODEL["name_bodyadr"]
_SITES, _SITE_NAMES = MODEL["nsite"], MODEL["name_siteadr"]


@jit
def _find(text: NDArray[np.uint8], starts: NDArray[np.int32], name: int) -> int:
    """Position in `starts` of a packed name, or -1."""
    for k in range(starts.size):
        a, b = starts[k], _START[name]
        while text[a] == _TEXT[b] and text[a] != 0:
            a += 1
            b += 1
        if text[a] == _TEXT[b]:
            return k
    return -1


@jit
def resolve(m: int, index: NDArray[np.float64]) -> None:
    """Fill an index (LENGTH,) by name; -1 for what the model lacks."""
    text = characters(m, _NAMES, size(m, _NAMES_SIZE))
    bodies = integers(m, _BODY_NAMES, size(m, _BODIES))
    sites = integers(m, _SITE_NAMES, size(m, _SITES))
    numerics = integers(m, _NUMERIC_NAMES, size(m, _NUMERICS))
    starts = integers(m, _ADDRESS, size(m, _NUMERICS))
    sizes = integers(m, _SIZE, size(m, _NUMERICS))
    index[0] = MARK
    index[VEHICLE] = _find(text, bodies, _OWN + VEHICLE)
    index[PROPELLANT] = _find(text, bodies, _OWN + PROPELLANT)
    index[NOZZLE] = _find(text, sites, _OWN + NOZZLE)
    for k in range(_LEAST.size):
        found = _find(text, numerics, _OWN + FIRST + k)
        short = found < 0 or sizes[found] < _LEAST[k]
        index[FIRST + 2 * k] = -1 if short else starts[found]
        index[FIRST + 2 * k + 1] = 0 if short else sizes[found]


@jit
def locate(m: int) -> tuple[bool, NDArray[np.float64]]:
    """Whether a model has an index, and the index; searched by name unless bound."""
    data = floats(m, _DATA, size(m, _DATA_SIZE))
    starts = integers(m, _ADDRESS, size(m, _NUMERICS))
    sizes = integers(m, _SIZE, size(m, _NUMERICS))
    for k in range(starts.size):
        if sizes[k] >= LENGTH and data[starts[k]] == MARK:
            return True, data[starts[k] : starts[k] + LENGTH]
    text = characters(m, _NAMES, size(m, _NAMES_SIZE))
    names = integers(m, _NUMERIC_NAMES, size(m, _NUMERICS))
    found = _find(text, names, _OWN)
    if found < 0:
        return False, data[:0]
    index = np.empty(LENGTH)
    resolve(m, index)
    return True, index


def slot(name: str) -> int:
    """Place in an index of a numeric's start; its size follows."""
    return constant(FIRST + 2 * SLOT[name])


@jit
def value(data: NDArray[np.float64], index: NDArray[np.float64], at: int) -> float:
    """First value of the numeric at a slot."""
    first: float = data[int(index[at])]
    return first


@jit
def values(data: NDArray[np.float64], index: NDArray[np.float64], at: int) -> NDArray[np.float64]:
    """All values of the numeric at a slot; empty where the model lacks it."""
    start = max(0, int(index[at]))
    return data[start : start + int(index[at + 1])]


def entries(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Index of a model (LENGTH,), by MuJoCo's own name lookup; -1 for what it lacks."""
    body, site, numeric = (
        mujoco.mjtObj.mjOBJ_BODY,
        mujoco.mjtObj.mjOBJ_SITE,
        mujoco.mjtObj.mjOBJ_NUMERIC,
    )
    ids = [mujoco.mj_name2id(model, body, name) for name in BODIES]
    ids += [mujoco.mj_name2id(model, site, name) for name in SITES]
    pairs: list[int] = []
    for wanted in ALL:
        found = mujoco.mj_name2id(model, numeric, wanted.name)
        fits = found >= 0 and model.numeric_size[found] >= wanted.size
        pairs += [model.numeric_adr[found], model.numeric_size[found]] if fits else [-1, 0]
    return np.array([MARK, *ids, *pairs], dtype=np.float64)


def bind(model: mujoco.MjModel) -> None:
    """Prepare a compiled vehicle for the compiled forces; call again after changing its numerics.

    Writes `native_index`, generates the gusts of `wind_seed`, and sets the initial pose of the
    joint `vehicle` (qpos0) to the ramp. Models without `native_index` are left unchanged.

    Raises
    ------
    TwinError : numerics that the forces need are missing or too short, or have impossible values
    """
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, INDEX) < 0:
        return
    index = model.numeric(INDEX).data
    if index.size < LENGTH:
        raise TwinError(f"numeric '{INDEX}': has size {index.size}; must have {LENGTH} or more")
    found = entries(model)
    _require(found)
    check(model)
    index[:LENGTH] = found
    _write_gusts(model)
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "vehicle")
    if joint >= 0:
        start = model.jnt_qposadr[joint]
        model.qpos0[start : start + 7] = launch_pose(model)


def _require(index: NDArray[np.float64]) -> None:
    missing = [f"body '{n}'" for n, k in zip(BODIES, index[VEHICLE:NOZZLE], strict=True) if k < 0]
    missing += [f"site '{n}'" for n, k in zip(SITES, index[NOZZLE:FIRST], strict=True) if k < 0]
    pairs = zip(NUMERICS, index[FIRST::2], strict=False)  # what is optional comes last
    missing += [f"numeric '{n.name}' (size ≥ {n.size}, {n.unit})" for n, k in pairs if k < 0]
    if missing:
        raise TwinError(
            f"the model lacks {'; '.join(missing)}; docs/aerodynamics.md describes them"
        )


def _write_gusts(model: mujoco.MjModel) -> None:
    modes = model.numeric("wind_modes").data
    seed, length = model.numeric("wind_seed").data[0], model.numeric("wind_length").data[0]
    if not 0 <= seed < 2**53 or seed != int(seed):
        raise TwinError(f"wind_seed = {seed:g}: must be a whole number from 0 to 2⁵³")
    if not length > 0:
        raise TwinError(f"wind_length = {length:g} m: must be positive")
    count = modes.size // MODE
    model_of = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "wind_model")
    dryden = model_of >= 0 and bool(model.numeric("wind_model").data[0])
    modes[: MODE * count] = gust_modes(int(seed), float(length), count, dryden=dryden)
