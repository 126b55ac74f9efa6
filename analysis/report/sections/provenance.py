"""Where the numbers come from: runs, configuration, versions, hashes."""

import json
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import number

LONGEST = 200  # characters of one value
MOST_SETTINGS = 500


def provenance(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section:
    """One column a run; file, configuration, versions and hash."""
    rows = [
        ("file", [n.source or "–" for n in numbers.runs]),
        ("written", [_date(n.source) for n in numbers.runs]),
        ("command", [_said(r, "command") for r in runs]),
        ("vehicle", [_said(r, "configuration", "vehicle") for r in runs]),
        ("motor", [_said(r, "configuration", "motor") for r in runs]),
        ("gimbal", [_gimbal(r) for r in runs]),
        ("signal", [_said(r, "configuration", "signal") for r in runs]),
        ("scene", [_said(r, "configuration", "scene") for r in runs]),
        ("angle", ["–" if r.recording.passive else r.motion for r in runs]),
        ("duration", [f"{number(n.duration, 5)} s" for n in numbers.runs]),
        ("samples", [str(n.samples) for n in numbers.runs]),
        ("timing", [_word(r) for r in runs]),
        ("seed", [_said(r, "seed") for r in runs]),
        ("model", [_said(r, "model_sha256")[:16] for r in runs]),
        ("twin", [_said(r, "versions", "tvc-twin") for r in runs]),
        ("MuJoCo", [_said(r, "versions", "mujoco") for r in runs]),
    ]
    kept = [(name, values) for name, values in rows if any(v != "–" for v in values)]
    head = ("run", *(r.name for r in runs))
    table = Table(head, tuple((name, *values) for name, values in kept))
    return Section("runs", "Runs", _text(runs), (table,))


def _gimbal(run: Measurement) -> str:
    return "none" if run.recording.passive else _said(run, "configuration", "gimbal")


def _date(source: str) -> str:
    """When a file was last written, local time; – where there is no such file."""
    try:
        stamp = Path(source).stat().st_mtime if source else math.nan
    except (OSError, ValueError):
        return "–"
    if not math.isfinite(stamp):
        return "–"
    return datetime.fromtimestamp(stamp).astimezone().isoformat(" ", "minutes")


def _word(run: Measurement) -> str:
    word = run.recording.timing.get("verdict")
    return word if word in ("valid", "invalid") else "–"


def _text(runs: Sequence[Measurement]) -> tuple[str, ...]:
    reference = runs[0]
    texts = [f"The first run, {reference.name}, is the reference."] if len(runs) > 1 else []
    texts += [
        f"{run.name} was shifted by {number(run.shift * 1e3)} ms, so that its first command "
        f"coincides with that of {reference.name}."
        for run in runs
        if run.shift
    ]
    return (" ".join(texts),) if texts else ()


def settings(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """Everything the recordings carry about themselves, one column a run, folded on the screen."""
    texts = [dict(_leaves(run.recording.properties)) for run in runs]
    names = list(dict.fromkeys(name for by in texts for name in by))
    if not names:
        return None
    rows: list[tuple[Cell | str, ...]] = [
        (name, *(Cell(_short(by[name]) if name in by else "–") for by in texts)) for name in names
    ]
    head = ("setting", *(r.name for r in runs))
    table = Table(head, tuple(rows[:MOST_SETTINGS]), folded="Every setting of every run")
    return Section("settings", "Settings", (), (table,))


def _leaves(properties: Mapping[str, object], above: str = "") -> list[tuple[str, object]]:
    found: list[tuple[str, object]] = []
    for name, value in properties.items():
        path = f"{above}{name}"
        if isinstance(value, Mapping) and len(path) < LONGEST:
            found += _leaves(value, f"{path}.")
        else:
            found.append((path, value))
    return found


def _said(run: Measurement, *path: str) -> str:
    value: object = run.recording.properties
    for name in path:
        value = value.get(name) if isinstance(value, Mapping) else None
    return "–" if value is None or value == "" else _short(value)


def _short(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
