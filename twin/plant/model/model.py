"""The model of a run: built from its files, with its parameters set and checked."""

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.introspect import structs

from twin.physics import native
from twin.physics.mechanism import check_frame
from twin.physics.mechanism.servo import apply_servo
from twin.plant.authority import LIMIT, settle_limit
from twin.plant.model import overrides as override
from twin.plant.model.build import REFERENCE_GIMBAL, ModelConfig, Moved, Seat
from twin.plant.model.plausible import check_vehicle
from twin.plant.model.reuse import reused

__all__ = ["REFERENCE_GIMBAL", "ModelConfig", "Seat", "TwinModel", "digest", "load"]

# Fields of a model that its digest leaves out: memory, and how it is drawn.
NOT_PHYSICS = ("opt", "stat", "vis", "buffer", "nbuffer", "signature")


@dataclass(frozen=True)
class TwinModel:
    """A compiled model and how its gimbal is moved.

    Attributes
    ----------
    mj : the compiled model; the plant of a run is its only writer
    gimbal : the seat that moves the gimbal; `fixed` where the vehicle has no gimbal
    sha256 : digest of the compiled model, the same for the same physics; empty if not asked for
    notes : for the user, one line each
    """

    mj: mujoco.MjModel
    gimbal: Moved
    sha256: str
    notes: tuple[str, ...] = ()


def load(
    config: ModelConfig,
    settle: Callable[[mujoco.MjModel], None] = lambda _: None,
    *,
    digested: bool = True,
) -> TwinModel:
    """The model of a run.

    Parameters
    ----------
    settle : called last with the compiled model, before its digest is taken
    digested : whether it is taken, which only a recording needs

    Raises
    ------
    TwinError : a file, name or number that cannot be used, in one line
    """
    built = reused(config)
    model, seat = built.mj, built.gimbal
    override.apply(model, {**_seeded(model, config.seed), **config.overrides})
    if not any(name.partition("[")[0] == LIMIT for name in config.overrides):
        settle_limit(model)
    if seat == "linkage":
        apply_servo(model)
    native.bind(model)
    if seat != "fixed":
        check_frame(model)
    check_vehicle(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    settle(model)
    return TwinModel(model, seat, digest(model) if digested else "", built.notes)


def digest(model: mujoco.MjModel) -> str:
    """SHA-256 of a compiled model's numbers and names; where its files lie is left out."""
    total = hashlib.sha256()
    for part in (model, model.opt, model.stat):
        for name in _fields(f"mj{type(part).__name__.removeprefix('Mj')}"):
            total.update(name.encode())
            value = getattr(part, name)
            total.update(value if isinstance(value, bytes) else np.asarray(value).tobytes())
    return total.hexdigest()


@functools.cache
def _fields(struct: str) -> tuple[str, ...]:
    """Fields of one of MuJoCo's structures that do not depend on the folder of the files."""
    names = (field.name for field in structs.STRUCTS[struct].fields)
    return tuple(name for name in names if name not in NOT_PHYSICS and "path" not in name)


def _seeded(model: mujoco.MjModel, seed: int) -> dict[str, float]:
    carries = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "wind_seed") >= 0
    return {"wind_seed": float(seed)} if carries else {}
