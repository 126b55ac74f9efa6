"""Unit and meaning of named model parameters."""

import re

from twin.physics.native.names import ALL, Numeric

# numerics of the mechanism, the benches and the attitude loop: those of the forces stand in ALL
_OTHERS = (
    Numeric("control_limit", 1, "rad", "largest commanded gimbal angle, either way", ""),
    Numeric("control_kp", 1, "1/s²", "proportional gain of the attitude loop", ""),
    Numeric("control_ki", 1, "1/s³", "integral gain", ""),
    Numeric("control_kd", 1, "1/s", "rate gain", ""),
    Numeric("control_cutoff", 1, "rad/s", "cut-off of the low-pass of the rate", ""),
    Numeric("control_rate_limit", 1, "rad/s", "limit of the commanded rate; 0: off", ""),
    Numeric("control_error_limit", 1, "rad", "limit of the attitude error", ""),
    Numeric("control_authority_floor", 1, "1/s²", "below it the gimbal is centred", ""),
    Numeric("gimbal_servo_resistance", 1, "Ω", "winding of the servo motors", ""),
    Numeric("gimbal_servo_motor_constant", 1, "N m/A", "torque and back-EMF at the shaft", ""),
    Numeric("gimbal_servo_voltage", 1, "V", "supply of the servos", ""),
    Numeric("gimbal_servo_gain", 1, "N m/rad", "position gain of the servos", ""),
    Numeric("gimbal_servo_rate_gain", 1, "N m s/rad", "velocity feedback; 0: none", ""),
    Numeric("gimbal_servo_slew", 1, "rad/s", "speed limit of the set point; 0: none", ""),
    Numeric("gimbal_servo_dead_band", 1, "rad", "half width of the dead band; 0: none", ""),
    Numeric("gimbal_backlash", 1, "rad", "gear play at the horn, stop to stop; 0: none", ""),
    Numeric("gimbal_stroke", 1, "rad", "largest command that the mechanism is made for", ""),
    Numeric("gimbal_closure_limit", 1, "m", "gap of a rod that counts as diverged", ""),
    Numeric("switch_angle", 4, "rad", "angles at which the limit switches close", ""),
    Numeric("turntable_lead", 2, "s, s²", "feed-forward of the base servo", ""),
    Numeric("gravity", 3, "m/s²", "acceleration of gravity", ""),
)
# of elements: unit and meaning by attribute
_ATTRIBUTES = {
    "mass": ("kg", "mass of the body; its inertia follows"),
    "inertia": ("kg m²", "principal moments of inertia of the body"),
    "pos": ("m", "position of the body in its parent"),
    "stiffness": ("N m/rad", "spring of the joint"),
    "range": ("rad", "stops of the joint"),
    "damping": ("N m s/rad", "viscous friction of the joint"),
    "armature": ("kg m²", "inertia of the drive, at the joint"),
    "frictionloss": ("N m", "dry friction of the joint"),
    "ctrlrange": ("rad", "limits of the command of the actuator"),
    "forcerange": ("N m", "limits of the torque of the actuator"),
}
_KNOWN = {numeric.name: numeric for numeric in (*ALL, *_OTHERS)}
_NAME = re.compile(r"(.+?)(?:\[(\d+)\])?")


def unit_and_meaning(name: str) -> tuple[str, str] | None:
    """Unit and meaning of a parameter, by a name that `--set` takes.

    The names of the mechanism are known with and without the prefix that they have in a scene;
    None for a numeric that only a given model has.
    """
    match = _NAME.fullmatch(name)
    plain, at = (match[1], match[2]) if match else (name, None)
    known = _KNOWN.get(plain) or _KNOWN.get(f"gimbal_{plain}")
    if known is None:
        return _ATTRIBUTES.get(plain.rpartition(".")[2]) if "." in plain else None
    units = known.unit.split(", ")  # of each number, where they differ
    several = at is not None and len(units) > 1 and int(at) < len(units)
    return units[int(at or 0)] if several else known.unit, known.meaning
