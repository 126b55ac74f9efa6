"""`twin identify --linkage`: a recording in, an override file out."""

import copy
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco

from analysis.files import write_text
from hardware.frames import AXES
from twin import status
from twin.config import Identify
from twin.config.paths import named, point_latest
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.inputs import given
from twin.evaluation.linkage_data import moves_of
from twin.evaluation.words import quantity
from twin.physics import native
from twin.physics.mechanism.servo import apply_servo
from twin.plant.compiled import compiled
from twin.plant.model import overrides
from twin.plant.model.model import ModelConfig, load

if TYPE_CHECKING:
    from analysis.linkage.fit import LinkageFit
    from analysis.linkage.problem import Knob

# What a knob of one name sets; others set the parameter of their own name.
BACKLASH, FRICTION = "gimbal_backlash", "friction"
TARGETS: Mapping[str, tuple[str, ...]] = {
    FRICTION: ("gimbal_servo_x.frictionloss", "gimbal_servo_y.frictionloss"),
    "damping": ("gimbal_servo_x.damping", "gimbal_servo_y.damping"),
    "armature": ("gimbal_servo_x.armature", "gimbal_servo_y.armature"),
}
DEFAULTS = (
    "gimbal_servo_gain", "gimbal_servo_motor_constant", "gimbal_servo_dead_band",
    FRICTION, BACKLASH,
)  # fmt: skip
UNITS: Mapping[str, str] = {
    "gimbal_servo_gain": "N·m/rad",
    "gimbal_servo_motor_constant": "N·m/A",
    "gimbal_servo_resistance": "Ω",
    "gimbal_servo_rate_gain": "N·m·s/rad",
    "gimbal_servo_voltage": "V",
    "gimbal_servo_slew": "rad/s",
    "gimbal_servo_dead_band": "rad",
    BACKLASH: "rad",
    FRICTION: "N·m",
    "damping": "N·m·s/rad",
    "armature": "kg·m²",
    "delay": "s",
}
RANGE = 5.0  # factor either way; units of one kind of servo differ by half
SHORTEST_DELAY, LONGEST_DELAY = -0.005, 0.06  # s


@dataclass(frozen=True)
class PhysicsResult(Result):
    """Fitted parameters of the linkage and the override file they went to.

    Attributes
    ----------
    overrides : what the file holds, by the names `--set` takes
    """

    fit: "LinkageFit"
    overrides: Mapping[str, float]
    file: Path
    sources: tuple[str, ...]
    warnings: tuple[str, ...]
    wall_s: float

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        f = self.fit
        return {
            "estimates": [e.to_dict() for e in f.estimates],
            "fit": list(f.fit),
            "held_out": list(f.held_out),
            "start": list(f.start),
            "overrides": dict(self.overrides),
            "file": str(self.file),
            "sources": list(self.sources),
            "warnings": list(self.warnings),
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """Parameters, fit, warnings and the file."""
        f = self.fit
        rows = [("identified from", ", ".join(self.sources))]
        rows += [
            (e.name.removeprefix("gimbal_"), quantity(e.value, 1.96 * e.std, e.unit))
            for e in f.estimates
        ]
        for name, values in (
            ("fit before", f.start), ("fit", f.fit), ("fit on moves held out", f.held_out)
        ):  # fmt: skip
            fits = (f"{a} {v:.2f} %" for a, v in zip(AXES, values, strict=True))
            rows.append((name, ", ".join(fits)))
        rows += [("WARNING", w) for w in self.warnings]
        rows.append(("computing", f"{self.wall_s:.1f} s"))
        return [*rows, ("overrides", str(self.file)), ("", f"twin step --set-from {self.file}")]


def identify_linkage(config: Identify) -> PhysicsResult:
    """Fit servo and mechanism parameters to a recording and write an override file.

    Raises
    ------
    TwinError, AnalysisError : invalid input, in one line
    """
    from analysis.linkage.fit import fit_linkage
    from analysis.linkage.problem import DELAY

    began = time.perf_counter()
    out = named(config.out, "set", ".json", force=config.force)
    if len(config.sources) != 1:
        raise TwinError(f"--linkage: {len(config.sources)} sources; it takes one recording")
    known = config.overrides
    source = given(config, config.sources)
    with compiled():
        bench = _Bench(config, known)
        knobs = [bench.knob(name) for name in _names(config, simulated=source.simulated)]
        status.say(f"fitting {len(knobs)} parameters")
        fit = fit_linkage(moves_of(source.runs[0], bench.model), knobs, bench.built)
    values = {e.name: e.value for e in fit.estimates}
    late = values.pop(DELAY, 0.0)
    warnings = [*fit.warnings, *source.doubts]
    if late > 1e-3:
        warnings.append(f"{1e3 * late:.1f} ms of delay are no parameter of the linkage: not in it")
    written = {**known, **{t: v for n, v in values.items() for t in TARGETS.get(n, (n,))}}
    write_text(out, json.dumps(written, indent=2, allow_nan=False) + "\n")
    point_latest(out)
    return PhysicsResult(
        fit, written, out, tuple(r.name for r in source.runs), tuple(warnings),
        time.perf_counter() - began,
    )  # fmt: skip


def _names(config: Identify, *, simulated: bool) -> tuple[str, ...]:
    """What to fit; a simulation has no line and no pulse frame that its commands could wait for."""
    if config.parameters:
        return config.parameters
    return DEFAULTS if simulated else (*DEFAULTS, "delay")


class _Bench:
    """The bench scene with any values of its parameters, compiled once."""

    def __init__(self, config: Identify, known: Mapping[str, float]) -> None:
        scene = ModelConfig(scene="bench", mechanism=config.mechanism, overrides=known)
        self.model = load(scene).mj
        if self.model.nu != len(AXES):
            raise TwinError("--linkage needs a mechanism with two servos")

    def knob(self, name: str) -> "Knob":
        """A parameter by name, from a fifth to five times what the model has."""
        from analysis.linkage.problem import DELAY, Knob

        unit = UNITS.get(name, "")
        if name == DELAY:
            return Knob(name, 1e-3, SHORTEST_DELAY, LONGEST_DELAY, unit)
        start = overrides.value(self.model, TARGETS.get(name, (name,))[0])
        if not start > 0.0:
            raise TwinError(
                f"--parameters {name}: the model has it at {start:g}; give a start, for example"
                f" --set {name}=…"
            )
        return Knob(name, start, start / RANGE, start * RANGE, unit)

    def built(self, values: Mapping[str, float]) -> mujoco.MjModel:
        """A model of its own with these values."""
        model = copy.copy(self.model)
        changed = {t: v for n, v in values.items() for t in TARGETS.get(n, (n,))}
        if BACKLASH in changed:
            half = 0.5 * changed[BACKLASH]
            for axis in AXES:
                changed[f"gimbal_play_{axis}.range[0]"] = -half
                changed[f"gimbal_play_{axis}.range[1]"] = half
        overrides.apply(model, changed)
        apply_servo(model)
        native.bind(model)
        return model
