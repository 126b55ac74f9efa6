"""Tolerances of one simulated rig, written into the model of its bench."""

import mujoco

from hardware.emulator import RigParameters, ServoParameters, reference_rig
from hardware.frames import AXES
from twin.physics.mechanism.servo import CONSTANT, DAMPING, GAIN, RESISTANCE, SLEW, VOLTAGE


def vary(model: mujoco.MjModel, rig: RigParameters) -> None:
    """Give servos and horns of a compiled bench the tolerances of a sampled rig.

    Figures of `hardware.emulator` are relative to its reference rig; parts that the mechanism lacks
    (a servo on the gimbal axis has neither rods nor backlash) are left out.
    """
    plain = reference_rig().plant
    for k, axis in enumerate(AXES):
        _vary_servo(model, axis, rig.plant.servos[k], plain.servos[k])
        _vary_horn(model, axis, rig.plant.linkage[k][k] / plain.linkage[k][k])


def _vary_servo(
    model: mujoco.MjModel, axis: str, servo: ServoParameters, plain: ServoParameters
) -> None:
    actuator = int(model.actuator(f"gimbal_servo_{axis}").id)
    if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_DCMOTOR:
        gain = model.actuator_gainprm[actuator]
        emf = gain[CONSTANT] ** 2 / gain[RESISTANCE]
        feedback = gain[DAMPING] - emf
        gain[RESISTANCE] *= servo.resistance / plain.resistance
        gain[CONSTANT] *= servo.torque_constant / plain.torque_constant
        gain[VOLTAGE] *= servo.voltage / plain.voltage
        # the servo's gain is volts per angle, the model's torque per angle
        own, nominal = (p.gain * p.torque_constant / p.resistance for p in (servo, plain))
        gain[GAIN] *= own / nominal
        gain[DAMPING] = feedback + gain[CONSTANT] ** 2 / gain[RESISTANCE]
        # the limit of the set point's speed follows the motor's own
        own, nominal = (p.voltage / p.torque_constant for p in (servo, plain))
        model.actuator_dynprm[actuator, SLEW] *= own / nominal
        if model.nuser_actuator:
            model.actuator_user[actuator][0] *= servo.dead_band / plain.dead_band
    shaft = int(model.jnt_dofadr[model.actuator_trnid[actuator, 0]])
    model.dof_frictionloss[shaft] *= servo.friction / plain.friction
    play = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"gimbal_play_{axis}")
    if play >= 0:
        model.jnt_range[play] *= servo.backlash / plain.backlash


def _vary_horn(model: mujoco.MjModel, axis: str, ratio: float) -> None:
    """Move the ball of a horn outwards; the trim of its servo stands for an error of its zero."""
    rod = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"gimbal_rod_{axis}")
    if rod >= 0:
        model.body_pos[rod][0] *= ratio
