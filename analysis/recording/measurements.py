"""One run of a gimbal: its commands, and the angles and rates that were read meanwhile."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.recording.series import Recording, RecordingError, TimeSeries
from analysis.recording.stamps import restarts

Initial = Literal["rest", "free"]
InputStamps = Literal["exact", "shown", "sampled"]

COMMAND, MEASURED, SIMULATED = "gimbal/command", "gimbal/measured", "gimbal/simulated"
FOLLOWED, RATE = "gimbal/followed", "gimbal/rate/measured"
FEWEST_READINGS, FEWEST_COMMANDS = 16, 2  # of an axis that figures are made of
_MAX_SAMPLES = 20_000_000
_LARGEST = 1e9  # no gimbal reads more, in any unit: a larger number is a broken file
_LATEST = 1e12  # s; 30 000 years, and neighbouring stamps are 0.1 ms apart
LONGEST_REST = 1.0  # s; kept before the first and after the last change of a command


@dataclass(frozen=True)
class Measurement:
    """Commands of a gimbal and what was read of it, each with its own stamps.

    Attributes
    ----------
    command : value in force from each stamp on [rad] (k, p), finite
    angle : angles [rad] (n, q), NaN where there is no reading, or None
    rate : rates [rad/s] (m, q), NaN where there is no reading, or None
    initial : `rest` if the gimbal stood still when the run starts, `free` if it may have moved
    slack : how long before its stamp a command may have been given [s]; one sampling period where
        the command was only sampled
    stamps : what commands are dated by: when they were given (`exact`), the sample that first
        shows them (`shown`), or half-way between that and the sample before (`sampled`)
    late : how far all commands may be off together where they wait for pulse frames [s], rms
    units : whether the units of readings and commands were both given, or one was assumed
    name : used in messages and reports
    recording : the recording it was taken from; empty for a table
    note : what of its file was left out or is in doubt, in one line; "" where nothing is
    unit_doubt : doubt of the unit of its commands, which the note has too; "" without
    shift : added to the recording's stamps to align it with another [s]

    Raises
    ------
    RecordingError : stamps that do not increase, different axes of angle and rate, and neither of
        them
    """

    command: TimeSeries
    angle: TimeSeries | None = None
    rate: TimeSeries | None = None
    initial: Initial = "rest"
    slack: float = 0.0
    stamps: InputStamps = "exact"
    late: float = 0.0
    units: Literal["given", "assumed"] = "assumed"
    name: str = "record"
    recording: Recording = field(default_factory=lambda: Recording({}, {}), repr=False)
    note: str = ""
    unit_doubt: str = ""
    shift: float = 0.0

    def __post_init__(self) -> None:
        """Check once, so that nothing downstream checks again."""
        if self.angle is None and self.rate is None:
            raise RecordingError(f"{self.name}: neither angle nor rate; give at least one")
        check_stamps(self.command.time, "command time", self.name, 1)
        if not np.isfinite(self.command.values).all():
            raise RecordingError(f"{self.name}: the command holds values that are not finite")
        readings = (("angle", self.angle), ("rate", self.rate))
        for what, series in (("command", self.command), *readings):
            if series is not None:
                check_stamps(series.time, "time", self.name, 0)
                if np.nanmax(np.abs(series.values), initial=0.0) > _LARGEST:
                    raise RecordingError(
                        f"{self.name}: {what} holds values beyond {_LARGEST:g};"
                        " leave a field empty where there is no reading"
                    )
        if self.angle is not None and self.rate is not None:
            a, b = self.angle.components, self.rate.components
            if a != b:
                raise RecordingError(
                    f"{self.name}: {len(a)} angles ({', '.join(a)}) but {len(b)} rates"
                    f" ({', '.join(b)}); give one of each per axis"
                )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the p commands."""
        return self.command.components

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the q axes that were read."""
        return self.sensors[0][1].components

    @property
    def sensors(self) -> tuple[tuple[str, TimeSeries], ...]:
        """`angle` and `rate` with their readings, those that there are."""
        both = (("angle", self.angle), ("rate", self.rate))
        return tuple((what, series) for what, series in both if series is not None)

    @property
    def angles(self) -> TimeSeries:
        """Angle readings; `RecordingError` where only rates were read."""
        if self.angle is None:
            raise RecordingError(f"{self.name}: no angles were read")
        return self.angle

    @property
    def component(self) -> str:
        """Name of the commanded axis; the only one of a measurement of one axis."""
        return self.inputs[0]

    @cached_property
    def time(self) -> Array:
        """Stamps of the readings of either sensor [s] (n,), increasing."""
        stamps = [series.time for _, series in self.sensors]
        time = stamps[0] if len(stamps) == 1 else np.union1d(*stamps)
        time.setflags(write=False)
        return time

    @property
    def duration(self) -> float:
        """Time from first to last reading [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def period(self) -> float:
        """Median spacing of the readings [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def doubt(self) -> float:
        """How far the stamps of all commands may be off together [s], root mean square.

        That of a uniform distribution: over the slack before a stamp, or as much on either side.
        """
        return 0.0 if self.stamps == "exact" else self.slack / math.sqrt(3.0)

    @property
    def motion(self) -> Literal["measured", "simulated"]:
        """Whether the angles were measured or simulated."""
        simulated = self.angle is not None and self.angle.name == SIMULATED
        return "simulated" if simulated else "measured"

    @property
    def in_flight(self) -> bool:
        """Whether a controller that saw the gimbal's answers gave the commands."""
        return self.recording.properties.get("command") == "fly"

    def select(self, inputs: Sequence[str], outputs: Sequence[str]) -> "Measurement":
        """Some commands and some axes of the run."""
        return replace(
            self,
            command=self.command.select(inputs),
            angle=None if self.angle is None else self.angle.select(outputs),
            rate=None if self.rate is None else self.rate.select(outputs),
        )

    def between(self, low: float, high: float) -> "Measurement":
        """Readings of a stretch of time [s]; all commands are kept."""
        angle, rate = (
            None if s is None else s.rows((s.time >= low) & (s.time <= high))
            for s in (self.angle, self.rate)
        )
        return replace(self, angle=angle, rate=rate)

    def shifted(self, by: float) -> "Measurement":
        """The run with `by` [s] added to all stamps."""
        if abs(by) < 1e-6:
            return self
        return replace(
            self,
            command=self.command.shifted(by),
            angle=None if self.angle is None else self.angle.shifted(by),
            rate=None if self.rate is None else self.rate.shifted(by),
            shift=self.shift + by,
        )

    def resampled(self) -> "Measurement":
        """The run with its commands at every reading too, as recordings of the twin have them."""
        at, time = self.command.time, self.time
        stamps = np.union1d(time, at[(at > time[0]) & (at < time[-1])])
        command = replace(self.command, time=stamps, values=self.command.held(stamps))
        return replace(self, command=command)

    @cached_property
    def axes(self) -> tuple["Measurement", ...]:
        """Command and angle of each axis that has enough of both; none of a passive flight."""
        found = []
        none = self.angle is None or self.recording.passive
        for name in () if none else self.inputs:
            if name not in self.outputs:
                continue
            one = self.select((name,), (name,))
            angle = one.angles.known()
            if len(one.command.time) >= FEWEST_COMMANDS and len(angle.time) >= FEWEST_READINGS:
                found.append(replace(one, angle=angle, rate=None))
        return tuple(found)

    def axis(self, name: str) -> "Measurement | None":
        """Return the axis of that name, if there is enough of it."""
        return next((a for a in self.axes if a.inputs[0] == name), None)

    def active(self) -> "Measurement":
        """The part of one axis in which it is commanded, with a rest of at most 1 s at each end.

        Both axes are usually excited in turn; motion under the other axis' command is left out.
        """
        u = self.command
        rows = u.changes()
        if len(rows) == 0:
            return self
        rest = min(float(np.diff(u.time[rows]).max(initial=0.2)), LONGEST_REST)
        rest = rest if len(rows) > 1 else LONGEST_REST
        low, high = u.time[rows[0]] - rest, u.time[rows[-1]] + rest
        # the command in force at the beginning may have been given long before
        first = max(int(np.searchsorted(u.time, low, side="right")) - 1, 0)
        near = (u.time >= u.time[first]) & (u.time <= high)
        return replace(self.between(low, high), command=u.rows(near))


def aligned(runs: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Shift every run so that its first change of the command falls on that of the first run.

    Never by its answer. Flights are not shifted: their stamps count from the launch, and their
    commands depend on the answers.
    """
    begins = [_begin(run) for run in runs]
    first = begins[0]
    return tuple(
        run if first is None or begin is None else run.shifted(first - begin)
        for run, begin in zip(runs, begins, strict=True)
    )


def check_stamps(values: ArrayLike, what: str, name: str, fewest: int) -> Array:
    """Stamps (n,) [s] that are finite and increase.

    Raises
    ------
    RecordingError : with the first sample that is wrong
    """
    time = np.asarray(values, dtype=np.float64)
    if time.ndim != 1 or len(time) < fewest:
        raise RecordingError(f"{name}: {what} must be a column of at least {fewest} stamps")
    if len(time) > _MAX_SAMPLES:
        raise RecordingError(f"{name}: {len(time)} stamps; {_MAX_SAMPLES} at most")
    if not np.isfinite(time).all():
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise RecordingError(f"{name}: {what} of sample {row} is {time[row]}, not a number")
    if np.abs(time).max(initial=0.0) > _LATEST:
        row = int(np.argmax(np.abs(time) > _LATEST))
        raise RecordingError(f"{name}: {what} of sample {row} is {time[row]:g} s, no time")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if len(backwards):
        row = int(backwards[0])
        raise RecordingError(
            f"{name}: {what} runs from {time[row]:g} s to {time[row + 1]:g} s at sample {row + 1}; "
            f"stamps must increase ({len(backwards)} do not){restarts(time)}"
        )
    return time


def _begin(run: Measurement) -> float | None:
    if run.in_flight:
        return None
    rows = [(a.command.time, a.command.changes()) for a in run.axes]
    return min((float(t[r[0]]) for t, r in rows if len(r)), default=None)
