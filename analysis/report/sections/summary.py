"""The answer in a sentence, and a row of verdicts."""

import math
from collections.abc import Iterator, Sequence

from analysis.comparison.compare import Comparison
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Grade, Section, Verdicts
from analysis.report.sections.flown import Flown, flown
from analysis.report.sections.key_figures import largest_figures
from analysis.report.words import number, value_text

GOOD_FIT, FAIR_FIT = 95.0, 85.0  # %; a difference of 5 and 15 % of the motion's own deviation
SHORTEST_DELAY = 0.5e-3  # s; a shorter one is not mentioned
MATCH: dict[Grade, str] = {
    "good": "{} matches {} closely",
    "fair": "{} matches {} with visible differences",
    "poor": "{} does not match {}",
}


def summary(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section:
    """What the runs say together: comparison, figures of the first one, or a flight."""
    flights = [f for f in map(flown, runs) if f is not None]
    found = [c for c in numbers.comparisons if c.reference == runs[0].name]
    texts = [_flight(f) for f in flights] or list(_response(runs, numbers))
    texts += [_compared(c) for c in found if math.isfinite(c.fit)]
    items = (*_fits(found), *_timing(runs), *_faults(runs), *_notes(numbers))
    limits = f"Fit of the worst commanded axis: good from {GOOD_FIT:g} %, fair from {FAIR_FIT:g} %."
    caption = limits if found else ""
    parts = (Verdicts(items, caption),) if items else ()
    return Section("summary", "Summary", tuple(texts), parts)


def _compared(c: Comparison) -> str:
    axis = min((a for a in c.axes if a.axis not in c.uncounted), key=lambda a: a.as_is.fit)
    late = ""
    if math.isfinite(axis.delay) and abs(axis.delay) >= SHORTEST_DELAY:
        way = "later" if axis.delay > 0.0 else "earlier"
        late = f" and moves {number(abs(axis.delay) * 1e3, 2)} ms {way}"
    match = MATCH[_grade(c.fit)].format(c.other, c.reference)
    rms, worst = (number(math.degrees(v), 2) for v in (axis.as_is.rmse, axis.as_is.worst))
    return (
        f"{match}: fit {number(c.fit, 3)} % on axis {axis.axis}; it differs by {rms}° rms, "
        f"by {worst}° at most{late}."
    )


def _response(runs: Sequence[Measurement], numbers: ReportNumbers) -> Iterator[str]:
    """One sentence on how the first run answers its commands, of the first axis with figures."""
    first = numbers.runs[0]
    for axis in (a.component for a in runs[0].axes):
        by = largest_figures(first, axis)
        said = [
            f"{name} {value_text(by[name])}"
            for name in ("gain", "rise time", "dead time", "overshoot", "bandwidth", "hysteresis")
            if name in by
        ]
        if said:
            yield f"{first.label}, axis {axis}: {', '.join(said)}."
            return


def _flight(f: Flown) -> str:
    error = f"; attitude error under power {number(f.error_deg, 2)}° rms" if f.error_deg > 0 else ""
    top = f"apogee {number(f.apogee, 3)} m after {number(f.apogee_time, 3)} s"
    if math.isnan(f.apogee):
        top = f"up to {number(f.highest, 3)} m, where it ended in its climb"
    return (
        f"Flight with {f.name}: {top}, "
        f"up to {number(f.speed, 3)} m/s, {number(f.downrange, 3)} m downrange at the end{error}."
    )


def _grade(fit: float) -> Grade:
    return "good" if fit >= GOOD_FIT else "fair" if fit >= FAIR_FIT else "poor"


def _fits(found: Sequence[Comparison]) -> Iterator[tuple[str, Grade]]:
    for c in found:
        if math.isfinite(c.fit):
            yield f"{c.other}: fit {number(c.fit, 3)} %", _grade(c.fit)


def _timing(runs: Sequence[Measurement]) -> Iterator[tuple[str, Grade]]:
    for run in runs:
        verdict = run.recording.timing.get("verdict")
        if verdict in ("valid", "invalid"):
            yield f"{run.name}: timing {verdict}", "good" if verdict == "valid" else "poor"


def _faults(runs: Sequence[Measurement]) -> Iterator[tuple[str, Grade]]:
    for run in runs:
        wrong = sum(e.level == "ERROR" for e in (*run.recording.events, *run.recording.health))
        if wrong:
            yield f"{run.name}: {wrong} error{'s' if wrong > 1 else ''}, see Events", "poor"


def _notes(numbers: ReportNumbers) -> Iterator[tuple[str, Grade]]:
    if numbers.notes:
        count = f"{len(numbers.notes)} figure{'s' if len(numbers.notes) > 1 else ''}"
        yield f"{count} not determined or uncertain", "fair"
