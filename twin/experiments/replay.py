"""`twin replay`: fly a recorded run again, bit for bit, or with something changed.

The recording's properties are the configuration. Where a rig had the gimbal seat, its recorded
frames take its place, fused again; nothing else is taken from the file but the arrays that the new
run is compared with.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from analysis.recording import Recording, read
from twin.config import Fly, Replay, Run, Step, heeded, with_model
from twin.config.recorded import configuration_of
from twin.config.seats import MODELS, is_port, is_rig
from twin.errors import TwinError
from twin.experiments.fly import fly, step
from twin.experiments.session import VERSIONS, compiled, make_plant
from twin.experiments.summary import FlightResult, StepResult

WIDTH = 28
TAPED = "(the rig's recorded angles flew: nothing answers a difference, and it grows)"
CLOCKED = "timing/"  # what the wall clock alone decides


@dataclass(frozen=True)
class Difference:
    """One signal of both recordings.

    Attributes
    ----------
    equal : every stamp and value the same, to the last bit
    largest : difference at common stamps, in `unit`; None where there are none
    at : when [s]
    """

    signal: str
    unit: str
    equal: bool
    largest: float | None
    at: float | None


@dataclass(frozen=True)
class ReplayResult:
    """A run flown again, compared with what was recorded.

    Attributes
    ----------
    recording, replayed : the old file and the new one
    changed : settings that differ, with old and new value
    differences : by signal
    missing : signals only one of the two has
    taped : the gimbal's angles were those of a recorded rig, whatever was commanded
    """

    recording: str
    replayed: str
    changed: Mapping[str, tuple[str, str]]
    differences: tuple[Difference, ...]
    missing: tuple[str, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]
    taped: bool = False

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
            "recorded_angles": self.taped,
            "before": dict(self.before),
            "after": dict(self.after),
        }

    def text(self) -> str:
        """One screen."""
        lines = [f"{'replayed':<{WIDTH}}{self.recording}"]
        lines += [f"{k:<{WIDTH}}{a} → {b}" for k, (a, b) in self.changed.items()]
        if self.identical:
            count = len(self.differences)
            lines.append(f"{'result':<{WIDTH}}identical, every bit of {count} signals")
        else:
            word = "differs" if self.changed else "NOT repeated, though nothing was changed"
            lines.append(f"{'result':<{WIDTH}}{word}")
            if self.taped:
                lines.append(f"{'':<{WIDTH}}{TAPED}")
            lines += [_line(d) for d in self.differences if not d.equal]
            lines += [f"{name:<{WIDTH}}only in one of the two" for name in self.missing]
            lines += [
                f"{k:<{WIDTH}}{self.before[k]:.4g} → {self.after[k]:.4g}"
                for k in self.before
                if k in self.after and self.before[k] != self.after[k]
            ]
        return "\n".join([*lines, f"{'recording':<{WIDTH}}{self.replayed}"])


def replay(config: Replay) -> ReplayResult:
    """Fly a recorded run again and compare.

    Raises
    ------
    TwinError : the recording cannot be flown again here, or not without `--force`
    AnalysisError : it is no sound recording
    """
    old = read(config.recording)
    recorded = heeded(configuration_of(old))
    asked = _changed(recorded, config)
    if not config.force:
        _check(old, recorded, config.recording)
    out = config.out or config.recording.with_suffix(".replay.rrd")
    if out.resolve() == config.recording.resolve():
        raise TwinError(f"--out {out}: the replay must not overwrite what it repeats")
    # a rig that is named anew is simulated anew; otherwise its recorded frames stand in for it
    tape = old if is_rig(asked.gimbal) and config.gimbal is None else None
    result = _flown(replace(asked, out=out), tape)
    new = read(result.recording)
    return ReplayResult(
        recording=str(config.recording),
        replayed=result.recording,
        changed=_settings(recorded, asked),
        differences=differences(old, new),
        missing=tuple(sorted(n for n in set(old.series) ^ set(new.series) if _counts(n))),
        before=_figures(old),
        after=_figures(new),
        taped=tape is not None,
    )


def differences(old: Recording, new: Recording) -> tuple[Difference, ...]:
    """Compare every signal that both hold and the wall clock does not decide."""
    return tuple(
        _difference(name, old, new)
        for name in sorted(set(old.series) & set(new.series))
        if _counts(name)
    )


def _difference(name: str, old: Recording, new: Recording) -> Difference:
    a, b = old[name], new[name]
    # bits, not values: NaN is to equal itself, and 0 is not to equal -0
    same = a.values.shape == b.values.shape and (
        a.time.tobytes() == b.time.tobytes() and a.values.tobytes() == b.values.tobytes()
    )
    if same:
        return Difference(name, a.unit, True, 0.0, None)
    _, left, right = np.intersect1d(a.time_ns, b.time_ns, return_indices=True)
    gap = np.linalg.norm(a.values[left] - b.values[right], axis=1)
    if not len(gap) or np.isnan(gap).all():
        return Difference(name, a.unit, False, None, None)
    k = int(np.nanargmax(gap))
    return Difference(name, a.unit, False, float(gap[k]), float(a.time[left[k]]))


def _counts(name: str) -> bool:
    return not name.startswith(CLOCKED)


def _check(old: Recording, recorded: Run, path: Path) -> None:
    """Refuse what would not be the same run: other libraries, or another model."""
    versions = old.properties.get("versions")
    versions = versions if isinstance(versions, dict) else {}
    other = [
        f"{name} {versions.get(name, 'unknown')} (here {version(name)})"
        for name in VERSIONS
        if versions.get(name) != version(name)
    ]
    if other:
        raise TwinError(
            f"{path} was flown with {', '.join(other)}; --force replays it all the same"
        )
    try:
        with compiled():
            digest = make_plant(recorded, getattr(recorded, "motor", None)).twin.sha256
    except TwinError as error:
        raise TwinError(f"{path} cannot be flown again as it was: {error}") from None
    if digest != old.properties.get("model_sha256"):
        raise TwinError(
            f"{path} was flown with another model than its files make today (SHA-256"
            f" {str(old.properties.get('model_sha256'))[:12]}…, here {digest[:12]}…);"
            " --force replays it all the same"
        )


def _changed(recorded: Run, config: Replay) -> Run:
    """The recorded configuration with what the command line changes."""
    # a port lives in real time, but its recorded frames do not
    clock = None if is_port(recorded.gimbal) else "lockstep"
    changes: dict[str, object] = {"clock": clock, "json": False}
    for name in ("integrator", "dt", "gimbal", "control_hz", "seed"):
        value = getattr(config, name)
        if value is None:
            continue
        if name not in {f.name for f in fields(recorded)}:
            raise TwinError(f"--{name.replace('_', '-')}: this recording has no such setting")
        changes[name] = value
    if config.set:
        changes["set"] = (*recorded.set, *config.set)  # the later of two wins
    if config.gimbal in MODELS:
        return with_model(recorded, **changes)  # type: ignore[arg-type]
    return replace(recorded, **changes)  # type: ignore[arg-type]


def _settings(recorded: Run, asked: Run) -> dict[str, tuple[str, str]]:
    silent = ("out", "json", "clock")
    pairs = ((f.name, getattr(recorded, f.name), getattr(asked, f.name)) for f in fields(recorded))
    return {n: (_told(a), _told(b)) for n, a, b in pairs if n not in silent and a != b}


def _told(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(map(str, value)) or "nothing"
    return "default" if value is None else str(value)


def _flown(config: Run, tape: Recording | None) -> FlightResult | StepResult:
    if isinstance(config, Fly):
        return fly(config, tape)
    assert isinstance(config, Step)
    return step(config, tape)


def _figures(recording: Recording) -> dict[str, float]:
    """What a person asks of a flight first."""
    found: dict[str, float] = {}
    series = recording.series
    if "vehicle/position" in series:
        position = series["vehicle/position"]
        found["flight time [s]"] = float(position.time[-1])
        found["height [m]"] = float(position.values[:, 2].max())
        found["end east [m]"], found["end north [m]"] = map(float, position.values[-1, :2])
    if "control/error" in series:
        error = np.linalg.norm(series["control/error"].values, axis=1)
        found["attitude error rms [°]"] = float(np.degrees(np.sqrt(np.nanmean(error**2))))
    return found


def _line(d: Difference) -> str:
    if d.largest is None:
        told = "nothing at the same time"
    elif d.largest == 0.0:
        told = "equal where both have something, but not as long or not as often"
    else:
        unit = "" if d.unit == "1" else f" {d.unit}"
        told = f"up to {d.largest:.3g}{unit} at {d.at:.3f} s"
    return f"{d.signal:<{WIDTH}}{told}"
