"""The report's numbers, for machines: the same the page shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.comparison.compare import Comparison, compare
from analysis.flown import Flown, flown
from analysis.plain import Plain
from analysis.recording.caveats import caveats
from analysis.recording.measurements import Measurement
from analysis.report.figures import AxisFigures, Kind, report_figures
from analysis.report.spectrum import FrequencyResponse, frequency_response
from analysis.response import Figure, disagreements
from analysis.schema import AnalysisError
from analysis.transfer_function import Margins, TransferFunctionModel

SAME = 0.98  # of the time two commands must agree for their answers to be compared
CLOSE = 1e-3  # rad; a command within 0.06° is the same command
MOST_STEPS = 200  # a command of more changes is no sequence of steps
BROADBAND = ("broadband",)


@dataclass(frozen=True, slots=True)
class RunNumbers(Plain):
    """Figures of one run.

    Attributes
    ----------
    label, motion : what it is called, and whether it was `measured` or `simulated`
    duration : [s]
    samples : of the angle
    figures : per axis
    responses : frequency response by axis, where the command allows one
    disagree : (axis, figure, amplitude [rad]) outside the interval of the first run, if that was
        measured
    source : file it was read from; empty for a model's response
    flight : figures of a flight; None where no vehicle flew
    """

    label: str
    motion: str
    duration: float
    samples: int
    figures: tuple[AxisFigures, ...]
    responses: Mapping[str, FrequencyResponse]
    disagree: tuple[tuple[str, str, float], ...] = ()
    source: str = ""
    flight: Flown | None = None

    def kind(self, axis: str) -> Kind | None:
        """What the command of an axis was, None for an axis the run lacks."""
        return next((a.kind for a in self.figures if a.axis == axis), None)

    def by_name(self, axis: str) -> dict[str, Figure]:
        """Figures of an axis; of one name the last."""
        return {f.name: f for a in self.figures if a.axis == axis for f in a.figures}

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        content = Plain.to_dict(self)
        axes, responses = content.pop("figures"), content.pop("responses")
        return {**content, "axes": axes, "frequency_response": responses}


@dataclass(frozen=True, slots=True)
class ReportNumbers(Plain):
    """Every number of a report.

    Attributes
    ----------
    title : of the page
    page : file written, or empty
    runs : in the order given; the first is the reference
    comparisons : every later run against every earlier one
    notes : what could not be computed, and reasons for doubt
    margins : of a control loop with each model, by the model's name
    """

    title: str
    page: str
    runs: tuple[RunNumbers, ...]
    comparisons: tuple[Comparison, ...]
    notes: tuple[str, ...]
    margins: Mapping[str, tuple[Margins, ...]] = field(default_factory=dict)


def numbers_of(
    runs: Sequence[Measurement], title: str, models: Sequence[TransferFunctionModel | None] = ()
) -> ReportNumbers:
    """Compute whatever the runs allow; what they do not allow becomes a note.

    Parameters
    ----------
    models : of each run the model whose answer it is, or None; nothing if no run is one's
    """
    notes = list(caveats(runs, together=False))
    models = [*models, *(None for _ in runs[len(models) :])]
    first = report_figures(runs[0], models[0])
    entries = []
    for k, run in enumerate(runs):
        figures = first if k == 0 else report_figures(run, models[k])
        notes += [f"{run.name}, {a.axis}: {note}" for a in figures for note in a.notes]
        disagree = _disagree(first, figures) if k and runs[0].motion == "measured" else ()
        if run.motion != "measured":  # a simulation has no noise to scatter by
            disagree = tuple(d for d in disagree if not d[1].startswith("repeatability"))
        entries.append(_numbers(run, figures, disagree))
    comparisons = []
    for k, other in enumerate(runs):
        for reference in runs[:k]:
            if reference.recording.passive or other.recording.passive:
                continue
            try:
                comparisons.append(_compared(reference, other))
            except AnalysisError as error:
                notes.append(f"{reference.name} and {other.name}: {error}")
    return ReportNumbers(title, "", tuple(entries), tuple(comparisons), tuple(notes))


def same_command(a: Measurement, b: Measurement) -> bool:
    """Whether two records have the same commands, except at the edges."""
    low = max(a.command.time[0], b.command.time[0])
    high = min(a.command.time[-1], b.command.time[-1])
    t = np.linspace(low, high, 4001)[1:-1]
    if not high > low:
        return False
    return float(np.mean(np.abs(a.command.held(t) - b.command.held(t)) < CLOSE)) > SAME


def _numbers(
    run: Measurement, figures: Sequence[AxisFigures], disagree: tuple[tuple[str, str, float], ...]
) -> RunNumbers:
    responses = {}
    kinds = {f.axis: f.kind for f in figures}
    for axis in run.axes:
        if kinds[axis.component] not in BROADBAND:
            continue
        try:
            responses[axis.component] = frequency_response(axis)
        except AnalysisError:
            continue  # the figures' note says it already
    time = run.angles.known().time
    time = time if len(time) else run.angles.time
    return RunNumbers(
        run.name,
        run.motion,
        float(time[-1] - time[0]),
        len(time),
        tuple(figures),
        responses,
        disagree,
        flight=flown(run.recording),
    )


def _disagree(
    reference: Sequence[AxisFigures], other: Sequence[AxisFigures]
) -> tuple[tuple[str, str, float], ...]:
    found = [
        (a.axis, own.name, own.amplitude)
        for a in reference
        for b in other
        if a.axis == b.axis and a.kind == b.kind
        for _, own in disagreements(a.figures, b.figures)
    ]
    return tuple(dict.fromkeys(found))


def _compared(reference: Measurement, other: Measurement) -> Comparison:
    pairs = [(a, b) for a in reference.axes if (b := other.axis(a.component)) is not None]
    if pairs and not all(same_command(a, b) for a, b in pairs):
        raise AnalysisError("they were commanded differently, so their motions are not compared")
    if not pairs:
        raise AnalysisError("they have no axis in common")
    motions = (replace(run.angles, name=run.name) for run in (reference, other))
    still = [a.component for a, _ in pairs if not len(a.command.changes())]
    return compare(*motions, repeats={a.component: repeats(a) for a, _ in pairs}, still=still)


def repeats(axis: Measurement) -> list[float]:
    """When repeats of steps begin, departures to the largest angle, and when the last one ends.

    Nothing for a command that is no sequence of steps.
    """
    rows = axis.command.changes()
    top = float(axis.command.value.max())
    if not 0 < len(rows) <= MOST_STEPS or top <= 0.0:
        return []
    begins = [float(axis.command.time[r]) for r in rows if axis.command.value[r] >= 0.999 * top]
    end = float(axis.active().command.time[-1])
    return [*begins, end] if begins and end > begins[-1] else []
