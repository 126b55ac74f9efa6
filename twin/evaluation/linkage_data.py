"""Commands and motion of a recorded linkage, on the time grid of the physics."""

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.identify.pulses import PulseFrames, fitted, lateness, pulse_frames
from analysis.linkage.problem import LinkageError, Moves
from analysis.recording import Measurement
from hardware.frames import AXES
from hardware.parts import RAIL
from twin.physics.mechanism import Kinematics

Array = NDArray[np.float64]
Shaft = Callable[[Array], Array]

POTENTIOMETERS = "sensors/potentiometer"
_TWINS = ("a", "b")  # at the two ends of an axis
_SPIKE = 6.0  # deviations
# s; commands that change at every tick are one motion, and what is held out or drawn from it has to
# be long over the servo's memory
SHORTEST_MOVE = 0.25


def moves_of(r: Measurement, model: mujoco.MjModel) -> Moves:
    """The record's commands as servo angles, one a physics step, and what was read meanwhile.

    Of a rig its pulses are taken, from when they were in force, and its raw potentiometers: a
    filter's estimate of the angle has a dynamics of its own, which would go into the parameters.

    Raises
    ------
    LinkageError : a record of other than both axes' commands and angles
    """
    if r.angle is None or tuple(r.outputs) != AXES or tuple(r.inputs) != AXES:
        raise LinkageError(
            f"{r.name}: --linkage needs commands and angles of x and y; it has commands of"
            f" {', '.join(r.inputs)}" + ("" if r.angle is not None else " and no angles")
        )
    shaft = Kinematics(model).servo_from_gimbal
    if {"gimbal/measured", "sensors/pulse"} <= r.recording.series.keys():
        return _pulsed(r, shaft, model.opt.timestep)
    time = r.angle.time
    origin = min(time[0], 0.0)
    at = _grid(origin, time[-1], model.opt.timestep)
    control = shaft(r.command.held(at + 1e-9))
    begins = _begins(r.command.time[r.command.changes()] - origin)
    return Moves(np.asarray(control), time - origin, r.angle.values, begins)


def _grid(origin: float, end: float, step: float) -> Array:
    return np.asarray(origin + step * np.arange(int(np.ceil((end - origin) / step)) + 1))


def _pulsed(r: Measurement, shaft: Shaft, step: float) -> Moves:
    frames = pulse_frames(r.recording, AXES, r.name)
    time = frames.stamp(r.angles.time)
    # frames begin on the grid: the rig's servos saw their pulses then, not up to a step later
    origin = frames.begin[0] - step * np.ceil((frames.begin[0] - min(time[0], 0.0)) / step)
    at = _grid(origin, time[-1], step)
    row = np.clip(np.searchsorted(frames.begin, at + 0.01 * step, side="right") - 1, 0, None)
    control = _asked(frames, r, shaft)[row]
    new = np.flatnonzero(np.any(np.diff(frames.pulse, axis=0) != 0.0, axis=1)) + 1
    return Moves(control, time - origin, _angles(r), _begins(frames.begin[new] - origin))


def _begins(changes: Array) -> Array:
    """Changes of the command that begin a move, no two closer than a move may be."""
    kept: list[float] = []
    for at in changes.tolist():
        if not kept or at - kept[-1] >= SHORTEST_MOVE:
            kept.append(at)
    return np.array(kept)


def _asked(frames: PulseFrames, r: Measurement, shaft: Shaft) -> Array:
    """Shaft angles (m, 2) that the pulses asked for.

    A servo's travel and centre are a straight line through the commands that its pulses carried.
    """

    def wanted(times: Array) -> Array:
        return np.asarray(shaft(r.command.held(times)))

    commanded = wanted(frames.begin - lateness(frames, wanted))
    columns = [fitted(frames.pulse[:, [k]], commanded[:, [k]], 1)[:, 0] for k in range(len(AXES))]
    return np.stack(columns, axis=1)


def _angles(r: Measurement) -> Array:
    """Angles (n, 2) by the raw potentiometers, each on its own line through the estimate."""
    angles = r.angles
    if POTENTIOMETERS not in r.recording.series:
        return angles.values
    series, columns = r.recording[POTENTIOMETERS], []
    for k, axis in enumerate(AXES):
        estimate = angles.values[:, k]
        read = []
        for twin in _TWINS:
            raw = np.interp(angles.time, series.time, series.column(f"{axis}_{twin}"))
            good = np.isfinite(raw) & np.isfinite(estimate)
            if good.sum() < 3 or np.ptp(raw[good]) == 0.0 or raw[good].max() < RAIL:
                continue
            # of the reading on the angle, since it is the reading that is noisy
            slope, zero = np.polyfit(estimate[good], raw[good], 1)
            angle = (raw - zero) / slope
            off = np.abs(angle - estimate)
            spread = 1.4826 * float(np.median(off[good]))
            read.append(np.where(off < _SPIKE * spread, angle, np.nan))
        columns.append(np.mean(read, axis=0) if read else estimate)
    return np.stack(columns, axis=1)
