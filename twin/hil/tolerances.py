"""Tolerances of one simulated rig, written into the model of its bench."""

import mujoco
import numpy as np

from hardware.emulator import RigParameters, ServoParameters, reference_rig
from hardware.frames import AXES
from twin.physics.mechanism.servo import CONSTANT, DAMPING, GAIN, RESISTANCE, SLEW, VOLTAGE

# Change of a rod's length per assembly error [m/rad]: half the arm of its ball on the holder. The
# error of the other half is in the horn's angle, which the trim of the servo takes up.
PER_ANGLE = 0.5 * 0.0205


def vary(model: mujoco.MjModel, rig: RigParameters) -> None:
    """Give servos, rods and horns of a compiled bench the tolerances of a sampled rig.

    Figures of `hardware.emulator` are relative to its reference rig; parts that the mechanism lacks
    (a servo on the gimbal axis has neither rods nor backlash) are left out.
    """
    plain = reference_rig().plant
    for k, axis in enumerate(AXES):
        _vary_servo(model, axis, rig.plant.servos[k], plain.servos[k])
        _vary_rod(
            model,
            axis,
            ratio=rig.plant.linkage[k][k] / plain.linkage[k][k],
            offset=rig.plant.offset[k] - plain.offset[k],
        )


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
        gain[GAIN] *= servo.gain / plain.gain
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


def _vary_rod(model: mujoco.MjModel, axis: str, *, ratio: float, offset: float) -> None:
    rod = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"gimbal_rod_{axis}")
    end = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"gimbal_rod_{axis}_end")
    if rod < 0 or end < 0:
        return
    model.body_pos[rod][0] *= ratio
    along = model.site_pos[end] / np.linalg.norm(model.site_pos[end])
    model.site_pos[end] += along * PER_ANGLE * offset
