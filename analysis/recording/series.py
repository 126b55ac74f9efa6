"""Values over time, validated once: the type of every signal, and the content of one recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis import schema
from analysis.array import Array
from analysis.schema import AnalysisError

if TYPE_CHECKING:
    import pandas


GIMBAL, POSITION = ("gimbal/measured", "gimbal/simulated"), "vehicle/position"


class RecordingError(AnalysisError):
    """A recording, table or measurement that is not valid, described in one line."""


@dataclass(frozen=True, slots=True)
class TimeSeries:
    """One vector signal over time, in SI; checked on creation, read-only afterwards.

    Attributes
    ----------
    name : name of the signal, as in `analysis.schema.SIGNALS` where it is one of them
    time : experiment time (n,) [s], never decreasing
    values : (n, k) [unit]; NaN where nothing was measured, never infinite
    unit : SI unit of the values
    components : names of the k columns

    Raises
    ------
    RecordingError : shapes do not fit, time runs backwards or is not finite, or a value is infinite
    """

    name: str
    time: Array
    values: Array
    unit: str
    components: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check once, so that nothing downstream checks again."""
        time = np.ascontiguousarray(self.time, dtype=np.float64)
        values = np.ascontiguousarray(self.values, dtype=np.float64)
        if time.ndim != 1 or values.shape != (len(time), len(self.components)):
            raise RecordingError(
                f"{self.name}: {values.shape} values do not fit {time.shape} stamps and "
                f"{len(self.components)} components"
            )
        if not np.isfinite(time).all():
            raise RecordingError(f"{self.name}: a time stamp is not a finite number")
        if len(time) and (back := np.diff(time) < 0.0).any():
            at = int(np.argmax(back))
            raise RecordingError(
                f"{self.name}: time runs backwards from {time[at]:.9g} s to {time[at + 1]:.9g} s"
            )
        if np.isinf(values).any():
            raise RecordingError(f"{self.name}: a value is infinite")
        for name, array in (("time", time), ("values", values)):
            view = array.view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Experiment time (n,) in whole nanoseconds, exact up to 13 days (2⁵⁰ ns)."""
        return np.rint(self.time * 1e9).astype(np.int64)

    @property
    def value(self) -> Array:
        """First component (n,); the only one of a series of one axis."""
        return self.values[:, 0]

    def column(self, component: str) -> Array:
        """Return one component (n,) by name.

        Raises
        ------
        RecordingError : there is no such component; the message lists the valid names
        """
        if component not in self.components:
            raise RecordingError(schema.unknown("component", component, self.components))
        return self.values[:, self.components.index(component)]

    def select(self, components: Sequence[str]) -> "TimeSeries":
        """Series of some components, in the given order; `RecordingError` as for `column`."""
        values = np.stack([self.column(c) for c in components], axis=1)
        return replace(self, values=values, components=tuple(components))

    def rows(self, chosen: NDArray[np.bool_]) -> "TimeSeries":
        """Series of the chosen rows (n,)."""
        return replace(self, time=self.time[chosen], values=self.values[chosen])

    def known(self) -> "TimeSeries":
        """Series of the rows that hold a finite value; of equal stamps the first."""
        there: NDArray[np.bool_] = np.asarray(np.isfinite(self.values).any(axis=1))
        there[there] = np.diff(self.time[there], prepend=-np.inf) > 0.0
        return self if there.all() else self.rows(there)

    def shifted(self, by: float) -> "TimeSeries":
        """Series with `by` [s] added to its stamps."""
        return replace(self, time=self.time + by)

    def held(self, times: Array) -> Array:
        """Values (..., k) in force at the given times; before the first stamp, the first."""
        row = np.searchsorted(self.time, times, side="right") - 1
        return self.values[np.clip(row, 0, None)]

    def changes(self, column: int | None = None) -> NDArray[np.intp]:
        """Rows at which any component (or one of them) differs from the row before."""
        moved = np.diff(self.values, axis=0) != 0.0
        return np.flatnonzero(moved.any(axis=1) if column is None else moved[:, column]) + 1


def checked(signal: schema.Signal, time: Array, values: Array) -> TimeSeries:
    """Series of a signal from stamps (n,) [s] and values (n, k) in SI of a file.

    Raises
    ------
    RecordingError : for what no series may hold, and for gaps in a signal that is in every row
    """
    if signal.kind != "sampled" and not (sound := np.isfinite(values).all(axis=1)).all():
        at = float(time[int(np.argmin(sound))])
        raise RecordingError(f"{signal.name} is not a finite number at {at:.9g} s")
    return TimeSeries(signal.name, time, values, signal.unit, signal.components)


@dataclass(frozen=True, slots=True)
class Event:
    """A line of text in a recording: experiment time [s], level (INFO, WARN, ERROR), text."""

    time: float
    level: str
    text: str


@dataclass(frozen=True, slots=True)
class Recording:
    """Content of one recording.

    Attributes
    ----------
    properties : configuration, versions, model hash and seed of the run
    series : signals by name, in SI
    events, health : text over time
    estimator : state of the rig's estimator when the run began, JSON; "" without a rig
    timing : the verdict on a run in real time, see `analysis.timing`; empty for others
    flight : figures of a flight that came to its end, as `twin fly --json` names them; else empty
    """

    properties: dict[str, object]
    series: Mapping[str, TimeSeries]
    events: tuple[Event, ...] = ()
    health: tuple[Event, ...] = ()
    estimator: str = ""
    timing: Mapping[str, object] = field(default_factory=dict)
    flight: Mapping[str, object] = field(default_factory=dict)

    @property
    def passive(self) -> bool:
        """Whether a vehicle without a gimbal flew: whatever was commanded, no angle left zero."""
        angles = [self.series[n].values for n in GIMBAL if n in self.series]
        flown = self.properties.get("command", "fly") == "fly" and POSITION in self.series
        return flown and bool(angles) and not any(np.any(values != 0.0) for values in angles)

    def setting(self, name: str) -> object:
        """Return a value of the run's configuration, None without it."""
        configuration = self.properties.get("configuration")
        return configuration.get(name) if isinstance(configuration, Mapping) else None

    def __getitem__(self, name: str) -> TimeSeries:
        """Return the signal of that name.

        Raises
        ------
        RecordingError : it was not recorded; the message lists what was
        """
        if name not in self.series:
            raise RecordingError(schema.unknown("recorded signal", name, self.series))
        return self.series[name]

    def frame(self, signals: str | Sequence[str] | None = None) -> "pandas.DataFrame":
        """Return signals as a pandas DataFrame, with a row for every time stamp of any of them.

        The index is `time` [s], the columns are SIGNAL.COMPONENT in SI; NaN where a signal has no
        value at a stamp, the last value where it has several.

        Parameters
        ----------
        signals : one name, or several; all recorded ones if omitted

        Raises
        ------
        RecordingError : a signal was not recorded
        ImportError : without pandas (extra `notebook`)
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("frame() needs pandas; run pip install '.[notebook]'") from None
        names = self.series if signals is None else signals
        series = [self[name] for name in ((names,) if isinstance(names, str) else names)]
        stamps = np.unique(np.concatenate([np.empty(0, np.int64), *(s.time_ns for s in series)]))
        columns: dict[str, Array] = {}
        for s in series:
            rows = np.searchsorted(stamps, s.time_ns)
            for k, component in enumerate(s.components):
                column = columns[f"{s.name}.{component}"] = np.full(len(stamps), np.nan)
                column[rows] = s.values[:, k]
        return pandas.DataFrame(columns, index=pandas.Index(stamps / 1e9, name="time"))
