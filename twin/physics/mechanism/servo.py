"""Named servo parameters of a model, written into its actuators and joints."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.physics.mechanism.names import MechanismError, find, prefix

Array = NDArray[np.float64]
# indices of a dcmotor's parameters (XMLreference, actuator/dcmotor; checked by a test)
RESISTANCE, CONSTANT, GAIN, DAMPING, VOLTAGE = 0, 1, 4, 6, 7  # actuator_gainprm
SLEW = 7  # actuator_dynprm
UNLIMITED = 1e9  # rad/s; no slew limit: zero would remove the activation
# kg m², a thirtieth of the rotor, and N m s; this inertia bounds the stiffness of the limit
PLAY_ARMATURE, PLAY_DAMPING = 2e-6, 1e-4


def apply_servo(model: mujoco.MjModel) -> None:
    """Write the numerics `servo_*` of a compiled model into its servos.

    A numeric with one value serves both axes, with two `[x, y]` each its own. Models without these
    numerics, or with servos other than `dcmotor`, keep the values of their file.

    Raises
    ------
    MechanismError : an impossible value
    """
    before = prefix(model)
    for index, axis in enumerate(AXES):
        servo = find(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{before}servo_{axis}")
        if servo < 0 or model.actuator_gaintype[servo] != mujoco.mjtGain.mjGAIN_DCMOTOR:
            continue
        gain = model.actuator_gainprm[servo]
        for slot, name in (
            (RESISTANCE, "resistance"),
            (CONSTANT, "motor_constant"),
            (VOLTAGE, "voltage"),
            (GAIN, "gain"),
        ):
            gain[slot] = _value(model, f"{before}servo_{name}", index, gain[slot], positive=True)
        # K²/R cancels the back-EMF compensation of MuJoCo's controller, which a 9 g servo lacks
        emf = gain[CONSTANT] ** 2 / gain[RESISTANCE]
        gain[DAMPING] = emf + _value(model, f"{before}servo_rate_gain", index, 0.0)
        if model.actuator_actnum[servo] > 0:
            slew = _value(model, f"{before}servo_slew", index, model.actuator_dynprm[servo, SLEW])
            model.actuator_dynprm[servo, SLEW] = slew or UNLIMITED
        if model.nuser_actuator:
            user = model.actuator_user[servo]
            user[0] = _value(model, f"{before}servo_dead_band", index, user[0])


def insert_backlash(spec: mujoco.MjSpec, backlash: float | None = None) -> None:
    """Insert a backlash joint between each servo shaft and its horn; none where it is zero.

    The joint `play_x` lies in the horn's body behind `servo_x`, limited to ± half the backlash, so
    that a horn's angle is the sum of the two.

    Parameters
    ----------
    spec : model before compilation
    backlash : of both axes, stop to stop [rad]; where None the model's numeric `backlash`, whose
        one value serves both axes, two `[x, y]` each its own

    Raises
    ------
    MechanismError : negative, or not finite; servos without a separate shaft
    """
    joints = {joint.name: joint for joint in spec.joints}
    before = "gimbal_" if "gimbal_x" in joints else ""
    widths = _numeric(spec, f"{before}backlash") if backlash is None else [backlash]
    for width in widths:
        if not (np.isfinite(width) and width >= 0):
            raise MechanismError(f"backlash {width}: must be 0 or greater [rad]")
    for index, axis in enumerate(AXES):
        width = widths[min(index, len(widths) - 1)]
        shaft = joints.get(f"{before}servo_{axis}")
        if width == 0 or f"{before}play_{axis}" in joints:
            continue
        if shaft is None:
            raise MechanismError(
                f"backlash {width:g} rad: no joint '{before}servo_{axis}' for it; a servo on the"
                " gimbal axis must have 0"
            )
        shaft.parent.add_joint(
            name=f"{before}play_{axis}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=shaft.axis,
            pos=shaft.pos,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-width / 2, width / 2],
            armature=PLAY_ARMATURE,
            damping=PLAY_DAMPING,
            solref_limit=[0.004, 1],
            solimp_limit=[0.9999, 0.9999, 0.001, 0.5, 2],
        )


def _numeric(spec: mujoco.MjSpec, name: str) -> list[float]:
    """Values of a numeric, filled up with zeros as MuJoCo does; a single zero without one."""
    for numeric in spec.numerics:
        if numeric.name == name:
            data = [float(v) for v in numeric.data]
            return [*data, *[0.0] * (numeric.size - len(data))]
    return [0.0]


def _value(
    model: mujoco.MjModel, name: str, index: int, fallback: float, positive: bool = False
) -> float:
    """Value of a numeric for one axis, or `fallback` where the model has none of that name."""
    numeric = find(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if numeric < 0:
        return float(fallback)
    start, size = int(model.numeric_adr[numeric]), int(model.numeric_size[numeric])
    value = float(model.numeric_data[start + min(index, size - 1)])
    if not np.isfinite(value) or value < 0 or (positive and value == 0):
        bound = "greater than zero" if positive else "zero (off) or greater"
        raise MechanismError(f"{name} = {value}: must be {bound}")
    return value
