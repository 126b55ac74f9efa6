"""What of an axis' record its figures are computed from: steps, plateaus, samples in motion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.recording.measurements import Measurement
from analysis.recording.series import TimeSeries
from analysis.response import Step, cut_steps

PLACES = 20  # stretches of the stroke of a sweep


def steps_of(axis: Measurement) -> tuple[Step, ...]:
    """The axis' record cut at every change of its own command."""
    own = axis.active()
    return cut(own.angles, own.command)


def cut(angle: TimeSeries, command: TimeSeries) -> tuple[Step, ...]:
    """An angle cut at every change of a command."""
    return cut_steps(angle.time, angle.value, command.time, command.value)


def at_rest(axis: Measurement) -> tuple[Array, Array, Array]:
    """Commands, plateau angles and approach directions (n,) of the steps."""
    steps = steps_of(axis)
    return *plateaus(steps), np.array([np.sign(s.command_after - s.command_before) for s in steps])


def in_motion(axis: Measurement) -> tuple[Array, Array, Array]:
    """Commands, angles and directions (n,) while the command moves."""
    own = axis.active()
    at = own.angles.time + 1e-9
    pace = replace(own.command, values=np.gradient(own.command.value)[:, None])
    way = np.sign(pace.held(at)[:, 0])
    moves = way != 0
    return own.command.held(at)[moves, 0], own.angles.value[moves], way[moves]


def plateaus(steps: Sequence[Step]) -> tuple[Array, Array]:
    """Commands and plateau angles (n,) of steps."""
    command = np.array([s.command_after for s in steps])
    angle = np.array([float(s.rest.mean()) for s in steps])
    return command, angle


def places(u: Array, y: Array, way: Array) -> tuple[Array, Array]:
    """Means of stretches of the stroke, each way by itself.

    Neighbouring samples of one sweep share their error; as so many measurements they would make
    intervals far too narrow.
    """
    place = np.digitize(u, np.linspace(u.min(), u.max(), PLACES + 1)[1:-1]) + PLACES * (way > 0)
    found = [place == k for k in np.unique(place)]
    return np.array([u[f].mean() for f in found]), np.array([y[f].mean() for f in found])
