"""The answer in a sentence, and a row of verdicts."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

from analysis.comparison.compare import Comparison
from analysis.comparison.grade import FAIR_FIT, GOOD_FIT, Grade
from analysis.comparison.grade import grade as grade_of
from analysis.flown import Flown
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Section, Verdicts
from analysis.report.sections.key_figures import largest_figures
from analysis.report.words import number, value_text

SAME_FIT = 0.5  # %; a fit without offset that is higher by less is not mentioned
SHORTEST_DELAY = 0.5e-3  # s; a shorter one is not mentioned
MATCH: dict[Grade, str] = {
    "good": "{} matches {} closely",
    "fair": "{} matches {} with visible differences",
    "poor": "{} does not match {}",
}


def summary(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section:
    """What the runs say together: comparison, figures of the first one, or a flight."""
    found = [c for c in numbers.comparisons if c.reference == runs[0].name]
    texts = [_flight(n.label, n.flight) for n in numbers.runs if n.flight is not None]
    texts = texts or list(_response(runs, numbers))
    texts += [_compared(c) for c in found if math.isfinite(c.fit)]
    items = (*_fits(found), *_timing(runs), *_faults(runs), *_missing(numbers))
    limits = (
        f"Fit of the worst commanded axis: good from {GOOD_FIT:g} %, fair from {FAIR_FIT:g} %;"
        " fair too where only a constant offset keeps it below."
    )
    caption = limits if found else ""
    parts = (Verdicts(items, caption),) if items else ()
    return Section("summary", "Summary", tuple(texts), parts)


def _compared(c: Comparison) -> str:
    axis = min((a for a in c.axes if a.axis not in c.uncounted), key=lambda a: a.as_is.fit)
    late = ""
    if math.isfinite(axis.delay) and abs(axis.delay) >= SHORTEST_DELAY:
        way = "later" if axis.delay > 0.0 else "earlier"
        late = f" and moves {number(abs(axis.delay) * 1e3, 2)} ms {way}"
    rms, worst = (number(math.degrees(v), 2) for v in (axis.as_is.rmse, axis.as_is.worst))
    differs = f"it differs by {rms}° rms, by {worst}° at most{late}."
    fit, moving = f"fit {number(c.fit, 3)} % on axis {axis.axis}", _without_offset(c)
    if grade_of(moving) != grade_of(c.fit) and moving >= FAIR_FIT:
        match = MATCH[grade_of(moving)].format(c.other, c.reference)
        offset = f"{match} but for a constant offset: fit {number(moving, 3)} % without it"
        return f"{offset}, {fit} with it; {differs}"
    if axis.as_is.fit_moving - axis.as_is.fit >= SAME_FIT:
        fit += f" ({number(axis.as_is.fit_moving, 3)} % without the constant offset)"
    return f"{MATCH[grade_of(c.fit)].format(c.other, c.reference)}: {fit}; {differs}"


def _without_offset(c: Comparison) -> float:
    """Fit without a constant offset, of the worst commanded axis [%]."""
    return min(a.as_is.fit_moving for a in c.axes if a.axis not in c.uncounted)


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


def _flight(name: str, f: Flown) -> str:
    """A flight in a sentence: its point first where it steered to one, then apogee and end."""
    shown = {key: number(value, 3) for key, value in f.numbers.items()}
    n = defaultdict(lambda: "–", shown)
    texts = []
    if "closest_approach_m" in n:
        texts.append(f"closest approach to its target {n['closest_approach_m']} m")
    if "apogee_m" in n:
        texts.append(f"apogee {n['apogee_m']} m after {n['apogee_s']} s")
    elif "max_height_m" in n:
        texts.append(f"up to {n['max_height_m']} m, where it ended in its climb")
    if "max_ascent_speed_m_s" in n:
        texts.append(f"up to {n['max_ascent_speed_m_s']} m/s")
    if "margin_loaded" in n:
        texts.append(f"static margin {n['margin_loaded']} calibres at launch")
    if f.numbers.get("attitude_error_rms_deg", 0.0) > 0.0:
        texts.append(f"attitude error under power {n['attitude_error_rms_deg']}° rms")
    end = f"after {n['flight_time_s']} s, {n['downrange_m']} m from the launch point"
    if "impact_speed_m_s" in n:
        texts.append(f"on the ground at {n['impact_speed_m_s']} m/s {end}")
    else:
        texts.append(f"ended {end}")
    return f"Flight {name}: {', '.join(texts)}."


def _fits(found: Sequence[Comparison]) -> Iterator[tuple[str, Grade]]:
    """Fits; one that only a constant offset keeps below fair is fair too."""
    for c in found:
        if not math.isfinite(c.fit):
            continue
        text, grade, moving = (
            f"{c.other}: fit {number(c.fit, 3)} %",
            grade_of(c.fit),
            _without_offset(c),
        )
        if grade_of(moving) != grade and moving >= FAIR_FIT:
            text, grade = f"{text}, {number(moving, 3)} % without offset", "fair"
        yield text, grade


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


def _missing(numbers: ReportNumbers) -> Iterator[tuple[str, Grade]]:
    missing = sum(len(a.missing) for n in numbers.runs for a in n.figures)
    if missing:
        yield (
            f"{missing} figure{'s' if missing > 1 else ''} not determined, see All figures",
            "fair",
        )
