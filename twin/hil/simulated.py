"""Simulated rigs over the bench scene, and the nominal calibration of a rig of this mechanism."""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from hardware.calibration import Calibration, nominal
from hardware.emulator import (
    Emulator,
    FirmwareRig,
    Injection,
    RigParameters,
    ServoParameters,
    reference_rig,
    sample_rig,
)
from hardware.emulator.servo import PULSE_CENTRE
from hardware.emulator.truth import exact_calibration
from hardware.frames import Pair
from hardware.parts import POTENTIOMETER_TRAVEL
from twin.errors import TwinError
from twin.hil.bench import BenchPlant
from twin.hil.linearisation import mechanism_map

Device = Emulator | FirmwareRig
_SWITCHES = 4


def switch_angles(model: mujoco.MjModel) -> tuple[float, float, float, float]:
    """Angles at which the scene's switches +x, −x, +y, −y close [rad].

    Raises
    ------
    TwinError : the model has no such numeric
    """
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "switch_angle") < 0:
        raise TwinError("the scene has no numeric 'switch_angle'; see mjcf/bench.xml")
    angles = [float(a) for a in model.numeric("switch_angle").data]
    if len(angles) != _SWITCHES:
        raise TwinError(f"numeric 'switch_angle' has {len(angles)} values, must have {_SWITCHES}")
    return angles[0], angles[1], angles[2], angles[3]


def parameters(
    model: mujoco.MjModel, unit: int | None = None, track: float = POTENTIOMETER_TRAVEL
) -> RigParameters:
    """Parameters of a simulated rig on this mechanism.

    Parameters
    ----------
    model : bench scene
    unit : serial number of a rig with random tolerances; None is the nominal rig
    track : travel of the potentiometers' tracks [rad]
    """
    rig, plain = reference_rig() if unit is None else sample_rig(unit), reference_rig()
    errors = zip(rig.sensors.switch_angle, plain.sensors.switch_angle, strict=True)
    held = [
        at + (built - meant)
        for at, (built, meant) in zip(switch_angles(model), errors, strict=True)
    ]
    angles = (held[0], held[1], held[2], held[3])
    a, b, c, d = (
        replace(p, scale=p.scale * (POTENTIOMETER_TRAVEL / track))
        for p in rig.sensors.potentiometers
    )
    sensors = replace(rig.sensors, switch_angle=angles, potentiometers=(a, b, c, d))
    return replace(rig, sensors=sensors)


def make_device(
    kind: str,
    plant: BenchPlant,
    rig: RigParameters,
    *,
    faults: Sequence[Injection] = (),
    seed: int = 0,
) -> Device:
    """A simulated rig over a bench or turntable scene.

    Parameters
    ----------
    kind : `emulator`, or `firmware` for the real program on a simulated Nano
    rig : its servos, sensors and clock, from `parameters`

    Raises
    ------
    hardware.simavr.nano.SimulatedNanoError : the AVR tools are missing
    """
    make = Emulator if kind == "emulator" else FirmwareRig
    return make(rig, plant=plant, injections=tuple(faults), seed=seed)


def nominal_calibration(model: mujoco.MjModel, rig: RigParameters | None = None) -> Calibration:
    """Designed values of a rig on this mechanism, for one that was never calibrated.

    Parameters
    ----------
    model : bench scene
    rig : its servos and sensors where they are given, as in a simulation; else nominal ones
    """
    mechanism = mechanism_map(model)
    servos = rig.plant.servos if rig else (ServoParameters(),) * 2
    skew = 1.0 + (rig.skew if rig else 0.0)
    travel = np.array([s.travel for s in servos[:2]]) / skew
    centre = np.array([PULSE_CENTRE + s.trim for s in servos[:2]]) * skew
    zero = centre + mechanism.offset / travel
    matrix = np.linalg.inv(mechanism.matrix) * travel
    base = exact_calibration(rig) if rig else nominal()
    # trim and travel of a sampled unit are given here, its horns and rods are not
    exact = rig is None or rig.plant == reference_rig().plant
    return replace(
        base,
        rig=0,
        covariance=base.covariance if exact else nominal().covariance,
        zero=_pair(zero),
        matrix=(_pair(matrix[0]), _pair(matrix[1])),
        switch_angle=switch_angles(model),
        linearisation=mechanism.linearisation,
    )


def _pair(values: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> Pair:
    return float(values[0]), float(values[1])
