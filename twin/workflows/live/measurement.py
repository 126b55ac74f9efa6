"""`twin identify --live`: the next test signal is that which is expected to tell most a second."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.identify import FIGURES, IdentifiedModel, Wish, identify_gimbal
from analysis.recording import Measurement
from twin import status
from twin.config import Identify
from twin.config.base import hints
from twin.config.options import Rig, Time
from twin.config.paths import named
from twin.config.verbs import BY_NAME
from twin.errors import TwinError
from twin.evaluation.identify import identify as of_files
from twin.evaluation.identify import longest
from twin.evaluation.identify_result import IdentifyResult, InformationResult
from twin.evaluation.inputs import given
from twin.workflows.live.pieces import TICK, Expected, Piece, following, sized
from twin.workflows.live.result import LiveResult, text

if TYPE_CHECKING:
    from twin.evaluation.linkage import PhysicsResult

FIRST = Piece("steps", 1.0, 0.4, 2)
SHORTEST = 6.0  # s of one piece; between two the model is fitted
DOUBT = 2.0  # by which the expectation of a first short piece may be wrong
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "%": 0.01}


def identify(config: Identify) -> "IdentifyResult | PhysicsResult | InformationResult | LiveResult":
    """Identify a gimbal from files, or by measuring it until its model is known.

    Raises
    ------
    TwinError, AnalysisError, HardwareError : invalid input, in one line
    """
    return of_files(config) if config.live is None else _measured(config, wishes(config))


def wishes(config: Identify) -> tuple[Wish, ...]:
    """The half widths that `--until` asks for.

    Raises
    ------
    TwinError : what is none
    """
    found = {}
    for part in (config.until or "").split(","):
        name, _, amount = (t.strip() for t in part.partition(":"))
        name = name.replace("-", " ")
        unit = next((u for u in ("ms", "us", "µs", "%", "s") if amount.endswith(u)), "")
        try:
            half = float(amount.removesuffix(unit)) * UNITS.get(unit, math.nan)
        except ValueError:
            half = math.nan
        if name not in FIGURES or not 0.0 < half < math.inf or (unit == "%") == (name == "delay"):
            raise TwinError(
                f"--until {part.strip()}: must be delay:1ms, or NAME:3% of"
                f" {', '.join(n.replace(' ', '-') for n in FIGURES if n != 'delay')}"
            )
        if name in ("natural frequency", "damping") and config.poles != 2:
            raise TwinError(f"--until {part.strip()}: needs two poles, not {config.poles}")
        found[name] = Wish(name, half)
    return tuple(found.values())


def until_known(
    measure: Callable[[Piece], Measurement],
    asked: Sequence[Wish],
    largest: float,
    within: float,
    fit: Callable[[Sequence[Measurement]], IdentifiedModel],
) -> tuple[list[Piece], float, dict[str, float]]:
    """Measure pieces until every wish is met; returns them, their length [s] and the half widths.

    Parameters
    ----------
    largest, within : limits of the angle [rad] and of the motion [s]

    Raises
    ------
    TwinError : after the first piece, where a wish needs far more motion than that
    """
    piece, motion = FIRST, 0.0
    done: list[Piece] = []
    runs: list[Measurement] = []
    while True:
        done.append(piece)
        runs.append(measure(piece))
        motion += piece.excitation(largest).plan(TICK).duration
        model = fit(runs)
        halves = half_widths(model, asked)
        status.done(f"{motion:.0f} s: {_progress(asked, halves)}")
        left = within - motion
        if all(halves[w.name] <= w.half for w in asked) or left < SHORTEST:
            return done, motion, halves
        status.say(f"choosing the next signal; {_progress(asked, halves)}")
        piece, needed, told = following(model, runs, asked, largest, left)
        if len(done) == 1 and needed > DOUBT * left:
            raise TwinError(_unreachable(told, left, within))
        length = min(max(min(needed, motion), SHORTEST), left)
        piece = replace(sized(piece, length, largest), seed=len(done))


def _measured(config: Identify, asked: Sequence[Wish]) -> LiveResult:
    out = named(config.out, "model", ".json", force=config.force)
    folder = out.with_name(f"{out.stem}-pieces")
    try:
        folder.mkdir(exist_ok=config.force)
    except OSError as error:
        raise TwinError(f"cannot make the folder {folder}: {error.strerror}") from None
    alone = replace(config, live=None, until=None, sources=(folder,), **_unmeasured())
    files: list[Path] = []

    def measure(piece: Piece) -> Measurement:
        files.append(folder / f"{len(files) + 1}.rrd")
        fault = _stepped(config, piece, files[-1]).fault
        if fault:
            raise TwinError(f"--live {config.live}: {fault}; {files[-1]} holds the readings")
        return given(alone, (files[-1],)).runs[0]

    def fit(_: Sequence[Measurement]) -> IdentifiedModel:
        runs = given(alone, tuple(files)).runs  # together they show the wait for pulse frames best
        return identify_gimbal(
            runs, config.poles, coupling=config.coupling, max_delay=longest(config)
        )

    try:
        done, motion, halves = until_known(
            measure, asked, math.radians(config.amplitude_deg), config.within_s, fit
        )
    finally:
        if not any(folder.iterdir()):
            folder.rmdir()
    found = of_files(replace(alone, sources=tuple(files), out=out))
    assert isinstance(found, IdentifyResult)
    return LiveResult(
        found, tuple(files), tuple(p.text(config.amplitude_deg) for p in done), motion, halves,
        {w.name: w.half for w in asked},
    )  # fmt: skip


def _stepped(config: Identify, piece: Piece, out: Path) -> Any:  # noqa: ANN401  StepResult
    rig: dict[str, Any] = {
        f: getattr(config, f) for kind in (Rig, Time) for f in hints(kind) if f != "seed"
    }
    rig["no_check"] |= out.stem != "1"  # once is enough
    if config.live in ("linkage", "transfer-function"):
        rig.pop("no_check")
    with status.stage(f"piece {out.stem}: "):
        return BY_NAME["step"].run(
            gimbal=config.live, set=config.set, mechanism=config.mechanism, model=config.model,
            out=out, force=config.force, **rig, **piece.settings(config.amplitude_deg, config.seed),
        )  # fmt: skip


def _unmeasured() -> dict[str, Any]:
    """Settings of the measurement at their defaults."""
    kept = ("live", "until")
    names = [n for kind in (Rig, Time) for n in hints(kind)]
    names += ["within_s", "amplitude_deg", "model", "set"]
    return {n: getattr(Identify, n) for n in names if n not in kept}


def half_widths(model: IdentifiedModel, asked: Sequence[Wish]) -> dict[str, float]:
    """Of each wish that of the axis which knows it worst, in the wish's own unit."""
    return {w.name: max(w.now(row[k]) for k, row in enumerate(model.channels)) for w in asked}


def _progress(asked: Sequence[Wish], halves: dict[str, float]) -> str:
    return ", ".join(
        f"{w.name} ± {text(w.name, halves[w.name])} (asked {text(w.name, w.half)})" for w in asked
    )


def _unreachable(told: Expected, left: float, within: float) -> str:
    """What is asked for and cannot be had, and what can."""
    worst, after, needed = max(told, key=lambda t: t[2])
    name = worst.name.replace(" ", "-")
    return (
        f"--until {name}:{text(worst.name, worst.half, '')}: needs about {_span(needed)} of motion;"
        f" {text(worst.name, after(left))} is reachable in {within:.0f} s (--within-s)"
    )


def _span(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "more than a month"
    return f"{seconds / 3600.0:.0f} h" if seconds > 5400.0 else f"{seconds / 60.0:.0f} min"
