"""From measurements and models to one page and its numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from analysis.recording.measurements import COMMAND, SIMULATED, Measurement, aligned
from analysis.recording.series import Recording, TimeSeries
from analysis.report.initial import with_initial_step
from analysis.report.numbers import ReportNumbers, numbers_of
from analysis.report.page import render
from analysis.report.sections import SECTIONS
from analysis.schema import AnalysisError
from analysis.transfer_function import Loop, TransferFunctionModel, margins

NO_MODELS: Mapping[str, TransferFunctionModel] = MappingProxyType({})
LARGEST = 2_000_000  # ticks simulated for one model
EVEN, FINE = 0.01, 1e-3  # of the period, that stamps may scatter; s, of the ticks where they do
LONGEST_LABEL = 60  # characters


def report(
    runs: Sequence[Measurement],
    out: Path | str,
    *,
    models: Mapping[str, TransferFunctionModel] = NO_MODELS,
    loops: Sequence[Loop] = (),
    labels: Sequence[str] | None = None,
    title: str | None = None,
) -> ReportNumbers:
    """Write one self-contained HTML page about runs of a gimbal, and return its numbers.

    Parameters
    ----------
    runs : the first is the reference, usually the hardware
    out : the page, `.html`
    models : identified models by name; each is simulated under the first run's commands
    loops : control loops whose margins with each model are reported
    labels : names of the runs in the report; their gimbal seats without it, of vehicles without a
        gimbal their files
    title : of the page; by whether all runs are flights if omitted

    Raises
    ------
    AnalysisError : a run has no axis with command and readings, a model's axes are not those of the
        first run, or the page cannot be written
    """
    out = Path(out)
    if out.suffix.lower() not in (".html", ".htm"):
        raise AnalysisError(f"{out}: a report is an .html file")
    sources = [*(r.name for r in runs), *("" for _ in models)]
    named, begun = zip(*map(with_initial_step, labelled(runs, labels)), strict=True)
    whose = [*(None for _ in named), *models.values()]
    answers = [simulated(named[0], name, model) for name, model in models.items()]
    runs = aligned((*named, *answers))
    if title is None:
        flights = all(run.in_flight or run.recording.passive for run in runs)
        title = "Flight report" if flights else "Gimbal report"
    numbers = numbers_of(runs, title, whose)
    entries = (replace(n, source=s) for n, s in zip(numbers.runs, sources, strict=True))
    numbers = replace(
        numbers,
        page=str(out),
        notes=(*chain(*begun), *numbers.notes),
        runs=tuple(entries),
        margins={name: margins(loops, model) for name, model in models.items() if loops},
    )
    sections = [s for compose in SECTIONS if (s := compose(runs, numbers)) is not None]
    render(sections, title, out, numbers.to_dict())
    return numbers


def labelled(
    runs: Sequence[Measurement], labels: Sequence[str] | None = None
) -> tuple[Measurement, ...]:
    """Name runs by labels, or by their gimbal seats; equal names are numbered.

    Raises
    ------
    AnalysisError : no run at all, another number of labels, and a run without an axis to report on
    """
    if not runs:
        raise AnalysisError("no recording to report on")
    if labels is not None and len(labels) != len(runs):
        raise AnalysisError(f"{len(labels)} labels for {len(runs)} recordings")
    asked = list(labels) if labels is not None else [_label(r) for r in runs]
    for run, name in zip(runs, asked, strict=True):
        if not run.axes and not run.recording.passive:
            raise AnalysisError(f"{name} has no axis with command and readings")
    return tuple(
        replace(r, name=f"{n} {asked[: k + 1].count(n)}" if asked.count(n) > 1 else n)
        for k, (r, n) in enumerate(zip(runs, asked, strict=True))
    )


def simulated(reference: Measurement, name: str, model: TransferFunctionModel) -> Measurement:
    """Simulate a model under a run's commands; the result is a run like any other.

    Raises
    ------
    AnalysisError : the model lacks an axis of the run, or the run's commands are too long to answer
    """
    missing = [a.component for a in reference.axes if a.component not in model.inputs]
    if missing or set(model.inputs) - {a.component for a in reference.axes}:
        raise AnalysisError(
            f"model {name} moves {', '.join(model.inputs)}; {reference.name} has "
            f"{', '.join(a.component for a in reference.axes) or 'no gimbal that moved'}"
        )
    time = reference.command.time
    apart = np.diff(time)
    dt, ahead = float(np.median(apart)), 1e-9
    if dt > 0.0 and np.ptp(apart) > EVEN * dt:  # stamps of a log: commands at the nearest tick
        dt /= np.ceil(dt / FINE)
        ahead = 0.5 * dt
    ticks = int((time[-1] - time[0]) / dt) + 1 if dt > 0.0 else 0
    if not 16 <= ticks <= LARGEST:
        raise AnalysisError(f"{reference.name}: {ticks} ticks; 16 to {LARGEST} can be simulated")
    t = time[0] + dt * np.arange(ticks)
    u = reference.command.select(model.inputs).held(t + ahead)
    command = TimeSeries(COMMAND, t, u, "rad", model.inputs)
    angle = TimeSeries(SIMULATED, t, model.simulate(u, dt), "rad", model.outputs)
    properties: dict[str, object] = {
        "command": "report",
        "configuration": {
            **_configuration(reference.recording),
            "gimbal": "transfer-function",
        },
        "model": model.to_dict(),
    }
    recording = Recording(properties, {COMMAND: command, SIMULATED: angle})
    return Measurement(command, angle, name=name, recording=recording)


def _configuration(recording: Recording) -> dict[str, object]:
    """Of the reference's configuration, what the model's answer shares: the signal."""
    said = recording.properties.get("configuration")
    kept = ("signal", "rate_limit_deg_s", "amplitude_deg", "repeats")
    return {k: said[k] for k in kept if k in said} if isinstance(said, Mapping) else {}


def _label(run: Measurement) -> str:
    if run.recording.passive:
        return Path(run.name).stem[:LONGEST_LABEL]
    gimbal = run.recording.setting("gimbal")
    return gimbal[:LONGEST_LABEL] if isinstance(gimbal, str) and gimbal.strip() else run.name
