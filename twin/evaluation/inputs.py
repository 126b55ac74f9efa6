"""Files given to a command as measurements: recordings of the twin, and tables from any rig."""

import csv
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis import recording
from analysis.files import opened
from analysis.identify import by_frames, by_pulses
from analysis.recording import Measurement, tables
from analysis.recording.caveats import caveats
from analysis.recording.loader import is_table
from analysis.units import is_number
from twin.config import Columns, Identify
from twin.errors import TwinError

# A simulated angle has no sensor noise, and the joint of an identified model follows it to 0.01°
# only (docs/control.md). Used as exact it would promise deviations a hundred times too small, so
# noise of that size is added.
READING = math.radians(0.01)

LARGEST = 1 << 32  # bytes of a file


@dataclass(frozen=True)
class Given:
    """Measurements of one kind of gimbal.

    Attributes
    ----------
    runs : one a file
    simulated : whether any of them holds a simulation's exact angles
    doubts : reasons to doubt what is made of them
    """

    runs: list[Measurement]
    simulated: bool
    doubts: tuple[str, ...] = ()


def given(config: Identify, files: tuple[Path, ...]) -> Given:
    """Read files for identification; axes that no file commands are left out of a model.

    Raises
    ------
    TwinError, AnalysisError : a file or flag that cannot be used, in one line
    """
    _refuse_twins(files)
    read = [_tabled(config, f) if is_table(f) else _recorded(config, f) for f in files]
    runs, simulated = [r for g in read for r in g.runs], any(g.simulated for g in read)
    if not config.from_pulses and not config.linkage:
        runs = by_frames(runs)
    inputs = runs[0].inputs
    moved = [n for k, n in enumerate(inputs) if any(len(r.command.changes(k)) for r in runs)]
    if not config.linkage and 0 < len(moved) < len(inputs) == len(runs[0].outputs):
        runs = [r.select(moved, [r.outputs[r.inputs.index(n)] for n in moved]) for r in runs]
    return Given(runs, simulated, tuple(d for g in read for d in g.doubts))


def _refuse_twins(files: tuple[Path, ...]) -> None:
    """Refuse two files of one content, which would halve every interval."""
    seen_before: dict[str, Path] = {}
    for path in files if len(files) > 1 else ():
        digest = _digest(path)
        if digest in seen_before:
            raise TwinError(
                f"{path}: has the content of {seen_before[digest]}; give every measurement once"
            )
        seen_before[digest] = path


def not_independent(config: Identify, fitted: Given, held_back: Sequence[Measurement]) -> list[str]:
    """One line for each file for validation whose content, or readings, were fitted."""
    sources = {_digest(f): f for f in config.sources}
    found = []
    for file, run in zip(config.check, held_back, strict=True):
        same = sources.get(_digest(file)) or next(
            (r.name for r in fitted.runs if _same(r, run)), ""
        )
        if same:
            what = "the same file" if Path(same) == file else f"the same readings as {same}"
            found.append(
                f"{file}: {what}, which was fitted; its fit says nothing of other motions, give"
                " --check a run of its own"
            )
    return found


def _digest(path: Path) -> str:
    with opened(path, LARGEST) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _same(a: Measurement, b: Measurement) -> bool:
    """Whether two measurements have the same readings; constant ones are alike by chance."""
    pairs = zip(a.sensors, b.sensors, strict=False)
    return any(
        x.values.shape == y.values.shape
        and np.array_equal(x.values, y.values, equal_nan=True)
        and np.nanstd(x.values) > 0.0
        for (_, x), (_, y) in pairs
    )


def _recorded(config: Identify, file: Path) -> Given:
    if file.is_dir():
        raise TwinError(f"{file}: is a folder; name a recording or a table in it")
    known = tables.KINDS | {".rrd"}
    if config.given and file.suffix.lower() not in known:
        raise TwinError(f"{file}: '{file.suffix}' is no table; {', '.join(sorted(known))} are read")
    for flag in config.given:
        if flag != "--angle":  # names a signal here
            raise TwinError(f"{flag} is only for tables; {file} is a recording")
    run = recording.load(
        file,
        angle=config.angle,
        rate=config.rate,
        gyro_delay=1e-3 * config.gyro_delay_ms,
        initial=config.initial,
    )
    if config.from_pulses:
        run = by_pulses(run)
    doubts = caveats([run])
    if run.in_flight:
        why = "whose commands answer its angles: noise and delay enter the estimate by the loop"
        doubts += (f"{file} is a flight, {why} (twin step excites a gimbal alone)",)
    exact = run.angle is not None and run.motion == "simulated"
    return Given([_with_noise(run) if exact else run], exact, doubts)


def _with_noise(run: Measurement) -> Measurement:
    noise = np.random.default_rng(0).normal(0.0, READING, run.angles.values.shape)
    return replace(run, angle=replace(run.angles, values=run.angles.values + noise))


def _tabled(config: Identify, file: Path) -> Given:
    if config.from_pulses:
        raise TwinError(f"--from-pulses is only for recordings of a rig; {file} is a table")
    columns = _columns(config, file, _names(config.rate))
    delay = 1e-3 * config.gyro_delay_ms
    run = recording.load(file, columns, gyro_delay=delay, initial=config.initial)
    return Given([run], simulated=False)


def seen(config: Columns, files: Sequence[Path]) -> list[Measurement]:
    """Read files to compare or report on.

    Raises
    ------
    TwinError, AnalysisError : a file or flag that cannot be used, in one line
    """
    if config.given and files and not any(is_table(f) for f in files):
        raise TwinError(f"{config.given[0]} is only for tables; {files[0]} is a recording")
    return [
        recording.load(f, _columns(config, f)).resampled() if is_table(f) else recording.load(f)
        for f in files
    ]


def _columns(config: Columns, file: Path, rate: tuple[str, ...] = ()) -> recording.Columns:
    if not config.time or not config.input:
        raise TwinError(
            f"{file}: name its columns: --time t --input u1,u2 --angle pot1,pot2"
            + (" --rate gyro1,gyro2" if isinstance(config, Identify) else "")
            + f"; it has {', '.join(tables.read(file).columns)}"
        )
    if config.commands is not None and config.input_stamps is not None:
        raise TwinError(
            f"--input-stamps {config.input_stamps}: not with --commands, which has time stamps"
        )
    return recording.Columns(
        config.time,
        _names(config.input),
        _names(config.angle),
        rate,
        config.angle_unit,
        config.input_unit,
        config.time_scale,
        config.commands,
        config.input_stamps or "shown",
        None if config.before is None else _numbers("--before", config.before),
    )


def _numbers(flag: str, text: str) -> tuple[float, ...]:
    if not all(map(is_number, _names(text))):
        raise TwinError(f"{flag} {text}: must be numbers, separated by commas")
    found = tuple(float(n) for n in _names(text))
    if not found or not np.isfinite(found).all():
        raise TwinError(f"{flag} {text}: must be finite numbers, separated by commas")
    return found


def _names(text: str | None) -> tuple[str, ...]:
    """Names between commas; one that holds a comma stands in double quotes."""
    fields = next(csv.reader([text or ""], skipinitialspace=True), [])
    return tuple(n.strip() for n in fields if n.strip())
