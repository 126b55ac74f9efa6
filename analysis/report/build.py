"""From recordings and models to one page and its numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from analysis.recording.reader import Recording, TimeSeries
from analysis.recording.run import ReportError, Run, aligned, run_of, runs_of
from analysis.report.numbers import ReportNumbers, numbers_of
from analysis.report.page import render
from analysis.report.sections import SECTIONS
from analysis.transfer_function import TransferFunctionModel

NO_MODELS: Mapping[str, TransferFunctionModel] = MappingProxyType({})
LARGEST = 2_000_000  # ticks simulated for one model


def report(
    recordings: Sequence[Recording],
    out: Path | str,
    *,
    models: Mapping[str, TransferFunctionModel] = NO_MODELS,
    labels: Sequence[str] | None = None,
    title: str = "Gimbal report",
) -> ReportNumbers:
    """Write one self-contained HTML page about recordings of a gimbal, and return its numbers.

    Parameters
    ----------
    recordings : the first is the reference, usually the hardware
    out : the page, `.html`
    models : identified models by name; each answers the first recording's commands
    labels : what the recordings are called; their gimbal seats without it

    Raises
    ------
    ReportError
        if a recording holds no gimbal, a model's axes are not the recording's, or the page cannot
        be written.
    """
    out = Path(out)
    if out.suffix.lower() not in (".html", ".htm"):
        raise ReportError(f"{out}: a report is an .html file")
    runs = list(runs_of(recordings, labels))
    whose = [*(None for _ in runs), *models.values()]
    runs += [simulated(runs[0], name, model) for name, model in models.items()]
    runs = list(aligned(runs))
    numbers = replace(numbers_of(runs, title, whose), page=str(out))
    sections = [s for compose in SECTIONS if (s := compose(runs, numbers)) is not None]
    render(sections, title, out, numbers.to_dict())
    return numbers


def simulated(reference: Run, name: str, model: TransferFunctionModel) -> Run:
    """Return what a model does under a run's commands, as a run of its own.

    Raises
    ------
    ReportError
        if the model lacks an axis of the run, or the run's commands are too long to answer.
    """
    missing = [a.name for a in reference.axes if a.name not in model.inputs]
    if missing or set(model.inputs) - {a.name for a in reference.axes}:
        raise ReportError(
            f"model {name} moves {', '.join(model.inputs)}; {reference.label} has "
            f"{', '.join(a.name for a in reference.axes)}"
        )
    time = reference.axes[0].time
    dt = float(np.median(np.diff(time)))
    ticks = int((time[-1] - time[0]) / dt) + 1 if dt > 0.0 else 0
    if not 16 <= ticks <= LARGEST:
        raise ReportError(f"{reference.label}: {ticks} ticks; 16 to {LARGEST} can be answered")
    t = time[0] + dt * np.arange(ticks)
    by_name = {a.name: a for a in reference.axes}
    asked = [by_name[i] for i in model.inputs]
    u = np.stack(
        [a.command[np.searchsorted(a.time, t + 1e-9, side="right") - 1] for a in asked], axis=1
    )
    y = model.simulate(u, dt)
    series = {
        "gimbal/command": TimeSeries("gimbal/command", t, u, "rad", model.inputs),
        "gimbal/simulated": TimeSeries("gimbal/simulated", t, y, "rad", model.outputs),
    }
    properties: dict[str, object] = {
        "command": "report",
        "configuration": {
            **_configuration(reference.recording),
            "gimbal": "transfer-function",
        },
        "model": model.to_dict(),
    }
    return run_of(Recording(properties, series), name)


def _configuration(recording: Recording) -> dict[str, object]:
    """Of the reference's configuration, what the model's answer shares: the signal."""
    said = recording.properties.get("configuration")
    kept = ("signal", "rate_limit_deg_s", "amplitude_deg", "repeats")
    return {k: said[k] for k in kept if k in said} if isinstance(said, Mapping) else {}
