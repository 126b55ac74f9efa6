"""What `Plant.advance` does, for compiled code: MuJoCo's steps without a call of Python each."""

# ruff: noqa: ANN401, ARG001 - numba hands its builders objects that carry no types
import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from llvmlite import ir
from mujoco.introspect import structs
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.physics.mechanism.loops import servo_pair
from twin.physics.motor.depletion import Fuel, burn
from twin.physics.native.layout import (
    DATA,
    MODEL,
    TIMESTEP,
    _place,
    _struct_extent,
    constant,
    integer,
    size,
)
from twin.plant.flow import Air, blow
from twin.plant.rods import find_gaps
from twin.plant.steps.smooth import SAME, Division, part

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
Words = NDArray[np.int32]

ON, TOO_FAST, PAST_STOP, APART = range(4)
"""How an advance ends: it goes on, or has diverged."""

_NO_CONSTRAINT: Final = np.int32(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
_DISABLED: Final = int(MODEL["opt"]) + _place(structs.STRUCTS["mjOption"].fields)[0]["disableflags"]
_NCON, _CONTACT = DATA["ncon"], DATA["contact"]
_OF_CONTACT = structs.STRUCTS["mjContact"].fields
_GEOM: Final = constant(_place(_OF_CONTACT)[0]["geom"])
_STRIDE: Final = constant(_struct_extent(_OF_CONTACT)[0])


class Steps(NamedTuple):
    """What an advance needs of a plant.

    Attributes
    ----------
    model, data : addresses
    step, kinematics, collision : addresses of `mj_step`, `mj_kinematics` and `mj_collision`
    dt_ns : physics step [ns]
    renewal : most steps between two updates of the propellant
    qvel, angle : views of all velocities, and of the gimbal joints (2,)
    stops : gimbal angles beyond which it has diverged: x low, high, y low, high [rad]
    largest : square of the speed beyond which the state has diverged
    height : (1,) view of the vehicle's height [m]
    own, fixed : of each geom, whether it belongs to the vehicle, and to the ground
    division : of steps
    clock : (1,) views of the model's time step and of the time [s]
    flags : (1,) view of what the model disables
    """

    model: int
    data: int
    step: int
    kinematics: int
    collision: int
    dt_ns: int
    renewal: int
    qvel: Array
    angle: Array
    stops: Array
    largest: float
    height: Array
    own: Flags
    fixed: Flags
    division: Division
    clock: tuple[Array, Array]
    flags: Words


class Drive(NamedTuple):
    """Where commands go.

    Attributes
    ----------
    loops : of the linkage (2, SIZE); empty where commands are gimbal angles
    places : (2,) of both actuators in `ctrl`; empty of a fixed motor
    ctrl : of the model
    """

    loops: Array
    places: Integers
    ctrl: Array


class Gaps(NamedTuple):
    """What the gaps of the rods and the angles of the shafts follow from.

    Attributes
    ----------
    closure : (2,) written [m]
    sites, loops : places of all sites, and the pairs that the rods join; empty without rods
    open : largest gap [m]
    servo, qpos, shafts : angles (2,) written [rad], the model's positions, places in them (2,)
    """

    closure: Array
    sites: Array
    loops: Integers
    open: float
    servo: Array
    qpos: Array
    shafts: Integers


class Native(NamedTuple):
    """A plant for compiled code; see the parts."""

    steps: Steps
    fuel: Fuel
    drive: Drive
    gaps: Gaps
    air: Air


def functions() -> tuple[int, int, int] | None:
    """Addresses of `mj_step`, `mj_kinematics` and `mj_collision` in the library of the bindings.

    None where it is not found, or while no native forces are installed, by which it is known.
    """
    return None if mujoco.get_mjcb_passive() is None else _functions()


@cache
def _functions() -> tuple[int, int, int] | None:
    folder = Path(mujoco.__file__).parent
    for file in (*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")):
        try:
            library = ctypes.CDLL(str(file))
            ours = ctypes.c_void_p.in_dll(library, "mjcb_passive").value
        except (OSError, ValueError):
            continue
        if ours:
            names = ("mj_step", "mj_kinematics", "mj_collision")
            found = [ctypes.cast(library[name], ctypes.c_void_p).value or 0 for name in names]
            return (found[0], found[1], found[2]) if all(found) else None
    return None


def settings(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[tuple[Array, Array], NDArray[np.int32]]:
    """`Steps.clock` and `Steps.flags` of a model."""
    step, time = (
        np.ctypeslib.as_array((ctypes.c_double * 1).from_address(place))
        for place in (model._address + int(TIMESTEP), data._address + int(DATA["time"]))
    )
    flags = (ctypes.c_int32 * 1).from_address(model._address + _DISABLED)
    return (step, time), np.ctypeslib.as_array(flags)


def _call(typing_context: Any, function: Any, model: Any, data: Any) -> Any:
    """Call a C function of two pointers without a result, all three given as addresses."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, byte])
        callee = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(callee, [builder.inttoptr(a, byte) for a in arguments[1:]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


call: Callable[[int, int, int], None] = intrinsic(_call)


@njit(nogil=True)
def step_divided(p: Steps, fuel: Fuel, begun: int, n: int) -> None:
    """Take `n` steps after `begun` ones in parts, each with the propellant of its middle.

    Where a vehicle has no constraint but contacts, which end its flight, they are looked for at the
    end only.
    """
    step, time = p.clock
    enabled = p.flags[0]
    if p.division.bare:
        p.flags[0] = enabled | _NO_CONSTRAINT
    for k in range(begun, begun + n):
        t, end = k * p.dt_ns * 1e-9, (k + 1) * p.dt_ns * 1e-9
        while t < end - SAME:
            h = part(p.division, t, end)
            burn(t + 0.5 * h, fuel)
            step[0] = h
            call(p.step, p.model, p.data)
            t += h
        time[0] = end
    step[0], p.flags[0] = p.dt_ns * 1e-9, enabled


@njit(nogil=True)
def landed(p: Steps) -> bool:
    """`Plant.landed`."""
    first = size(p.data, _CONTACT)
    for k in range(integer(p.data, _NCON)):
        one = integer(first, k * _STRIDE + _GEOM)
        other = integer(first, k * _STRIDE + _GEOM + 4)
        outer = (p.own[one] and p.fixed[other]) or (p.fixed[one] and p.own[other])
        if one >= 0 and other >= 0 and outer:
            return True
    return bool(p.height[0] < 0.0)


@njit(nogil=True)
def advance(p: Steps, fuel: Fuel, begun: int, n: int) -> tuple[int, int]:
    """Take `n` steps after `begun` ones; gives the steps taken by then, and how it ended."""
    while n > 0:
        now = min(n, p.renewal)
        if p.division.rates.size:
            step_divided(p, fuel, begun, now)
        else:
            burn(begun * p.dt_ns * 1e-9, fuel)
            for _ in range(now):
                call(p.step, p.model, p.data)
        call(p.kinematics, p.model, p.data)
        if p.division.bare:
            call(p.collision, p.model, p.data)
        begun += now
        n -= now
        square = 0.0
        for v in p.qvel:
            square += v * v
        if not square < p.largest:
            return begun, TOO_FAST
        x, y, s = p.angle[0], p.angle[1], p.stops
        inside = s[0] <= x <= s[1] and s[2] <= y <= s[3]
        if not (inside or landed(p)):
            return begun, PAST_STOP
    return begun, ON


@njit(nogil=True)
def drive(d: Drive, x: float, y: float) -> None:
    """`Plant.drive`."""
    if d.places.size == 0:
        return
    if d.loops.size:
        x, y = servo_pair(d.loops, x, y)
    d.ctrl[d.places[0]], d.ctrl[d.places[1]] = x, y


@njit(nogil=True)
def derive(p: Native, time: float) -> bool:
    """`Plant.derive` at `time` [s]; False where the rods have come apart."""
    g = p.gaps
    if g.loops.size:
        find_gaps(g.closure, g.sites, g.loops)
        g.servo[0], g.servo[1] = g.qpos[g.shafts[0]], g.qpos[g.shafts[1]]
        if not (g.closure[0] <= g.open and g.closure[1] <= g.open):
            return False
    blow(p.air, time)
    return True
