"""`twin step`: a test signal on a clamped gimbal, and the figures of its response."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis.schema import AnalysisError
from twin.config import Step
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.excitation import LONGEST, Excitation, Plan
from twin.experiments.kept import Origin
from twin.experiments.session import Session
from twin.experiments.summary import computing_row, recording_rows, timing_rows, trouble_rows
from twin.loop.seats import Sequence as Commands
from twin.plant.authority import stops

if TYPE_CHECKING:
    from analysis.recording import Recording
    from analysis.report.figures import AxisFigures
    from analysis.timing import Verdict

SMALLER = 0.9  # of the largest step: other steps are only in --json and in the report
FEW = 4  # steps; of fewer, Student's t widens intervals twofold or more
IN_FULL = ("peak", "peak time")  # only with --json and in the report; a screen is small


@dataclass(frozen=True)
class StepResult(Result):
    """Response of a gimbal to a test signal.

    Attributes
    ----------
    signal : kind of test signal
    figures : per axis what the signal can show, and notes on what could not be measured
    excitation_s : experiment time commanded
    fault : what went wrong with the rig first; None where nothing did
    timing : whether real time left the run valid; None in lockstep
    remarks : what is worth knowing about the rig, one line each
    """

    recording: str
    gimbal: str
    signal: str
    figures: "tuple[AxisFigures, ...]"
    excitation_s: float
    physics_steps: int
    physics_s: float
    cpu_s: float
    wall_s: float
    warnings: dict[str, int]
    fault: str | None = None
    timing: "Verdict | None" = None
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong with the rig."""
        return self.fault is None

    def as_dict(self) -> dict[str, object]:
        """JSON values; `figures` has one row per axis and figure, null where not measurable."""
        rows = [{"axis": a.axis, **f.to_dict()} for a in self.figures for f in a.figures]
        notes = [f"{a.axis}: {note}" for a in self.figures for note in a.notes]
        others = {k: v for k, v in vars(self).items() if k not in ("figures", "timing")}
        others["timing"] = None if self.timing is None else self.timing.as_dict()
        others.pop("remarks")
        return {**others, "figures": rows, "notes": [*notes, *self.remarks]}

    def rows(self) -> Rows:
        """The response as a table."""
        rows = [("gimbal", self.gimbal), ("signal", f"{self.signal}, {self.excitation_s:.1f} s")]
        rows += lines(self.figures)
        rows.append(computing_row(self.wall_s, self.cpu_s, self.physics_steps, self.physics_s))
        rows += timing_rows(self.timing) + trouble_rows(self.fault, self.warnings)
        rows += [("note", remark) for remark in self.remarks]
        return rows + recording_rows(self.recording)


def step(
    config: Step, playback: "Recording | None" = None, origin: Origin | None = None
) -> StepResult:
    """Command a gimbal on the bench with a test signal and record its response.

    Parameters
    ----------
    playback : recording whose readings take the place of a rig
    origin : what is recorded about the files of a run that is repeated

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began, busy = time.perf_counter(), time.process_time()
    signal = excitation(config) if config.commands is None else None
    with Session(config, "step", config.control_hz, playback=playback, origin=origin) as s:
        plant = s.plant
        if plant.twin.gimbal == "fixed":
            raise TwinError(f"--scene {config.scene}: has no gimbal to step")
        ends = stops(plant.twin.mj)
        if signal is None:
            plan = commanded(config, ends)
        else:
            _check_amplitude(config, ends)
            plan = signal.plan(s.tick_ns * 1e-9)
        s.connect()
        commands = Commands(plan.times, plan.angles)
        guard = s.guard(commands, config.on_fault)
        recorder = s.record(guard)
        s.rehearse(commands)
        s.run(
            guard or commands,
            round(plan.duration * 1e9),
            stop=guard.over if guard else lambda: None,
        )
        timing = s.verdict()
    fault = guard.fault if guard else None
    return StepResult(
        recording=str(recorder.path),
        gimbal=config.gimbal,
        signal=config.signal if config.commands is None else f"commands of {config.commands}",
        excitation_s=plan.duration,
        figures=_figures(recorder.path, fault),
        physics_steps=plant.steps,
        physics_s=plant.computing_s,
        cpu_s=time.process_time() - busy,
        wall_s=time.perf_counter() - began,
        warnings=plant.warnings(),
        fault=fault,
        timing=timing,
        remarks=s.notes,
    )


def excitation(config: Step) -> Excitation:
    """The test signal, in radians.

    Raises
    ------
    TwinError : a value that cannot be, with its flag
    """
    limit = config.rate_limit_deg_s
    return Excitation(
        signal=config.signal,
        amplitude=math.radians(config.amplitude_deg),
        axis=config.axis,
        repeats=config.repeats,
        hold=config.hold_s,
        duration=config.duration_s,
        band=config.band_hz,
        smallest=math.radians(config.smallest_deg),
        rate_limit=None if limit is None else math.radians(limit),
        seed=config.seed,
    )


def _check_amplitude(config: Step, ends: float | None) -> None:
    limit = math.pi / 2 if ends is None else ends
    if math.radians(config.amplitude_deg) > limit * (1.0 + 1e-9):
        raise TwinError(
            f"--amplitude-deg {config.amplitude_deg:g}: must be at most {math.degrees(limit):g}°,"
            f" {'the stops of the mechanism' if ends else 'of a mechanism without stops'}"
        )


def commanded(config: Step, ends: float | None) -> Plan:
    """The commands of a file, in radians, dated from the first one, with a rest after the last.

    Raises
    ------
    TwinError, AnalysisError : a file that cannot be used, or commands outside the stops
    """
    from twin.experiments.assembly import rig_calibration
    from twin.hil.history import Source, gimbal_angles, read

    assert config.commands is not None
    names = tuple(n.strip() for n in (config.input or "").split(",") if n.strip())
    source = Source(
        config.commands, config.time, names, config.input_unit, config.ratio, config.time_scale
    )
    given = read(source)
    calibration = rig_calibration(config) if source.pulses else None
    angles = gimbal_angles(source, given, calibration, config.axis, ends)
    changed = np.any(np.diff(angles, axis=0) != 0.0, axis=1)
    rows = np.concatenate([[0], np.flatnonzero(changed) + 1])
    duration = float(given.time[-1]) + config.hold_s
    if duration > LONGEST:
        raise TwinError(f"{config.commands}: {duration:.0f} s; must be at most {LONGEST:.0f} s")
    return Plan(np.array(given.time[rows]), angles[rows], duration)


def figures(recording: Path) -> "tuple[AxisFigures, ...]":
    """Figures of a recording, per axis and of both; axes without commands are left out."""
    from analysis.recording import load
    from analysis.report.figures import run_figures

    return tuple(f for f in run_figures(load(recording)) if f.kind != "still")


def _figures(recording: Path, fault: str | None) -> "tuple[AxisFigures, ...]":
    """Figures of a run; none where a fault ended it before there was anything to measure."""
    try:
        return figures(recording)
    except AnalysisError:
        if fault is None:
            raise
        return ()


def lines(figures: "Sequence[AxisFigures]") -> Rows:
    """One row a figure, with a column for every axis and direction: that of the largest step."""
    from analysis.report.words import amplitude_text, split, value_text

    cells: dict[str, dict[tuple[str, str], str]] = {}
    heads: dict[tuple[str, str], str] = {}
    for axis in figures:
        largest = max((abs(f.amplitude) for f in axis.figures if split(f.name)[1]), default=0.0)
        for f in axis.figures:
            name, direction = split(f.name)
            if direction and abs(f.amplitude) < SMALLER * largest:
                continue
            column = (axis.axis, direction)
            if name not in IN_FULL:
                cells.setdefault(name, {})[column] = value_text(f)
            if direction:
                heads[column] = f"{axis.axis} {direction}, {amplitude_text(f)}, n = {f.n}"
            else:
                heads.setdefault(column, axis.axis)
    rows = []
    for directed in (True, False):
        columns = [c for c in sorted(heads, key=lambda c: (len(c[0]), c)) if bool(c[1]) is directed]
        shown = {n: by for n, by in cells.items() if set(by) & set(columns)}
        table = [
            [heads[c] for c in columns],
            *([by.get(c, "") for c in columns] for by in shown.values()),
        ]
        widths = [max(map(len, column)) + 2 for column in zip(*table, strict=True)]
        rows += [
            (name, "".join(f"{c:<{w}}" for c, w in zip(cells, widths, strict=True)).rstrip())
            for name, cells in zip(["", *shown] if shown else (), table, strict=False)
        ]
    counts = [f.n for a in figures for f in a.figures if split(f.name)[1] and f.n > 1]
    if min(counts, default=FEW) < FEW:
        text = (
            f"intervals of {min(counts)} steps are wide, whatever they show; record {FEW} or more"
        )
        rows.append(("note", f"{text} of a size (--repeats)"))
    return rows + [(f"note on {a.axis}", note) for a in figures for note in a.notes]
