"""The attitude loop of the reference vehicle, without the gimbal that closes it."""

import numpy as np

from analysis.transfer_function import Loop
from twin.config import Fly
from twin.control.attitude import ControlConfig
from twin.physics.motor import Depletion
from twin.plant.authority import control_config, lever_and_inertia
from twin.plant.model import ModelConfig, load


def attitude_loops() -> tuple[Loop, ...]:
    """Loops at ignition and burnout, in still air, with the default control rate.

    The controller divides by the authority of the loaded vehicle, thrust·lever/inertia; as the
    propellant burns the true one grows beyond it, and the loop gain with it.
    """
    model = load(ModelConfig()).mj
    config = control_config(model)
    loaded = np.divide(*lever_and_inertia(model))
    Depletion(model).update(np.inf)
    ratio = float(np.divide(*lever_and_inertia(model)) / loaded)
    return _loop("ignition", config, 1.0), _loop("burnout", config, ratio)


def _loop(name: str, c: ControlConfig, gain: float) -> Loop:
    """PID with a low-pass on the rate, on a vehicle that is a pure inertia: 1/s² per unit."""
    if c.cutoff > 0.0:  # (kp + ki/s + kd·s·ωc/(s + ωc))/s²
        num = np.polyadd(np.convolve([c.kp, c.ki], [1.0, c.cutoff]), [c.kd * c.cutoff, 0.0, 0.0])
        den = [1.0, c.cutoff, 0.0, 0.0, 0.0]
    else:
        num, den = np.array([c.kd, c.kp, c.ki]), [1.0, 0.0, 0.0, 0.0]
    return Loop(name, tuple((gain * num).tolist()), tuple(den), 1.0 / Fly().control_hz)
