"""How late a run's gimbal answered: delay of the loop over time, and percentiles of its parts."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain
from analysis.recording.series import Recording


@dataclass(frozen=True, slots=True)
class Delays:
    """How much later than without any delay the gimbal answered (n,) [s], at times (n,) [s]."""

    time: Array
    value: Array


@dataclass(frozen=True, slots=True)
class Percentiles(Plain):
    """Of `n` values [s]."""

    p50: float
    p99: float
    p999: float
    worst: float
    n: int


def percentiles(values: Array) -> Percentiles | None:
    """Of the values known (n,) [s]; None without any."""
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    p50, p99, p999 = (float(p) for p in np.percentile(known, (50.0, 99.0, 99.9)))
    return Percentiles(p50, p99, p999, float(known.max()), int(known.size))


def loop_delay(recording: Recording) -> Delays | None:
    """Delay of the loop over time: age of the newest sample plus half a round trip.

    The age is known through the clock offset, which assumes that both ways of a round trip take
    the same time. Where they do not, the age is wrong by as much as half a round trip is, the other
    way: the sum is right either way (D. L. Mills, RFC 5905, § 8). None where neither was recorded.
    """
    series = [
        s for n in ("sensor_age", "round_trip") if (s := recorded_values(recording, f"timing/{n}"))
    ]
    if not series:
        return None
    time = max((s[0] for s in series), key=len)
    total = np.zeros(len(time))
    for name in ("sensor_age", "round_trip"):
        found = recorded_values(recording, f"timing/{name}")
        if found is not None:
            weight = 1.0 if name == "sensor_age" else 0.5
            total += weight * np.interp(time, *found)
    return Delays(time, total)


def recorded_values(recording: Recording, name: str) -> tuple[Array, Array] | None:
    """Times (n,) [s] and finite values (n,) of a signal's first component; None without any."""
    series = recording.series.get(name)
    if series is None:
        return None
    values = series.values[:, 0]
    there = np.isfinite(values)
    return (series.time[there], values[there]) if there.any() else None


def recorded_percentiles(recording: Recording, name: str) -> Percentiles | None:
    """Percentiles of a signal's first component; None where it was not recorded."""
    found = recorded_values(recording, name)
    return None if found is None else percentiles(found[1])
