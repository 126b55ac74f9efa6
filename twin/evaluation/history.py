"""`twin history RECORDINGS`: one board's recordings over time, against a model."""

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from analysis.comparison import errors
from analysis.recording import Recording, read
from analysis.report import render
from analysis.schema import AnalysisError
from twin.config import History
from twin.config.paths import named, point_latest
from twin.errors import TwinError
from twin.evaluation.drift import RunDrift, run_drift
from twin.evaluation.history_page import sections
from twin.evaluation.history_result import Entry, HistoryResult, due

LINKAGE = "of the first recording, simulated with each one's commands"
OTHER = "of each recording, by the motion recorded beside it"


def history(config: History) -> HistoryResult:
    """Estimate the properties of a board from each of its recordings, and write control charts.

    Raises
    ------
    TwinError, AnalysisError : no recordings of one board, in one line
    """
    if not config.recordings:
        raise TwinError("history: name recordings (.rrd), or folders of them")
    out = named(config.out, "history", ".html", ".htm", force=config.force)
    runs, left_out = _runs(_files(config.recordings))
    board, own = _of_one_board(runs, config)
    own.sort(key=lambda run: _date(*run))
    shadow = own[0][1].properties["shadow"]
    assert isinstance(shadow, dict)  # by `_runs`
    entries = []
    for file, recording in own:
        same = replace(recording, properties={**recording.properties, "shadow": shadow})
        try:
            drift = run_drift(same, config.mechanism)
        except (TwinError, AnalysisError) as error:
            left_out.append(f"{file.name}: {error}")
            continue
        entries.append(Entry(file, _date(file, recording), drift, _fits(recording, drift)))
    if not entries:
        raise TwinError(f"no recording can be used: {left_out[-1]}")
    model = LINKAGE if shadow.get("gimbal") == "linkage" else OTHER
    result = HistoryResult(board, tuple(entries), tuple(left_out), due(entries), out, model)
    render(sections(result), f"History of {title_of(board)}", out, result.as_dict())
    point_latest(out)
    return result


def _files(places: Sequence[Path]) -> list[Path]:
    """The recordings that are named, and those in the folders that are named, each once."""
    files: dict[Path, Path] = {}
    for place in places:
        inside = [p for p in place.glob("*.rrd") if not p.is_symlink()] if place.is_dir() else None
        if inside == []:
            raise TwinError(f"{place}: has no recordings (.rrd)")
        files |= {p.resolve(): p for p in sorted(inside or [place])}
    return list(files.values())


def _runs(files: Sequence[Path]) -> tuple[list[tuple[Path, Recording]], list[str]]:
    """Recordings of rigs with a model beside them, and what is wrong with the others."""
    found, left_out = [], []
    for file in files:
        try:
            recording = read(file)
        except AnalysisError as error:
            left_out.append(f"{file.name}: {error}")
            continue
        if isinstance(recording.properties.get("shadow"), dict):
            found.append((file, recording))
        else:
            left_out.append(f"{file.name}: not of a rig with a model beside it")
    if not found:
        raise TwinError(f"no recording of a rig with a model beside it: {left_out[-1]}")
    return found, left_out


def _of_one_board(
    runs: Sequence[tuple[Path, Recording]], config: History
) -> tuple[str, list[tuple[Path, Recording]]]:
    """Its serial number, and its recordings."""
    boards = [board_of(recording) for _, recording in runs]
    names = sorted(set(boards))
    asked = config.board
    alike = [n for n in names if asked is None or n.removeprefix("unit-").startswith(asked)]
    chosen = asked if asked in names else alike[0] if len(alike) == 1 else None
    if chosen is None:
        raise TwinError(
            f"the recordings are of {', '.join(names)};"
            " give one of them, or its beginning, as --board"
        )
    return chosen, [run for run, board in zip(runs, boards, strict=True) if board == chosen]


def board_of(recording: Recording) -> str:
    """Serial number of the board, by its calibration; what a simulated rig is without one."""
    files = recording.properties.get("files")
    kept = files.get("calibration") if isinstance(files, dict) else None
    try:
        number = json.loads(kept["text"])["rig"] if isinstance(kept, dict) else None
    except (KeyError, TypeError, ValueError, RecursionError):
        number = None
    if isinstance(number, str) and number.strip("0"):
        return number[:20]
    unit = recording.setting("unit")
    gimbal = str(recording.setting("gimbal"))[:40]
    return f"{gimbal} without a calibration" if unit is None else f"unit-{unit}"


def title_of(board: str) -> str:
    """What `board_of` returns, in words."""
    if board.startswith("unit-"):
        return f"simulated unit {board.removeprefix('unit-')}, uncalibrated"
    return board if board.endswith("calibration") else f"board {board}"


def _date(file: Path, recording: Recording) -> float:
    text = recording.properties.get("date")
    try:
        return datetime.fromisoformat(str(text)).timestamp()
    except ValueError:
        return file.stat().st_mtime


def _fits(recording: Recording, drift: RunDrift) -> dict[str, float]:
    measured = recording["gimbal/measured"]
    known = np.isfinite(measured.values).all(axis=1)
    return {
        axis: errors(measured.column(axis)[known], d.motion[known]).fit
        for axis, d in drift.axes.items()
    }
