"""When a rig passed its commands on: the pulse frames of a recording, and what each of them asked.

A hobby servo receives 50 pulses a second. A command waits for the next frame, 0 to 20 ms, and one
that is followed by another within that time is never seen by the servo. A linear model of a mean
wait cannot foretell that. What the frames held, and when they began, is in the recording.

A frame begins when the device's clock passes a multiple of 20 ms (docs/protocol.md): servo timer
and clock are one counter. Where the stamps contradict that, as after the clock has wrapped, the
phase is taken from the readings that first show a new pulse, and is good to half a reading.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.errors import IdentificationError
from analysis.recording.measurements import Measurement
from analysis.recording.series import Recording, TimeSeries

FRAME = 0.02  # s; `hardware.protocol` PWM_PERIOD_US
PULSE, CLOCK = "sensors/pulse", "sensors/device_time"
FLAGS, PULSE_UNTIMED = "sensors/flags", 1 << 8  # `hardware.protocol` Flags
_FEWEST = 4  # frames with a new pulse
_GAP = 1.5  # readings; a pulse seen after a longer one may be older
_EQUAL = 1e-6  # s; stamps that are one instant
_TRIAL = 2.5e-4  # s; to which that way is searched
_LATEST = 0.008  # s; a command on its way to the device: wire, loop, interrupt
_POWERS = 3  # the linkage's bend; beyond, 0.002° on the shipped one
_TICK = 0.5e-6  # s; of the timer that makes the pulses
_SHARE_OF_TICK = 0.2  # finer differences of what pulses asked for are the map's, not the pulses'
_ROUNDS = 8
# s; how much earlier than its stamp a pulse may have been in force: half a reading, and what a
# simulated rig's semi-implicit step is ahead of continuous time
PULSE_SLACK = 1e-3
_FAR, _MOST_ASTRAY = 0.1, 0.1  # of the commands' range; of the frames


@dataclass(frozen=True, slots=True)
class PulseFrames:
    """Pulses in force, frame by frame.

    Attributes
    ----------
    begin : when each frame began, on the clock of `stamp` [s] (m,)
    pulse : widths in force from then on [s] (m, axes)
    offset, pace : experiment time = offset + pace · device time [s]; a straight line, since an
        estimate of the clock that is still settling would shake every stamp
    """

    begin: Array
    pulse: Array
    offset: float
    pace: float
    _host: Array
    _device: Array

    def stamp(self, time: Array) -> Array:
        """Recorded stamps of readings [s] (n,) on the straight line through the device's clock."""
        device = np.interp(time, self._host, self._device)
        return np.asarray(self.offset + self.pace * device)

    def dated(self, series: TimeSeries | None) -> TimeSeries | None:
        """Readings with the stamps of `stamp`; of equal stamps the first."""
        if series is None:
            return None
        return replace(series, time=np.maximum.accumulate(self.stamp(series.time))).known()


def by_pulses(run: Measurement) -> Measurement:
    """The run with the commands that its pulses carried, dated by when the pulses were in force.

    An identified delay is then that of servo and gimbal alone, without the wait for the rig's next
    pulse frame.

    Raises
    ------
    IdentificationError : a recording without pulses, or with pulses that do not follow the commands
    """
    frames = pulse_frames(run.recording, run.inputs, run.name)
    values, _ = asked(frames, run.command.held, run.name)
    # an axis whose pulse stays is not commanded, whatever the map makes of the other's
    step = _SHARE_OF_TICK * _TICK * values.std(axis=0) / np.maximum(frames.pulse.std(axis=0), _TICK)
    values = np.round(values / np.maximum(step, 1e-12)) * step
    return replace(
        run,
        command=replace(run.command, time=frames.begin, values=values),
        angle=frames.dated(run.angle),
        rate=frames.dated(run.rate),
        slack=PULSE_SLACK,
    )


def by_frames(runs: Sequence[Measurement]) -> list[Measurement]:
    """The runs with each command dated by the pulse frame that took it up, a mean wait earlier.

    A mean wait alone is not the wait of each command: their scatter is 6 ms, and the mean of late
    answers is a smeared one, which a model of two poles takes for another delay and damping. An
    identified delay then still counts from the commands; frequency and damping are the gimbal's.
    Runs without timed pulses, or whose pulses follow other commands, are returned unchanged.
    """
    both = [_taken(r) for r in runs]
    waits = [w for t in both if t is not None for w in t[1]]
    found = []
    for run, taken in zip(runs, both, strict=True):
        if taken is None:
            found.append(run)
            continue
        frames, own = taken
        period = FRAME * frames.pace
        # of waits spread evenly over a frame the middle is the mean, and known to what is left of
        # a frame; runs whose ways to the device differ are looked at one by one
        every = waits if np.ptp(waits) <= period else own
        wait, left = 0.5 * (min(every) + max(every)), max(period - float(np.ptp(every)), 0.0)
        values = run.command.held(frames.begin - min(own) + _EQUAL)
        found.append(
            replace(
                run,
                command=replace(run.command, time=frames.begin - wait, values=values),
                angle=frames.dated(run.angle),
                rate=frames.dated(run.rate),
                late=math.hypot(left, _TRIAL) / math.sqrt(12.0),
            )
        )
    return found


def _taken(run: Measurement) -> "tuple[PulseFrames, Array] | None":
    """Pulse frames, and how long each change of a command waited for its own [s]."""
    try:
        frames = pulse_frames(run.recording, run.inputs, run.name)
        late = asked(frames, run.command.held, run.name)[1]
    except IdentificationError:
        return None
    at = run.command.time[run.command.changes()]
    row = np.searchsorted(frames.begin, at + late - _EQUAL)
    there = (row > 0) & (row < len(frames.begin))
    # of a frame after a gap in the readings it is not known which command it was the first with
    there[there] = np.diff(frames.begin)[row[there] - 1] < 1.5 * FRAME
    waits = frames.begin[row[there]] - at[there]
    return (frames, waits) if len(waits) else None


def pulse_frames(recording: Recording, components: tuple[str, ...], name: str) -> PulseFrames:
    """Pulse frames of a recording with a rig in it.

    Raises
    ------
    IdentificationError : a recording without pulses, with too few of them, or of a rig that does
        not report when they are in force
    """
    for signal in (PULSE, CLOCK):
        if signal not in recording.series:
            raise IdentificationError(
                f"{name}: no {signal}; only a recording of a rig tells when pulses were in force"
            )
    flags = recording.series.get(FLAGS)
    if flags is not None and np.any(np.nan_to_num(flags.values).astype(int) & PULSE_UNTIMED):
        raise IdentificationError(
            f"{name}: its rig (a Raspberry Pi) does not report when pulses are in force; identify"
            " from commands"
        )
    series, clock = recording[PULSE], recording[CLOCK]
    pulse = np.stack([series.column(c) for c in components], axis=1)
    device = np.interp(series.time, clock.time, clock.values[:, 0])
    good = np.isfinite(pulse).all(axis=1) & np.isfinite(device)
    good[good] = np.diff(device[good], prepend=-np.inf) > 0.0  # a rig that booted anew is another
    time, pulse, device = series.time[good], pulse[good], device[good]
    new = np.flatnonzero(np.any(np.diff(pulse, axis=0) != 0.0, axis=1)) + 1
    if len(new) < _FEWEST:
        raise IdentificationError(
            f"{name}: {len(new)} pulse frames brought a new pulse; {_FEWEST} are needed"
        )
    phase = _phase(device, new)
    # a reading at the very beginning of a frame shows its pulse already
    number = np.floor((device - phase) / FRAME + 1e-6).astype(int)
    first = np.flatnonzero(np.diff(number, prepend=number[0] - 1) > 0)
    last = np.append(first[1:], len(number)) - 1
    pace, offset = np.polyfit(device - device[0], time, 1)
    offset -= pace * device[0]
    begin = offset + pace * (phase + FRAME * number[last])
    return PulseFrames(begin, pulse[last], float(offset), float(pace), time, device)


def _phase(device: Array, new: NDArray[np.intp]) -> float:
    """Device time, within a frame, at which frames begin [s]."""
    period = float(np.median(np.diff(device)))
    prompt = new[device[new] - device[new - 1] < _GAP * period]
    seen = device[prompt if len(prompt) else new]
    # places within a frame, counted from the middle of where they lie
    turn = np.exp(2j * np.pi * seen / FRAME).mean()
    middle = float(np.angle(turn)) / (2.0 * np.pi) * FRAME
    apart = (seen - middle + FRAME / 2.0) % FRAME - FRAME / 2.0
    low, high = middle + float(apart.max()) - period, middle + float(apart.min())
    whole = FRAME * round(0.5 * (low + high) / FRAME)
    slack = 0.1 * period
    return whole if low - slack <= whole <= high + slack else 0.5 * (low + high)


def lateness(frames: PulseFrames, wanted: Callable[[Array], Array]) -> float:
    """How long before its frame a command must come to be in it [s]: wire, loop and interrupt.

    Parameters
    ----------
    wanted : times (m,) → the commands that held then (m, k)
    """
    trials = np.arange(0.0, _LATEST, _TRIAL)
    errors = []
    for late in trials:
        commands = wanted(frames.begin - late + _EQUAL)
        errors.append(float(np.abs(commands - fitted(frames.pulse, commands)).sum()))
    best = np.array(errors) < 1.001 * min(errors) + 1e-9
    return float(trials[best].mean())


def asked(frames: PulseFrames, wanted: Callable[[Array], Array], name: str) -> tuple[Array, float]:
    """What each frame's pulses asked for, in the unit of the commands (m, k), and the lateness.

    The map from pulses to commands (calibration, bend of the linkage) is fitted as a polynomial to
    the recording itself, over the frames in which a command was in force.

    Raises
    ------
    IdentificationError : where more than a tenth of the pulses did not follow the commands
    """
    late = lateness(frames, wanted)
    commands = wanted(frames.begin - late + _EQUAL)
    found = fitted(frames.pulse, commands)
    far = np.abs(commands - found).max(axis=1) > _FAR * float(np.ptp(commands))
    if far.mean() > _MOST_ASTRAY:
        raise IdentificationError(
            f"{name}: {100 * far.mean():.0f} % of the pulses do not follow the commands;"
            " were they clamped, or the rig disarmed?"
        )
    return found, late


def fitted(pulse: Array, commands: Array, order: int = _POWERS) -> Array:
    """Polynomial of the pulses (m, axes) through most of the commands (m, k), at the pulses."""
    middle, scale = pulse.mean(axis=0), np.maximum(np.ptp(pulse, axis=0), _TICK)
    x = (pulse - middle) / scale
    powers = [p for p in np.ndindex(*(order + 1,) * x.shape[1]) if sum(p) <= order]
    design = np.stack([np.prod(x ** np.array(p), axis=1) for p in powers], axis=1)
    # what a width rounded to the timer's tick leaves open
    least = 2.0 * _TICK * float((commands.std(axis=0) / np.maximum(pulse.std(axis=0), _TICK)).max())
    weight = np.ones(len(x))
    found = commands
    for _ in range(_ROUNDS):  # least absolute errors: a frame that got another command pulls little
        rows = np.sqrt(weight)[:, None]
        found = design @ np.linalg.lstsq(rows * design, rows * commands, rcond=1e-9)[0]
        weight = 1.0 / np.maximum(np.abs(commands - found).max(axis=1), least)
    return np.asarray(found)
