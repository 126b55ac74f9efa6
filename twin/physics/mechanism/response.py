"""What a mechanism does on command: each servo must turn its gimbal axis by about what is asked."""

from copy import copy
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.physics.mechanism.kinematics import Kinematics
from twin.physics.mechanism.mobility import mobility
from twin.physics.mechanism.names import MechanismError, find, prefix
from twin.physics.mechanism.servo import apply_servo

Array = NDArray[np.float64]
ASKED: Final = np.radians(4.0)  # gimbal angle of the trial; half of what the attitude loop commands
SIZE: Final = (0.75, 1.33)  # answer over command; dead band and friction take a tenth
ASIDE: Final = 0.35  # of the asked angle on the other axis; pushrods couple by 0.11
LONGEST: Final = 3.0  # s; 0.2 s are usual
LOOK: Final = 0.05  # s between two looks
SETTLED: Final = np.radians(0.02)  # motion between two looks
STEP: Final = 1e-3  # s, at most
LATE: Final = 1e6  # s; no motor burns any more
CLOSED: Final = 5e-4  # m; largest gap of a loop where the file has no `closure_limit`


def closure_limit(model: mujoco.MjModel) -> float:
    """Largest gap of a rod's loop that counts as closed [m], the numeric `closure_limit`.

    Raises
    ------
    MechanismError : it is not positive
    """
    name = f"{prefix(model)}closure_limit"
    numeric = find(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if numeric < 0:
        return CLOSED
    limit = float(model.numeric_data[model.numeric_adr[numeric]])
    if not limit > 0:
        raise MechanismError(f"{name} = {limit:g} m: must be positive")
    return limit


def check_response(model: mujoco.MjModel) -> None:
    """Refuse a mechanism whose servos do not turn their axes as commanded.

    Each axis is commanded by itself, without gravity, air and thrust, until it rests. `model` has
    the values of its file and stays unchanged.

    Raises
    ------
    MechanismError : a loop is not active, an axis turns the other way, too far, not far enough or
        without end, or the rods do not hold together; says what it does and what it must do
    """
    _check_loops(model)
    trial = copy(model)
    apply_servo(trial)
    trial.opt.gravity[:] = 0.0
    trial.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONTACT
    )  # parts that rub are another matter
    trial.opt.timestep = min(trial.opt.timestep, STEP)
    trial.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    air = find(trial, mujoco.mjtObj.mjOBJ_NUMERIC, "air_enabled")
    if air >= 0:
        trial.numeric_data[trial.numeric_adr[air]] = 0.0
    kinematics = Kinematics(trial)
    for axis in range(len(AXES)):
        _check_axis(trial, kinematics, axis)


def _check_loops(model: mujoco.MjModel) -> None:
    before = prefix(model)
    for k in range(model.neq):
        name = model.equality(k).name
        if name.startswith(f"{before}loop_") and not model.eq_active0[k]:
            raise MechanismError(
                f'connect {name!r} is not active, so a rod holds nothing; remove active="false"'
            )
    count = mobility(model)
    if count.count != len(AXES):
        raise MechanismError(
            f"the mechanism has a mobility of {count.text}; must have 2: each rod needs a ball"
            " joint at one end and a connect at the other (docs/mechanism.md)"
        )


def _check_axis(model: mujoco.MjModel, kinematics: Kinematics, axis: int) -> None:
    angles, gap = _answer(model, kinematics, axis)
    before, name = prefix(model), AXES[axis]
    servo = f"{before}servo_{name}"
    asked, answer, aside = ASKED, angles[-1, axis], angles[-1, 1 - axis]
    did = (
        f"actuator {servo!r}: a command of {np.degrees(asked):+.1f}° about {name} turns the gimbal"
        f" to {np.degrees(answer):+.1f}° about {name} and {np.degrees(aside):+.1f}° about"
        f" {AXES[1 - axis]}"
    )
    if gap > closure_limit(model):
        raise MechanismError(
            f"{did} while its rods are up to {gap * 1e3:.2g} mm apart; loops must close within"
            f" {closure_limit(model) * 1e3:g} mm: give the connects a short time constant, for"
            ' example solref="0.004 1" solimp="0.9999 0.9999 0.001"'
        )
    kind = _kind(model, servo)
    if np.ptp(angles[-3:, axis]) > SETTLED:
        raise MechanismError(f"{did} after {LONGEST:g} s and does not rest there{kind}")
    if not SIZE[0] * asked < answer < SIZE[1] * asked or abs(aside) > ASIDE * asked:
        raise MechanismError(
            f"{did}{kind}; `ctrl` must be the angle of the shaft, positive for a positive gimbal"
            " angle (docs/mechanism.md)"
        )


def _answer(model: mujoco.MjModel, kinematics: Kinematics, axis: int) -> tuple[Array, float]:
    """Gimbal angles (n, 2) [rad] at every look, and the largest gap of a loop [m]."""
    before = prefix(model)
    data = mujoco.MjData(model)
    data.time = LATE
    asked = np.zeros(2)
    asked[axis] = ASKED
    data.ctrl[[model.actuator(f"{before}servo_{a}").id for a in AXES]] = (
        kinematics.servo_from_gimbal(asked)
    )
    joints = [int(model.joint(f"{before}{a}").qposadr[0]) for a in AXES]
    angles, gap = [data.qpos[joints].copy()], 0.0
    for _ in range(round(LONGEST / LOOK)):
        mujoco.mj_step(model, data, max(1, round(LOOK / model.opt.timestep)))
        mujoco.mj_kinematics(model, data)
        angles.append(data.qpos[joints].copy())
        gap = max(gap, float(kinematics.closure(data).max()))
        if not np.isfinite(angles[-1]).all():
            raise MechanismError(
                f"the mechanism does not stay finite when {before}servo_{AXES[axis]} turns by"
                f" {np.degrees(ASKED):.0f}°; its masses or stiffnesses cannot be simulated"
            )
        moved = abs(angles[-1][axis]) > SETTLED
        if moved and len(angles) > 3 and np.ptp(angles[-3:], axis=0).max() < SETTLED:
            break
    return np.array(angles), gap


def _kind(model: mujoco.MjModel, servo: str) -> str:
    """What an actuator that is not a position servo does instead, for a message."""
    actuator = model.actuator(servo)
    gain, bias = (int(getattr(actuator, f"{what}type")[0]) for what in ("gain", "bias"))
    if gain == mujoco.mjtGain.mjGAIN_FIXED and bias == mujoco.mjtBias.mjBIAS_NONE:
        return ": it applies a torque"
    if bias == mujoco.mjtBias.mjBIAS_AFFINE and not actuator.biasprm[1]:
        return ": it controls a speed"
    ratio = float(actuator.gear[0])
    return "" if ratio == 1.0 else f": its gear is {ratio:g}"
