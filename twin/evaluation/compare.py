"""`twin compare`: errors between two motions, and both motions in one recording."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.comparison import (
    PathDifference,
    flight_path,
    holds_flight,
    path_difference,
)
from analysis.comparison import compare as side_by_side
from analysis.flown import Flown, flown
from analysis.recording import Measurement, TimeSeries, aligned
from analysis.recording.caveats import caveats
from analysis.recording.loader import is_table
from analysis.response.figure import PRACTICAL_SIZE
from twin import status
from twin.config import Compare
from twin.config.paths import named, point_latest
from twin.config.seats import SIMULATED
from twin.errors import TwinError
from twin.evaluation.compare_recording import record
from twin.evaluation.compare_result import CompareResult
from twin.evaluation.flights import (
    FlightsResult,
    compare_flights,
)
from twin.evaluation.inputs import seen

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Pair:
    """Two motions on one time axis; `other_run` is None where one recording holds both."""

    reference: TimeSeries
    other: TimeSeries
    run: Measurement
    other_run: Measurement | None = None

    @property
    def shift(self) -> float:
        return self.other_run.shift if self.other_run else 0.0


def compare(config: Compare) -> CompareResult | FlightsResult:
    """Compare two motions of a gimbal, or flights without one, and write both into one recording.

    Raises
    ------
    TwinError, AnalysisError : invalid input, in one line
    """
    began = time.perf_counter()
    runs = _runs(config)
    status.say("comparing")
    if any(run.recording.passive for run in runs):
        file = named(config.out, "compare", ".rrd", force=config.force)
        flights = compare_flights(config, runs, file)
        point_latest(file)
        return flights
    pair, cut = _before_fault(_pair(config, runs))
    command = pair.run.command
    command = command.rows(command.time <= pair.reference.time[-1])
    axes = [n for n in command.components if n in pair.reference.components]
    comparison = side_by_side(
        pair.reference,
        pair.other,
        repeats={n: _repeats_begin(pair.run, n).tolist() for n in axes},
        longest_delay=1e-3 * config.longest_delay_ms,
        still=[n for n in axes if not len(command.select((n,)).changes())],
        noise=_noise(pair),
        limit=config.fail_below,
        tolerance=PRACTICAL_SIZE["rad"] if _both_flew(runs) else 0.0,
    )
    file = named(config.out, "compare", ".rrd", force=config.force)
    drift = explanation = None
    if config.drift:
        from twin.evaluation.drift import run_drift

        drift = run_drift(pair.run.recording, config.mechanism, config.overrides)
    if config.explain:
        from twin.evaluation.explain import explain

        explanation = explain(pair.run.recording, config.mechanism, config.overrides)
    record(file, pair.reference, pair.other, pair.run, config.recordings, drift)
    point_latest(file)
    runs = [r for r in (pair.run, pair.other_run) if r is not None]
    return CompareResult(
        comparison,
        pair.shift,
        config.fail_below,
        file,
        time.perf_counter() - began,
        *_flights(runs),
        cut + caveats(runs),
        drift,
        explanation,
    )


def _noise(pair: _Pair) -> dict[str, float]:
    """Noise of a simulated rig's angles as its filter states it [rad], by axis.

    With a calibration the filter's deviation contains that of the map, which is no noise.
    """
    sigma = pair.run.recording.series.get("gimbal/sigma")
    made = pair.run.recording.properties.get("configuration")
    made = made if isinstance(made, dict) else {}
    exact = made.get("gimbal") in SIMULATED and not made.get("calibration")
    if sigma is None or pair.run.motion != "measured" or not exact:
        return {}
    return {n: float(np.nanmedian(sigma.column(n))) for n in sigma.components
            if np.isfinite(sigma.column(n)).any()}  # fmt: skip


def _flights(
    runs: Sequence[Measurement],
) -> tuple[PathDifference | None, tuple[Flown, Flown] | None]:
    """How far two flights lie apart, and their figures; None where not both flew."""
    if not _both_flew(runs):
        return None, None
    first, second = (flight_path(r.recording) for r in runs)
    a, b = (flown(r.recording) for r in runs)
    return path_difference(first, second), None if a is None or b is None else (a, b)


def _both_flew(runs: Sequence[Measurement]) -> bool:
    return len(runs) == 2 and all(holds_flight(r.recording) for r in runs)


def _runs(config: Compare) -> list[Measurement]:
    """The files to compare; none with `--with`."""
    files = config.recordings
    if config.with_ is not None:
        return []
    if not 1 <= len(files) <= 2:
        raise TwinError(
            f"compare: {len(files)} recordings; give two (or tables), or one that holds measured"
            " and simulated angles"
        )
    if len(files) == 1 and is_table(files[0]):
        raise TwinError(
            f"compare: {files[0]} is a table with one motion; give the other file too, or --with"
            " linkage"
        )
    return seen(config, files)


def _pair(config: Compare, runs: Sequence[Measurement]) -> _Pair:
    files = config.recordings
    if not runs:
        from twin.evaluation.beside import beside

        both = beside(config)
        measured = replace(both.run.angles, name=f"{both.run.name} ({both.run.motion})")
        return _Pair(measured, both.simulated, both.run)
    if len(runs) == 1:
        recording = runs[0].recording
        for kind in ("measured", "simulated"):
            if f"gimbal/{kind}" not in recording.series:
                raise TwinError(
                    f"compare: {files[0]} holds no {kind} angles; give another recording too, or a"
                    " run with a rig and without --shadow none"
                )
        measured, simulated = (
            replace(recording[f"gimbal/{kind}"].known(), name=f"{files[0]} {kind}")
            for kind in ("measured", "simulated")
        )
        return _Pair(measured, simulated, runs[0])
    for run in runs:
        if not run.axes:
            raise TwinError(f"compare: {run.name} has no axis with commands and readings")
    first, second = aligned(runs)
    reference, other = (replace(r.angles, name=f"{r.name} ({r.motion})") for r in (first, second))
    return _Pair(reference, other, first, second)


def _before_fault(pair: _Pair) -> tuple[_Pair, tuple[str, ...]]:
    """What was recorded before a fault moved the servos to neutral, and a warning if one did."""
    runs = [(pair.run, 0.0)]
    if pair.other_run is not None:
        runs.append((pair.other_run, pair.other_run.shift))
    faults = [
        (e.time + shift, run.name)
        for run, shift in runs
        if run.recording.setting("on_fault") != "ignore"
        for e in run.recording.events
        if e.level == "ERROR" and e.text.startswith("fault: ")
    ]
    if not faults:
        return pair, ()
    end, name = min(faults)
    reference = pair.reference.rows(pair.reference.time < end)
    if not len(reference.time):
        raise TwinError(f"compare: {name} has nothing before its fault at {end:.2f} s")
    last = float(pair.reference.time[-1])
    text = f"{name} was cut off by a fault: compared up to {end:.2f} s, of {last:.2f} s"
    return replace(pair, reference=reference), (text,)


def _repeats_begin(run: Measurement, axis: str) -> Array:
    """When each repeat of an axis begins [s], and when the last ends.

    An axis is commanded for as many equal times as the run's setting `repeats` says; of steps, for
    as many as it leaves zero both ways.
    """
    command = run.command.select((axis,))
    changes = command.time[command.changes()]
    count = run.recording.setting("repeats")
    if len(changes) < 2 or not isinstance(count, int) or not 1 <= count <= len(changes):
        return np.zeros(0)
    last = changes[-1]
    if run.recording.setting("signal") == "steps":
        value = np.ravel(command.values)
        count = max(1, int(np.count_nonzero((value[:-1] == 0.0) & (value[1:] != 0.0))) // 2)
        last += np.diff(changes).max()  # a step lasts as long as it is held
    return np.linspace(changes[0], last, count + 1)
