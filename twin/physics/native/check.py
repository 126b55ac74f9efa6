"""Validity of the numerics that the compiled forces read.

A callback cannot raise, so values that would make it divide by zero, read past a table or give
wrong forces are refused here, before a flight.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.aerodynamics.atmosphere import COLUMNS
from twin.physics.native.names import ALL, NUMERICS, Numeric

Array = NDArray[np.float64]

SWITCHES: Final = ("air_enabled", "air_model", "motor_burn", "wind_model")
ROUNDED: Final = 1e-3  # rad; 2π as it is written
POSITIVE: Final = ("wind_reference_height",)
NOT_NEGATIVE: Final = (
    "air_strip_area",
    "air_reference_area",
    "air_crossflow_drag",
    "air_axial_drag",
    "air_roll_damping",
    "wind_speed",
    "wind_exponent",
    "wind_turbulence",
    "ramp_stiffness",
    "ramp_damping",
    "air_pitch_damping",
    "air_drag_coasting",
    "air_drag_thrusting",
    "gravity_radius",
    "chute_drag_area",
)
MOTOR_POSITIVE: Final = (
    "motor_propellant_mass",
    "motor_loaded_mass",
    "motor_length",
    "motor_diameter",
    "motor_grain_length",
    "motor_grain_radius",
)
PAIRS: Final = (
    ("air_drag_mach", "air_drag_coasting"),
    ("air_drag_mach", "air_drag_thrusting"),
    ("chute_drag_area", "chute_delay"),
    ("chute_drag_area", "chute_height"),
    ("chute_drag_area", "chute_z"),
    ("air_strip_z", "air_strip_area"),
    ("air_nose_slope", "air_nose_z"),
    ("air_fin_slope", "air_fin_z"),
    ("motor_time", "motor_thrust"),
)
TOGETHER: Final = {
    "air_drag_mach": ("air_drag_coasting",),
    "air_drag_thrusting": ("air_drag_mach",),
    "chute_drag_area": ("chute_delay", "chute_height", "chute_z"),
}
IMPULSE_TOLERANCE: Final = 0.01  # rounding of motor files

_ALWAYS: Final = {numeric.name for numeric in NUMERICS}
_UNIT: Final = {numeric.name: numeric.unit for numeric in ALL}


def check(model: mujoco.MjModel) -> None:
    """Refuse invalid numerics.

    A model without thrust has no motor: its other motor numerics are not checked.

    Raises
    ------
    TwinError : the first invalid numeric, its value and the valid range
    """
    values: dict[str, Array] = {
        n.name: model.numeric(n.name).data for n in ALL if n.name in _ALWAYS or _carries(model, n)
    }
    for name, data in values.items():
        _demand(name, data, np.isfinite(data), "must be finite")
    for name in (n for n in SWITCHES if n in values):
        _demand(name, values[name], np.isin(values[name], (0.0, 1.0)), "must be 0 or 1")
    for name in POSITIVE:
        _demand(name, values[name], values[name] > 0, "must be positive")
    for name in (n for n in NOT_NEGATIVE if n in values):
        _demand(name, values[name], values[name] >= 0, "must not be negative")
    azimuth = values["wind_azimuth"]
    degrees = f"must be within a turn, ±2π; write {azimuth[0]:g}° if it is in degrees"
    _demand("wind_azimuth", azimuth, np.abs(azimuth) <= 2 * np.pi + ROUNDED, degrees)
    if values["air_model"][0] == 1:
        offset = values["air_thesis_offset"]
        _demand("air_thesis_offset", offset, offset > 0, "must be positive")
    for one, other in PAIRS:
        if one in values and other in values and values[one].size != values[other].size:
            raise TwinError(
                f"{one} has {values[one].size} values and {other} {values[other].size};"
                " they must have the same number"
            )
    if "air_drag_mach" in values:
        mach = values["air_drag_mach"]
        ascending = np.diff(mach, prepend=-1.0) > 0
        _demand("air_drag_mach", mach, ascending & (mach >= 0), "must ascend from 0 or more")
    if "air_profile" in values:
        _check_profile(values["air_profile"])
    for one, others in TOGETHER.items():
        if one in values and any(other not in values for other in others):
            raise TwinError(f"numeric {one}: needs {' and '.join(others)} beside it")
    _check_motor(values)


def _check_profile(profile: Array) -> None:
    if profile.size % COLUMNS:
        raise TwinError(f"air_profile has {profile.size} values; must have {COLUMNS} a level")
    height, _, _, density, temperature = profile.reshape(COLUMNS, -1)
    rising = np.diff(height, prepend=-np.inf) > 0
    _demand("air_profile", height, rising, "heights must ascend")
    _demand("air_profile", density, density > 0, "density must be positive")
    _demand("air_profile", temperature, temperature > 0, "temperature must be positive")


def _carries(model: mujoco.MjModel, numeric: Numeric) -> bool:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, numeric.name) >= 0


def _demand(name: str, data: Array, good: NDArray[np.bool_], wanted: str) -> None:
    if not good.all():
        k = int(np.argmin(good))
        place = f"[{k}]" if data.size > 1 else ""
        unit = "" if _UNIT[name] == "-" else f" {_UNIT[name]}"
        raise TwinError(f"numeric {name}{place} = {data[k]:g}{unit}: {wanted}")


def _check_motor(values: dict[str, Array]) -> None:
    time, thrust, stated = (values[f"motor_{name}"] for name in ("time", "thrust", "impulse"))
    _demand("motor_thrust", thrust, thrust >= 0, "must not be negative")
    if not thrust.any():
        _demand("motor_impulse", stated, stated == 0, "must be 0 where motor_thrust is all 0")
        return
    _check_curve(time, thrust)
    for name in MOTOR_POSITIVE:
        _demand(name, values[name], values[name] > 0, "must be positive")
    loaded, propellant = values["motor_loaded_mass"], values["motor_propellant_mass"]
    heavier = f"must be more than motor_propellant_mass = {propellant[0]:g} kg"
    _demand("motor_loaded_mass", loaded, loaded > propellant[0], heavier)
    impulse = float(np.trapezoid(thrust, time))
    near = np.abs(stated - impulse) <= IMPULSE_TOLERANCE * impulse
    _demand(
        "motor_impulse",
        stated,
        near,
        f"must be the integral of the thrust curve, {impulse:.6g} N s",
    )


def _check_curve(time: Array, thrust: Array) -> None:
    """As in `motor.curve`, with padding that repeats the last time."""
    start = np.arange(time.size) > 0
    _demand("motor_time", time, start | (time == 0), "the curve must start at 0 s")
    last = int(np.argmax(time))
    rising = np.diff(time, prepend=-1.0) > 0
    padding = (np.arange(time.size) > last) & (time == time[last])
    wanted = "must be later than the point before it, or repeat the last time as padding"
    _demand("motor_time", time, rising | padding, wanted)
    beyond = np.arange(time.size) >= last
    _demand("motor_thrust", thrust, ~beyond | (thrust == 0), "must be 0 where the curve ends")
