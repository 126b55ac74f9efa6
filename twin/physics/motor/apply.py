# ruff: noqa: ANN401 - MjSpec and MjModel elements share attributes, not a type
"""Another motor for a vehicle: its curve into the numerics, its masses into the bodies."""

from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np

from twin.errors import TwinError
from twin.physics.motor.curve import Motor
from twin.physics.motor.figures import MotorError
from twin.physics.motor.grain import Burn, Grain

REPLACES = "motor_replaces"  # 1: the numerics describe the motor, whatever the mechanism draws
SAME_WIDTH = 1e-4  # m; a casing this much narrower than its mount needs no adapter


def apply_motor(
    target: mujoco.MjSpec | mujoco.MjModel, motor: Motor, burn: Burn | None = None
) -> None:
    """Put a motor into a vehicle, before (`MjSpec`) or after (`MjModel`) it is compiled.

    The forward end stays where it is, so a shorter motor moves the nozzle up. The curve is
    thinned to the capacity of the numerics `motor_time` and `motor_thrust` with its impulse kept.
    The bodies `gimbal_motor` and `gimbal_propellant` have their origin in the middle of the
    casing and z along it.

    Raises
    ------
    MotorError : the motor is wider than the one the holder was made for
    TwinError : the vehicle carries no motor numerics or bodies
    """
    for name in ("motor_time", "motor_thrust", "motor_diameter", "motor_length"):
        _element(target, "numeric", name)
    bore = float(target.numeric("motor_diameter").data[0])
    _check_width(motor, bore)
    grain = Grain.of(motor, burn)
    _place(target, motor, grain, float(target.numeric("motor_length").data[0]))
    _write_numerics(target, motor, grain)
    if isinstance(target, mujoco.MjModel):
        mujoco.mj_setConst(target, mujoco.MjData(target))


def figures_of(target: mujoco.MjSpec | mujoco.MjModel) -> dict[str, float]:
    """Masses [kg] and sizes [m] of a vehicle's own motor, named as those of `Motor`.

    Raises
    ------
    TwinError : the vehicle carries no motor numerics
    """
    names = ("propellant_mass", "loaded_mass", "diameter", "length")
    return {n: float(_element(target, "numeric", f"motor_{n}").data[0]) for n in names}


def fit_stated_motor(spec: mujoco.MjSpec) -> None:
    """Give the motor's bodies the size and masses of the numerics, where these ask for it.

    A vehicle that attaches a mechanism cannot change the motor drawn there; with the numeric
    `motor_replaces` 1 its own numerics describe the motor.

    Raises
    ------
    MotorError : the motor is wider than the casing that is drawn
    TwinError : the casing is not a cylinder
    """
    numeric = spec.numeric(REPLACES)
    if numeric is None or not numeric.data[0]:
        return
    motor = _stated(spec)
    grain = Grain.of(motor, "end" if spec.numeric("motor_burn").data[0] else "core")
    casing = _casing(spec)
    if casing is None:
        raise TwinError("body 'gimbal_motor' has no cylinder that shows the motor's size")
    bore, present = 2 * float(casing.size[0]), 2 * float(casing.size[1])
    _check_width(motor, bore)
    _place(spec, motor, grain, present)
    numeric.data = [0.0]
    spec.numeric("motor_diameter").data = [bore]  # the width of the mount


def adapter_note(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """What to know about a motor narrower than its mount; nothing where it fits."""
    mount, casing = spec.numeric("motor_diameter"), _casing(spec)
    if mount is None or casing is None:
        return ()
    bore, width = float(mount.data[0]), 2 * float(casing.size[0])
    if width > bore - SAME_WIDTH:
        return ()
    note = (
        f"the motor is {width * 1e3:.4g} mm wide, its mount {bore * 1e3:.4g} mm: flown with an"
        " adapter that weighs nothing"
    )
    return (note,)


def _casing(spec: mujoco.MjSpec) -> Any:
    body = spec.body("gimbal_motor")
    return None if body is None else next(iter(_cylinders(spec, body)), None)


def _stated(spec: mujoco.MjSpec) -> Motor:
    """The motor that the numerics describe."""
    time, thrust = (np.array(spec.numeric(f"motor_{n}").data) for n in ("time", "thrust"))
    last = int(np.argmax(time)) + 1
    curve = {"time": time[:last], "thrust": thrust[:last]}
    return Motor(name="of the vehicle", **curve, **figures_of(spec))  # type: ignore[arg-type]


def _check_width(motor: Motor, bore: float) -> None:
    """Refuse a motor wider than its mount [m]."""
    if motor.diameter > bore * (1 + 1e-6):
        raise MotorError(
            f"motor {motor.name!r} is {motor.diameter * 1e3:g} mm wide;"
            f" the holder takes {bore * 1e3:g} mm: give a --motor FILE.eng of at most that, or a"
            " vehicle with a wider one"
        )


def _element(target: Any, kind: str, name: str) -> Any:
    try:
        found = getattr(target, kind)(name)
    except KeyError:
        found = None
    if found is None:
        raise TwinError(f"the vehicle has no {kind} {name!r}, so no motor can be put into it")
    return found


def numerics_of(motor: Motor, grain: Grain, capacity: int) -> dict[str, list[float]]:
    """Values of the numerics `motor_*` that describe a motor, its curve thinned to `capacity`.

    All but `motor_diameter`, which is the width of the mount, and `motor_ignition`.
    """
    curve = motor.simplified(capacity)
    rest = capacity - curve.time.size
    return {
        "motor_time": [*curve.time.tolist(), *[curve.burn_time] * rest],
        "motor_thrust": [*curve.thrust.tolist(), *[0.0] * rest],
        "motor_impulse": [curve.impulse],
        "motor_propellant_mass": [motor.propellant_mass],
        "motor_loaded_mass": [motor.loaded_mass],
        "motor_length": [motor.length],
        "motor_grain_length": [grain.length],
        "motor_grain_radius": [grain.radius],
        "motor_burn": [1.0 if grain.burn == "end" else 0.0],
    }


def _write_numerics(target: mujoco.MjSpec | mujoco.MjModel, motor: Motor, grain: Grain) -> None:
    capacity = min(len(target.numeric(n).data) for n in ("motor_time", "motor_thrust"))
    for name, data in numerics_of(motor, grain, capacity).items():
        numeric = _element(target, "numeric", name)
        padded = [*data, *list(numeric.data)[len(data) :]]
        if isinstance(target, mujoco.MjModel):
            numeric.data[:] = padded
        else:
            numeric.data = padded


def _place(target: Any, motor: Motor, grain: Grain, present: float) -> None:
    """Forward end kept: middle up by half, nozzle up by all of what the motor is shorter.

    `present` is the length of the motor in place [m].
    """
    shorter = present - motor.length
    nozzle = _element(target, "site", "gimbal_nozzle")
    nozzle.pos = np.asarray(nozzle.pos) + shorter * _axis(nozzle.quat)
    casing_mass = motor.loaded_mass - motor.propellant_mass
    r, length = motor.diameter / 2, motor.length
    hoop = _closed_tube(casing_mass, r, length)
    mass, ahead, transverse, axial = grain.remaining(0.0)
    shapes = {
        "gimbal_motor": (casing_mass, 0.0, hoop[0], hoop[1], r, length),
        "gimbal_propellant": (mass, ahead, transverse, axial, grain.radius, grain.length),
    }
    for name, (m, z, across, along, radius, extent) in shapes.items():
        body = _element(target, "body", name)
        body.pos = np.asarray(body.pos) + shorter / 2 * _axis(body.quat)
        body.mass, body.ipos, body.iquat = m, [0.0, 0.0, z], [1.0, 0.0, 0.0, 0.0]
        body.inertia = [across, across, along]
        if isinstance(target, mujoco.MjModel):
            target.body_sameframe[body.id] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        else:
            body.explicitinertial = True
        for geom in _cylinders(target, body):
            geom.size = [radius, extent / 2, 0.0]


def _closed_tube(mass: float, radius: float, length: float) -> tuple[float, float]:
    """Transverse and axial inertia of a thin tube with both ends closed [kg m²]."""
    wall = mass * length / (length + radius)  # areas 2πrl and 2·πr²
    ends, r2, l2 = mass - wall, radius * radius, length * length
    across = wall * (r2 / 2 + l2 / 12) + ends * (r2 / 4 + l2 / 4)
    return across, wall * r2 + ends * r2 / 2


def _axis(quaternion: Sequence[float]) -> np.ndarray:
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(quaternion, dtype=float))
    return rotation.reshape(3, 3)[:, 2]


def _cylinders(target: Any, body: Any) -> Iterable[Any]:
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER
    if isinstance(target, mujoco.MjModel):
        first, count = int(body.geomadr[0]), int(body.geomnum[0])
        geoms = [target.geom(k) for k in range(first, first + count)]
        return [geom for geom in geoms if geom.type[0] == kind]
    return [geom for geom in body.geoms if geom.type == kind]
