"""The attitude loop of a vehicle, without the gimbal that closes it."""

import copy
from dataclasses import replace

import mujoco
import numpy as np

from analysis.transfer_function import Loop, TransferFunctionModel, margins
from twin.config import Fly
from twin.control.attitude import ControlConfig
from twin.physics.motor import Depletion
from twin.plant.authority import control_config, lever_and_inertia
from twin.plant.model.model import ModelConfig, load

_USUAL = 1.5  # gains up to this factor from 1 need no look at the loop, which imports for a second


def attitude_loops(model: mujoco.MjModel | None = None) -> tuple[Loop, ...]:
    """Loops of a vehicle at ignition and burnout, in still air, with the default control rate.

    The controller divides by the authority of the loaded vehicle, thrust·lever/inertia; as the
    propellant burns the true one grows beyond it, and the loop gain with it.

    Parameters
    ----------
    model : loaded; the reference vehicle if omitted
    """
    model = load(ModelConfig()).mj if model is None else copy.copy(model)
    config = control_config(model)
    fuel = Depletion(model)
    fuel.update(-np.inf)
    loaded = np.divide(*lever_and_inertia(model))
    fuel.update(np.inf)
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


def wrong_gain(gimbal: TransferFunctionModel, model: mujoco.MjModel | None) -> str | None:
    """What is wrong with the gain of an identified model, by the attitude loop of a vehicle.

    The loop is stable from its lower to its upper gain margin with a gimbal of gain 1; a model of
    an axis outside of that is named; gains of 1/1.5 to 1.5 are not judged. Where the loop is
    unstable for the gimbal's delay or slowness alone, or is not the vehicle's (None), only a
    mirrored axis and a gain beyond a factor of 10 are.
    """
    for name in gimbal.outputs:
        if name not in gimbal.inputs or (channel := gimbal.channel(name, name)).zero:
            continue
        gain = channel.num[-1] / channel.den[-1] if channel.den[-1] else np.inf
        if 1.0 / _USUAL < gain < _USUAL:
            continue
        text = f"a command of 1° moves axis {name} by {gain:.3g}°"
        if not 0.0 < gain < np.inf:
            return text
        if model is not None:
            one = replace(channel, num=tuple(n / gain for n in channel.num))
            alone = TransferFunctionModel(((one,),), (name,), (name,))
            found = margins(attitude_loops(model), alone)
            if all(m.stable for m in found):
                low, high = max(m.lower_gain for m in found), min(m.gain for m in found)
                if low < gain < high:
                    continue
                return f"{text}; the attitude loop is stable for {low:.2g}° to {high:.2g}°"
        if not 0.1 < gain < 10.0:  # degrees for radians, whatever the loop
            return text
    return None


def unstable(gimbal: TransferFunctionModel, model: mujoco.MjModel) -> str | None:
    """Which attitude loop of a vehicle is unstable with a gimbal; None where none is."""
    found = [m for m in margins(attitude_loops(model), gimbal) if not m.stable]
    if not found:
        return None
    worst = min(found, key=lambda m: m.lower_gain)
    text = f"the attitude loop of axis {worst.axis} is unstable at {worst.loop}"
    if worst.lower_gain > 0.0:
        text += f", its gain {1.0 / worst.lower_gain:.3g} times beyond the margin"
    return text
