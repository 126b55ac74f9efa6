"""`twin replay`: repeat a recorded run, bit for bit or with changed settings.

The recording's properties are the settings, and hold the files that its run was given: no file that
it names is opened. Its recorded frames take the place of a rig and are fused again; the only other
data used are the arrays that the new run is compared with.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from analysis.recording import Recording, read
from twin.config import OBJECT, Fly, Replay, Run, Step, added, with_model, without_ineffective
from twin.config.paths import writable
from twin.config.recorded import configuration_of
from twin.config.result import Result, Rows
from twin.config.seats import MODELS, is_port, is_rig
from twin.errors import TwinError
from twin.experiments.assembly import make_plant
from twin.experiments.differences import Difference, counted, differences
from twin.experiments.flight.fly import fly
from twin.experiments.flight.result import FlightResult
from twin.experiments.kept import Origin, origin, restored
from twin.experiments.provenance import VERSIONS
from twin.experiments.step import StepResult, step
from twin.plant.compiled import compiled
from twin.plant.plant import Plant
from twin.plant.steps import integrators

RECORDED_ANGLES = "(the rig's recorded angles do not react to a difference, so it grows)"
OTHER_MACHINE = "(last bits may differ on another type of processor or C library: docs/timing.md)"


@dataclass(frozen=True)
class ReplayResult(Result):
    """A repeated run, compared with the recorded one.

    Attributes
    ----------
    recording, replayed : the old file and the new one
    changed : settings that differ, with old and new value
    differences : by signal
    missing : signals only one of the two has
    recorded_angles : whether the gimbal's angles were those of a recorded rig, whatever was
        commanded
    """

    recording: str
    replayed: str
    changed: Mapping[str, tuple[str, str]]
    differences: tuple[Difference, ...]
    missing: tuple[str, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]
    recorded_angles: bool = False

    @property
    def identical(self) -> bool:
        """Whether nothing that the wall clock does not decide differs in a single bit."""
        return not self.missing and all(d.equal for d in self.differences)

    @property
    def passed(self) -> bool:
        """False where a run that should have repeated itself did not."""
        return self.identical or bool(self.changed)

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "recording": self.recording,
            "replayed": self.replayed,
            "identical": self.identical,
            "changed": {k: list(v) for k, v in self.changed.items()},
            "differences": [asdict(d) for d in self.differences],
            "missing": list(self.missing),
            "recorded_angles": self.recorded_angles,
            "before": dict(self.before),
            "after": dict(self.after),
        }

    def rows(self) -> Rows:
        """The comparison as a table."""
        rows = [("replayed", self.recording)]
        rows += [(k, f"{a} → {b}") for k, (a, b) in self.changed.items()]
        if self.identical:
            rows.append(("result", f"identical, every bit of {len(self.differences)} signals"))
        else:
            verdict = "differs" if self.changed else "NOT repeated, although nothing was changed"
            rows.append(("result", verdict))
            if not self.changed:
                rows.append(("", OTHER_MACHINE))
            if self.recorded_angles:
                rows.append(("", RECORDED_ANGLES))
            rows += [(d.signal, d.text()) for d in self.differences if not d.equal]
            rows += [(name, "only in one of the two") for name in self.missing]
            rows += [
                (k, f"{self.before[k]:.4g} → {self.after[k]:.4g}")
                for k in self.before
                if k in self.after and self.before[k] != self.after[k]
            ]
        return [*rows, ("recording", self.replayed)]


def replay(config: Replay, controller: object | None = None) -> ReplayResult:
    """Repeat a recorded run and compare the two.

    Parameters
    ----------
    controller : own controller object in place of `config.controller`

    Raises
    ------
    TwinError : the recording cannot be repeated, or not without `--force`
    AnalysisError : it is not a valid recording
    """
    old = read(config.recording)
    recorded = without_ineffective(configuration_of(old))
    if controller is not None:
        config = replace(config, controller=f"{OBJECT}{type(controller).__name__}")
    _check_controller(recorded, config)
    asked = _changed(recorded, config)
    if not config.force:
        with restored(old, recorded, config.recording, force=False) as original:
            _check(old, original, config.recording)
    out = config.out or config.recording.resolve().with_suffix(".replay.rrd")
    if not out.is_dir():
        writable(out, ".rrd", force=config.force)
    if out.resolve() == config.recording.resolve():
        raise TwinError(f"--out {out}: the replay must not overwrite what it repeats")
    # a rig that is named anew is simulated anew; otherwise its recorded frames stand in for it
    playback = old if is_rig(asked.gimbal) and config.gimbal is None else None
    with restored(old, asked, config.recording, force=config.force) as again:
        again = replace(again, out=out, force=config.force)
        result = _flown(again, playback, controller, origin(old, asked))
    new = read(result.recording)
    return ReplayResult(
        recording=str(config.recording),
        replayed=result.recording,
        changed=_settings(recorded, asked) | _edited(old, new),
        differences=differences(old, new),
        missing=tuple(sorted(n for n in set(old.series) ^ set(new.series) if counted(n))),
        before=_figures(old),
        after=_figures(new),
        recorded_angles=playback is not None,
    )


def _check_controller(recorded: Run, config: Replay) -> None:
    """Demand an own controller where there was one: a file named in a recording is not executed."""
    before = getattr(recorded, "controller", None)
    if before is not None and config.controller is None:
        raise TwinError(
            f"{config.recording} was flown with the own controller {before}; a file named in a"
            " recording is not executed, so give --controller FILE.py:NAME"
        )


def _edited(old: Recording, new: Recording) -> dict[str, tuple[str, str]]:
    """An own controller whose file is another one than when the run was recorded."""
    before, after = (_digest(recording, "controller") for recording in (old, new))
    return {} if before == after else {"controller's SHA-256": (before, after)}


def _digest(recording: Recording, file: str) -> str:
    """First digits of the SHA-256 of a file that a run was given."""
    files = recording.properties.get("files")
    kept = files.get(file) if isinstance(files, dict) else None
    return str(kept.get("sha256"))[:12] if isinstance(kept, dict) and kept else "none"


def _check(old: Recording, recorded: Run, path: Path) -> None:
    """Refuse a run with other versions of libraries, or another model."""
    versions = old.properties.get("versions")
    versions = versions if isinstance(versions, dict) else {}
    other = [
        f"{name} {versions.get(name, 'unknown')} (here {version(name)})"
        for name in VERSIONS
        if versions.get(name) != version(name)
    ]
    if other:
        raise TwinError(
            f"{path} was flown with {', '.join(other)}; --force replays it nevertheless"
        )
    try:
        with compiled():
            plant = make_plant(recorded, getattr(recorded, "motor", None))
    except TwinError as error:
        raise TwinError(f"{path} cannot be repeated unchanged: {error}") from None
    digest = plant.twin.sha256
    if digest != old.properties.get("model_sha256"):
        raise TwinError(
            f"{path} was flown with a model that differs from that of its files (SHA-256"
            f" {str(old.properties.get('model_sha256'))[:12]}…, here {digest[:12]}…);"
            f" --force{_method(old, plant)} replays it nevertheless"
        )


def _method(old: Recording, plant: Plant) -> str:
    """Flags that ask for the method and step of a run, where a default has become another."""
    method = old.properties.get("method")
    method = method if isinstance(method, dict) else {}
    name, step = method.get("integrator"), method.get("step_s")
    if name not in integrators.NAMES or not isinstance(step, float):
        return ""
    if (name, step) == (plant.integrator, plant.dt_ns * 1e-9):
        return ""
    return f" --integrator {name} --dt {step:g}"


def _changed(recorded: Run, config: Replay) -> Run:
    """The recorded configuration with what the command line changes."""
    # a port lives in real time, but its recorded frames do not
    clock = None if is_port(recorded.gimbal) else "lockstep"
    changes: dict[str, object] = {"clock": clock, "json": False}
    for name in ("integrator", "dt", "gimbal", "control_hz", "seed", "controller"):
        value = getattr(config, name)
        if value is None:
            continue
        if name not in {f.name for f in fields(recorded)}:
            raise TwinError(f"--{name.replace('_', '-')}: the recorded run has no such setting")
        changes[name] = value
    if config.gimbal in MODELS:
        changed = with_model(recorded, **changes)  # type: ignore[arg-type]
    else:
        changed = replace(recorded, **changes)  # type: ignore[arg-type]
    return added(changed, config.overrides)


def _settings(recorded: Run, asked: Run) -> dict[str, tuple[str, str]]:
    silent = ("out", "json", "clock")
    pairs = ((f.name, getattr(recorded, f.name), getattr(asked, f.name)) for f in fields(recorded))
    return {n: (_text(a), _text(b)) for n, a, b in pairs if n not in silent and a != b}


def _text(value: object) -> str:
    if isinstance(value, tuple):
        pairs = (f"{v[0]}={v[1]:g}" if isinstance(v, tuple) else str(v) for v in value)
        return " ".join(pairs) or "nothing"
    return "default" if value is None else str(value)


def _flown(
    config: Run, playback: Recording | None, own: object | None, source: Origin
) -> FlightResult | StepResult:
    if isinstance(config, Fly):
        return fly(config, playback, own, source)
    assert isinstance(config, Step)
    return step(config, playback, source)


def _figures(recording: Recording) -> dict[str, float]:
    """The figures of a flight that are compared first."""
    figures: dict[str, float] = {}
    series = recording.series
    if "vehicle/position" in series:
        position = series["vehicle/position"]
        figures["flight time [s]"] = float(position.time[-1])
        figures["height [m]"] = float(position.values[:, 2].max())
        figures["end east [m]"], figures["end north [m]"] = map(float, position.values[-1, :2])
    if "control/error" in series:
        error = np.linalg.norm(series["control/error"].values, axis=1)
        figures["attitude error rms [°]"] = float(np.degrees(np.sqrt(np.nanmean(error**2))))
    return figures
