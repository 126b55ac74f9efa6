"""`twin compare RIG.rrd --drift`: what changed in a gimbal beside its model, and since when."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.estimate import AxisDrift, Change, Model, Property, drift
from analysis.recording import Recording, TimeSeries
from hardware.frames import AXES
from twin.config.result import Rows
from twin.errors import TwinError
from twin.evaluation.motions import LATER, lagging
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled

Array = NDArray[np.float64]
Signals = dict[str, tuple[Array, Array]]
# stamps (n,), motion (n, 2) and its derivatives (n, 2, r) with r further properties
Source = Callable[[tuple[float, ...]], tuple[Array, Array, Array]]

DEGREES = 180.0 / math.pi
# The model's own intervals: twice these. The parts of one servo type spread more; what is compared
# is one gimbal with a model fitted to it.
MOTION = (
    Property("gain", "", 1.0, 1.0, 0.01),
    # a command cannot act before it is sent: the model's own wait for the pulse frame
    Property("delay", "ms", 1e3, 0.0, 1e-3, lowest=-0.02),
)
ZERO = Property("zero", "°", DEGREES, 0.0, math.radians(0.2))  # of the servo's shaft
SEEN_ZERO = replace(ZERO, sigma=math.radians(0.1))  # of the gimbal
LAG = Property("lag", "ms", 1e3, 0.0, 2e-3)
SERVO = (
    ZERO,
    # 0.09 at 95 %: what emulated rigs like their model were seen to give at most; along a
    # slew 0.5 ms of delay and 3 % of speed move the gimbal alike
    Property("speed", "", 1.0, 1.0, 0.015, lowest=0.1, bias=0.045),
    Property("backlash", "°", DEGREES, 0.0, math.radians(0.1), lowest=0.0),
    Property("friction", "", 1.0, 1.0, 0.2, lowest=0.0),
)
VOLTAGE, BACKLASH = "gimbal_servo_voltage", "gimbal_backlash"
FRICTION = tuple(f"gimbal_servo_{a}.frictionloss" for a in AXES)
# Differences of zero, speed, backlash and friction over which the model's derivatives are taken:
# as large as the changes that matter, since backlash and friction are not linear.
STEPS = np.array([math.radians(1.0), -0.1, math.radians(0.5), 1.0])


@dataclass(frozen=True)
class RunDrift:
    """Both axes of a run against its model.

    Attributes
    ----------
    properties : in the order of the estimates
    axes : by name, without those that stood still
    """

    properties: tuple[Property, ...]
    axes: dict[str, AxisDrift]

    @property
    def changes(self) -> list[Change]:
        """What changed, in the order in which it was noticed."""
        return sorted((c for a in self.axes.values() for c in a.changes), key=lambda c: c.noticed)

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "estimates": [
                {"axis": axis, "property": p.name, "value": v, "sigma": s, "model": p.value}
                for axis, d in self.axes.items()
                for p, v, s in zip(
                    self.properties, d.track.value[-1].tolist(), d.track.sigma[-1].tolist(),
                    strict=True,
                )
            ],
            "differs_from_the_start": [t for d in self.axes.values() for t in d.differs],
            "changes": [
                {"axis": c.axis, "property": c.what.name, "since": c.since, "noticed": c.noticed,
                 "before": c.before, "after": c.after, "sigma": c.sigma}
                for c in self.changes
            ],
        }  # fmt: skip

    def rows(self) -> Rows:
        """Final estimates with 95 % intervals, a column per axis, differences and changes."""
        rows = []
        for k, p in enumerate(self.properties):
            cells = [
                f"{p.text(d.track.value[-1, k])} ± {1.96 * d.track.sigma[-1, k] * p.scale:.2f}"
                for d in self.axes.values()
            ]
            rows.append((f"{p.name} (model {p.text(p.value)})", "".join(f"{c:<30}" for c in cells)))
        rows += [("from the start", text) for d in self.axes.values() for text in d.differs]
        found = [("CHANGED", c.text) for c in self.changes]
        return rows + (found or [("drift", "none: no property changed during the run")])

    def signals(self, measured: TimeSeries) -> Signals:
        """What is recorded beside the measured angles: by signal, stamps (m,), values (m, k)."""
        time = np.asarray(measured.time)
        residual, band = np.full((2, len(time), len(AXES)), np.nan)
        some = next(iter(self.axes.values())).track
        tracks = np.full((len(self.properties), len(some.time), 2 * len(AXES)), np.nan)
        for axis, d in self.axes.items():
            k = AXES.index(axis)
            residual[:, k], band[:, k] = measured.values[:, k] - d.motion, d.band
            tracks[:, :, k], tracks[:, :, len(AXES) + k] = d.track.value.T, d.track.sigma.T
        found = {"shadow/residual": (time, residual), "shadow/band": (time, band)}
        names = (f"shadow/estimate/{p.name}" for p in self.properties)
        return found | {n: (some.time, v) for n, v in zip(names, tracks, strict=True)}


def run_drift(
    recording: Recording,
    mechanism: Path | None = None,
    parameters: Mapping[str, float] | None = None,
) -> RunDrift:
    """Estimate the properties of both axes of a run over time, and name what changed.

    A run with the linkage beside it is simulated again with other properties; of another model
    only gain, zero, delay and lag are estimated, from its recorded motion.

    Parameters
    ----------
    mechanism, parameters : see `Resimulation`

    Raises
    ------
    TwinError, AnalysisError : a recording that lacks what this needs, is too short, or moves no
        axis
    """
    measured, command = recording["gimbal/measured"], recording["gimbal/command"]
    shadow = recording.properties.get("shadow")
    linkage = isinstance(shadow, dict) and shadow.get("gimbal") == "linkage"
    moved = [k for k in range(len(AXES)) if len(command.changes(k))]
    if not moved:
        raise TwinError("no axis moves: the command never changes, so nothing can be estimated")
    time = np.asarray(measured.time)
    axes = {}
    with compiled():
        further, source = (
            _of_linkage(Resimulation(recording, mechanism, parameters))
            if linkage
            else _of_motion(recording)
        )
        properties = MOTION + further
        for k in moved:
            model = _model(k, time, source)
            values = np.asarray(measured.values[:, k])
            commanded = np.asarray(command.time)[command.changes(k)]
            axes[AXES[k]] = drift(AXES[k], time, values, model, properties, commanded)
    return RunDrift(properties, axes)


def _model(k: int, time: Array, source: Source) -> Model:
    """Motion of axis k at the readings' stamps, by all properties."""

    def model(level: Array) -> tuple[Array, Array]:
        gain, delay = level[:2].tolist()
        stamps, motion, slopes = source(tuple(level[2:].tolist()))
        at = time - delay
        now, later = (np.interp(t, stamps, motion[:, k]) for t in (at, at - LATER))
        others = [gain * np.interp(at, stamps, s) for s in slopes[:, k].T]
        return gain * now, np.column_stack([now, gain * (later - now) / LATER, *others])

    return model


def _of_linkage(run: Resimulation) -> tuple[tuple[Property, ...], Source]:
    """Properties of servos, and the motion with them."""
    volts, play = run.value(VOLTAGE), run.value(BACKLASH)
    friction = [run.value(name) for name in FRICTION]
    own = {"backlash": play}
    properties = tuple(replace(p, value=own.get(p.name, p.value)) for p in SERVO)

    def variant(zero: float, speed: float, backlash: float, rubbing: float) -> Variant:
        parameters = {VOLTAGE: volts * speed, BACKLASH: max(backlash, 1e-6)}
        rubs = {n: f * rubbing for n, f in zip(FRICTION, friction, strict=True)}
        return Variant(parameters | rubs, shaft=zero)

    @cache
    def source(level: tuple[float, ...]) -> tuple[Array, Array, Array]:
        steps = np.vstack([np.zeros(len(STEPS)), np.diag(STEPS)])
        motions = run.motions([variant(*(np.array(level) + s)) for s in steps])
        slopes = (motions[1:] - motions[0]) / STEPS[:, None, None]
        return run.time, motions[0], np.moveaxis(slopes, 0, -1)

    return properties, source


def _of_motion(recording: Recording) -> tuple[tuple[Property, ...], Source]:
    """Properties that the recorded motion of any model shows: its zero, and a lag behind it."""
    simulated = recording["gimbal/simulated"].known()
    stamps, motion = np.asarray(simulated.time), np.asarray(simulated.values)
    period = float(np.median(np.diff(stamps)))

    slope = (lagging(motion, LATER, period) - motion) / LATER
    slopes = np.stack([np.ones_like(motion), slope], axis=-1)

    def source(level: tuple[float, ...]) -> tuple[Array, Array, Array]:
        return stamps, motion + slopes @ np.array(level), slopes

    return (SEEN_ZERO, LAG), source
