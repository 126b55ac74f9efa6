"""Records out of the twin's own recordings."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.identify.errors import IdentificationError
from analysis.identify.pulses import asked, pulse_frames
from analysis.recording.record import Initial, Record, merge_stamps, record

if TYPE_CHECKING:  # reading recordings brings Rerun with it
    from analysis.recording.reader import Recording, TimeSeries

Array = NDArray[np.float64]
# s; how much earlier than its stamp a pulse may have been in force: half a reading, and what a
# simulated rig's semi-implicit step is ahead of continuous time
PULSE_SLACK = 1e-3


def from_recording(
    recording: "Recording",
    *,
    command: str = "gimbal/command",
    angle: str | None = "gimbal/measured",
    rate: str | None = "sensors/gyro",
    components: tuple[str, ...] = ("x", "y"),
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
    pulses: bool = False,
    name: str = "recording",
) -> Record:
    """Record of the gimbal's axes from signals of a recording.

    Parameters
    ----------
    command, angle, rate : names of signals; angle or rate may be None
    components : of each, the axes
    gyro_delay : delay of the gyro's own filter [s]
    pulses : take as commands what the pulses of a rig asked for, when they did: an identified delay
        is then that of servo and gimbal alone, without the wait for the rig's next pulse frame

    Raises
    ------
    AnalysisError
        for signals and components that were not recorded, and what no record may hold.
    """
    commands = _columns(recording[command], components)
    found = [None if s is None else _columns(recording[s], components) for s in (angle, rate)]
    angles, rates = found
    if angles is not None and rates is not None:
        time, a, r = merge_stamps(*angles, *rates)
    elif angles is not None:
        time, a, r = angles[0], angles[1], None
    elif rates is not None:
        time, a, r = rates[0], None, rates[1]
    else:
        raise IdentificationError(f"{name}: neither angle nor rate; give at least one")
    # what a run says first held before it said so
    late = len(commands[0]) > 0 and len(time) > 0 and commands[0][0] > time[0]
    found_record = record(
        time, commands[1], angle=a, rate=r, command_time=commands[0],
        before=commands[1][0] if late else None,
        gyro_delay=gyro_delay,
        initial=initial, name=name, inputs=components, outputs=components,
    )  # fmt: skip
    return _by_pulses(found_record, recording, components) if pulses else found_record


def _by_pulses(r: Record, recording: "Recording", components: tuple[str, ...]) -> Record:
    """The record with its commands as the rig passed them on."""
    frames = pulse_frames(recording, components, r.name)
    values, _ = asked(frames, r.held_input, r.name)
    time = frames.stamp(r.time)
    new = np.diff(time, prepend=-np.inf) > 0.0
    return replace(
        r,
        time=time[new],
        input_time=frames.begin,
        input=values,
        angle=None if r.angle is None else r.angle[new],
        rate=None if r.rate is None else r.rate[new],
        slack=PULSE_SLACK,
    )


def _columns(series: "TimeSeries", components: tuple[str, ...]) -> tuple[Array, Array]:
    """Stamps and values of the rows that hold something; of equal stamps the first."""
    values = np.stack([series.column(c) for c in components], axis=1)
    held = np.isfinite(values).any(axis=1)
    time, values = series.time[held], values[held]
    new = np.concatenate([[True], np.diff(time) > 0.0])[: len(time)]
    return time[new], values[new]
