"""Tolerances of one simulated rig, written into the model of its bench."""

import mujoco
import numpy as np

from hardware.emulator import RigParameters, ServoParameters, reference_rig
from hardware.emulator.plant import PlantParameters
from hardware.frames import AXES
from twin.physics.mechanism.servo import CONSTANT, DAMPING, GAIN, RESISTANCE, SLEW, VOLTAGE


def vary(model: mujoco.MjModel, rig: RigParameters) -> None:
    """Give servos and linkage of a compiled bench the tolerances of a sampled rig.

    Figures of `hardware.emulator` are relative to its reference rig; parts that the mechanism lacks
    (a servo on the gimbal axis has neither rods nor backlash) are left out.
    """
    plain = reference_rig().plant
    for k, axis in enumerate(AXES):
        _vary_servo(model, axis, rig.plant.servos[k], plain.servos[k])
        _vary_linkage(model, k, rig.plant)


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


def _vary_linkage(model: mujoco.MjModel, k: int, plant: PlantParameters) -> None:
    """Give the linkage of an axis ratio, coupling and zero of a sampled one, by its parts.

    The ball of the horn moves outwards. The ball on the holder, at a lever r of the axis, moves
    along it by r times the coupling, so that the other axis moves it along the rod. The rod is
    shorter by r times the error of the zero: ±0.8 mm and ±0.5 mm, as of printed parts and rods of
    bent wire.
    """
    axis, other = AXES[k], 1 - k
    names = f"gimbal_holder_{axis}_ball", f"gimbal_rod_{axis}_end"
    ball, end = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name) for name in names)
    rod = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"gimbal_rod_{axis}")
    if min(ball, end, rod) < 0:
        return
    plain = reference_rig().plant.linkage
    model.body_pos[rod][0] *= plant.linkage[k][k] / plain[k][k]
    lever = float(model.site_pos[ball][other])
    model.site_pos[ball][k] += lever * plant.linkage[k][other] / plain[other][other]
    length = float(np.linalg.norm(model.site_pos[end]))
    model.site_pos[end] *= 1.0 - abs(lever) * plant.offset[k] / length
