"""The figures a run allows, per axis: the kind of command decides which there are.

`run_figures` are those of a test at once; `report_figures` adds what a page has room for.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from analysis.plain import Plain
from analysis.recording.measurements import Measurement
from analysis.report.samples import at_rest, cut, in_motion, places, plateaus, steps_of
from analysis.report.spectrum import frequency_response, measured_figures
from analysis.response import (
    Figure,
    cosine_loss,
    cross_coupling,
    frequency_figures,
    hysteresis,
    linearity,
    model_figures,
    over_repeats,
    repeatability,
    slew_figures,
    staircase_figures,
    step_figures,
)
from analysis.schema import AnalysisError
from analysis.transfer_function import TransferFunctionModel

Kind = Literal["steps", "staircase", "broadband", "ramps", "still", "closed loop"]

KINDS: dict[str, Kind] = {
    "steps": "steps", "staircase": "staircase", "chirp": "broadband", "prbs": "broadband",
    "multisine": "broadband", "triangle": "ramps", "dog-leg": "ramps",
}  # fmt: skip
HELD = 0.15  # s; commands held longer are steps one can watch settle
UNSEEN = "the record does not show it"
SIZES = 4  # different step sizes make a staircase
APPROACHES = 3  # of a place from one side make its repeatability
FEWEST_RESTS = 6  # tell what moves an axis besides its own command
COUPLED = 0.01  # of an axis' own gain: less does not show in its figures
FEWEST_SIZES = 3  # of steps tell where a speed stops growing


@dataclass(frozen=True, slots=True)
class AxisFigures(Plain):
    """Figures of one axis of one run.

    Attributes
    ----------
    notes : why figures are not determined, and whatever else is worth knowing about them
    missing : figures, or groups of them, that are not determined
    """

    axis: str
    kind: Kind
    figures: tuple[Figure, ...]
    notes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


def kind_of(axis: Measurement) -> Kind:
    """Kind of command of an axis: as recorded, otherwise from its shape."""
    u, changes = axis.command, axis.command.changes()
    if len(changes) == 0:
        return "still"
    if axis.in_flight:
        return "closed loop"
    signal = axis.recording.setting("signal")
    limited = axis.recording.setting("rate_limit_deg_s")
    if isinstance(signal, str) and signal in KINDS and not limited:
        return KINDS[signal]
    pauses, jumps = np.diff(u.time[changes]), np.abs(np.diff(u.value)[changes - 1])
    if len(changes) < 3 or float(np.median(pauses)) >= HELD:
        return "staircase" if len(np.unique(np.round(jumps, 6))) >= SIZES else "steps"
    slopes = jumps / np.maximum(np.append(pauses, 1.0), 1e-9)
    usual = float(np.median(slopes))
    return "ramps" if np.mean(np.abs(slopes - usual) < 0.05 * usual) > 0.45 else "broadband"


def run_figures(run: Measurement) -> tuple[AxisFigures, ...]:
    """Figures of every axis, in the run's order, and then the coupling between them."""
    found = [axis_figures(axis) for axis in run.axes]
    for k, (driven, entry) in enumerate(zip(run.axes, found, strict=True)):
        if entry.kind in ("steps", "staircase"):
            shares = [_also(driven, other) for other in run.axes if other is not driven]
            found[k] = replace(entry, notes=(*entry.notes, *(s for s in shares if s)))
    coupled = [
        f
        for driven, entry in zip(run.axes, found, strict=True)
        if entry.kind in ("steps", "staircase")
        for other in run.axes
        if other is not driven
        for f in _coupling(driven, other)
    ]
    if coupled:
        found.append(AxisFigures(_together(run), "steps", tuple(coupled)))
    return tuple(found)


def report_figures(
    run: Measurement, model: TransferFunctionModel | None = None
) -> tuple[AxisFigures, ...]:
    """`run_figures` with slew rate, repeatability, cosine loss, and a model's own figures.

    Parameters
    ----------
    model : whose answer the run is, if it is one's
    """
    found = {a.axis: _with_more(run, a, model) for a in run_figures(run)}
    together = _together(run)
    if model is not None and len(model.outputs) > 1 and model.inputs == model.outputs:
        gains = [[0.0 if c.zero else c.num[-1] / c.den[-1] for c in row] for row in model.channels]
        coupled = found.get(together, AxisFigures(together, "steps", ()))
        own = cross_coupling(gains, model.outputs)
        found[together] = replace(coupled, figures=(*coupled.figures, *own))
    return tuple(found.values())


def _together(run: Measurement) -> str:
    return "/".join(a.component for a in run.axes)


def _with_more(
    run: Measurement, entry: AxisFigures, model: TransferFunctionModel | None
) -> AxisFigures:
    axis = run.axis(entry.axis)
    if axis is None or entry.kind in ("still", "closed loop"):
        return entry
    figures, notes, missing = list(entry.figures), list(entry.notes), entry.missing
    if entry.kind in ("steps", "staircase"):
        slew = _slew(axis)
        figures += slew
        if any(f.name == "speed_reached" for f in slew):
            notes.append("slew rate: the speed grows up to the largest step; no limit in sight")
        if entry.kind == "steps":
            figures += _repeatability(axis)
    figures += _loss(axis, entry.kind)
    try:
        figures += _own(axis.component, entry.kind, model)
    except AnalysisError as error:
        notes.append(f"model: {error}")
        missing = (*missing, "model")
    return replace(entry, figures=tuple(figures), notes=tuple(notes), missing=missing)


def _slew(axis: Measurement) -> tuple[Figure, ...]:
    """Nothing where steps of too few sizes tell nothing; without a knee only the speed reached."""
    steps = steps_of(axis)
    sizes = {round(abs(s.command_after - s.command_before), 6) for s in steps}
    if len(sizes) < FEWEST_SIZES:
        return ()
    try:
        rate, knee = slew_figures(steps)
    except AnalysisError:
        return ()
    return (rate, knee) if math.isfinite(knee.value) else (replace(rate, name="speed_reached"),)


def _repeatability(axis: Measurement) -> tuple[Figure, ...]:
    """AP, RP and vAP (ISO 9283) of every place that was approached often enough from one side."""
    command, angle, way = at_rest(axis)
    place = np.round(command, 6) + 0.0
    figures: list[Figure] = []
    for at in np.unique(place):
        sides = [angle[(place == at) & (way == sign)] for sign in (1.0, -1.0)]
        below, above = (s if len(s) >= APPROACHES else () for s in sides)
        if len(below) or len(above):
            figures += repeatability(float(at), below, above)
    return tuple(figures)


def _loss(axis: Measurement, kind: Kind) -> tuple[Figure, ...]:
    """Axial thrust lost at the largest angle: of plateaus where it was held, or once reached."""
    stroke = float(np.abs(axis.command.value).max())
    if kind in ("steps", "staircase"):
        command, angle, _ = at_rest(axis)
        stroke = float(np.abs(command).max(initial=0.0))  # the largest that was held
        reached = angle[np.abs(command) > 0.999 * stroke] if stroke > 0.0 else np.zeros(0)
        if not len(reached):
            return ()
    else:
        reached = np.array([np.abs(axis.angles.value).max()])
    return (over_repeats("cosine_loss", [cosine_loss(a).value for a in reached], "%", stroke),)


def _own(name: str, kind: Kind, model: TransferFunctionModel | None) -> tuple[Figure, ...]:
    """Figures of the model's own channel; those of a step only where its answer shows none."""
    if model is None or name not in model.inputs or name not in model.outputs:
        return ()
    channel = model.channels[model.outputs.index(name)][model.inputs.index(name)]
    if channel.zero:
        return ()
    return (frequency_figures if kind in ("steps", "staircase") else model_figures)(channel)


def axis_figures(axis: Measurement) -> AxisFigures:
    """Every figure this axis' command allows; one that fails becomes a note, never a guess."""
    kind = kind_of(axis)
    figures: list[Figure] = []
    notes: list[str] = []
    failed: list[str] = []
    for title, compute in _COMPUTED[kind]:
        try:
            figures += compute(axis)
        except AnalysisError as error:
            failed.append(title)
            notes.append(f"{title}: {error}")
    # a peak without an overshoot has no time, which is no fault of the record
    missing = [
        f.name for f in figures if not math.isfinite(f.value) and not f.name.startswith("peak_time")
    ]
    if missing:
        why = _usable(axis) if kind == "broadband" else _WHY.get(kind, UNSEEN)
        notes.append(f"{', '.join(missing)}: not measurable, {why}")
    return AxisFigures(axis.component, kind, tuple(figures), tuple(notes), (*failed, *missing))


def _usable(axis: Measurement) -> str:
    """Why a figure of a spectrum is missing, with the frequencies that the record has."""
    try:
        f = frequency_response(axis).frequency
    except AnalysisError:
        return UNSEEN
    return (
        "beyond the frequencies at which command and angle are coherent,"
        f" {f[0]:.2g} to {f[-1]:.2g} Hz"
    )


def _coupling(driven: Measurement, other: Measurement) -> tuple[Figure, ...]:
    """Motion of another axis at rest, of the driven one's own [%]; none if commanded meanwhile."""
    own = driven.active().command
    during = (other.command.time >= own.time[0]) & (other.command.time <= own.time[-1])
    moved = other.command.value[during]
    if moved.size and np.ptp(moved) > 0.0:
        return ()
    try:
        gain = linearity(*at_rest(driven)[:2])[0].value
        slope = linearity(*plateaus(cut(other.angles, own)))[0]
    except AnalysisError:
        return ()
    if gain == 0.0:
        return ()
    low, high = (100.0 * x / gain for x in slope.interval)
    name = f"coupling {driven.component}→{other.component}"
    value = 100.0 * slope.value / gain
    return (Figure(name, value, "%", slope.amplitude, slope.n, (low, high)),)


def _also(driven: Measurement, other: Measurement) -> str:
    """What another axis' command adds to the angles at rest, where both are commanded at once."""
    steps = steps_of(driven)
    count = len(steps)
    if count < FEWEST_RESTS:
        return ""
    command, angle = plateaus(steps)
    rests = [s.start + s.time[-len(s.rest) :] for s in steps]
    theirs = np.array([float(other.command.held(at)[:, 0].mean()) for at in rests])
    if np.ptp(theirs) == 0.0:
        return ""
    columns = np.column_stack([command, theirs, np.ones(count)])
    found, _, rank, _ = np.linalg.lstsq(columns, angle, rcond=None)
    left = angle - columns @ found
    if rank < 3 or found[0] == 0.0:
        return ""
    noise = float(left @ left) / (count - 3) * float(np.linalg.inv(columns.T @ columns)[1, 1])
    share = abs(found[1] / found[0])
    if share < COUPLED or abs(found[1]) < 4.0 * math.sqrt(noise):
        return ""
    return (
        f"gain, linearity, hysteresis and repeatability hold what the command of {other.component}"
        f" moves here as well, {100.0 * share:.2g} % of its own axis' motion; command one axis at a"
        " time"
    )


def _sweep_gap(axis: Measurement) -> tuple[Figure, ...]:
    return (replace(hysteresis(*in_motion(axis)), name="hysteresis with lag"),)


def _sweep_line(axis: Measurement) -> tuple[Figure, ...]:
    return linearity(*places(*in_motion(axis)))


_WHY: dict[Kind, str] = {
    "staircase": "no step was small enough, or all were too small",
    "steps": "the response does not come that far before the next step",
}
_LINE = ("linearity", lambda a: linearity(*at_rest(a)[:2]))
_COMPUTED: dict[Kind, tuple[tuple[str, Callable[[Measurement], tuple[Figure, ...]]], ...]] = {
    "steps": (
        ("step response", lambda a: step_figures(steps_of(a))),
        ("hysteresis", lambda a: (hysteresis(*at_rest(a)),)),
        _LINE,
    ),
    # no hysteresis: the smallest steps never leave the play whose width it would be
    "staircase": (("staircase", lambda a: staircase_figures(steps_of(a))), _LINE),
    "broadband": (("frequency response", lambda a: measured_figures(frequency_response(a))),),
    "ramps": (("hysteresis", _sweep_gap), ("linearity", _sweep_line)),
    "still": (),
    "closed loop": (),
}
