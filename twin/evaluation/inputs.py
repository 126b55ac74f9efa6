"""What the commands are given, as records or recordings: the twin's own, and anybody's tables."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.identify import Record, from_recording
from analysis.recording import tables
from analysis.recording.reader import Recording
from analysis.recording.record import Initial
from analysis.recording.record_of_table import to_record
from analysis.recording.tables import KINDS
from twin.config import Columns, Identify
from twin.errors import TwinError

# A simulated angle has no sensor's noise, and nothing that follows it exactly: the joint of an
# identified model keeps within 0.01° of it (docs/control.md). Taken as exact it would promise
# deviations a hundred times too small, so it is read as by a sensor that good.
READING = math.radians(0.01)


@dataclass(frozen=True)
class Given:
    """Records of one kind of gimbal.

    Attributes
    ----------
    records : one a file
    simulated : whether any of them holds a simulation's exact angles
    doubts : reasons to believe less of what is made of them
    """

    records: list[Record]
    simulated: bool
    doubts: tuple[str, ...] = ()


def given(config: Identify, files: tuple[Path, ...]) -> Given:
    """Read files, one record each; axes that no record commands are left out of a model.

    Raises
    ------
    TwinError, AnalysisError : a file or flag that cannot be used, in one line
    """
    read = [
        _recorded(config, file)
        if file.suffix.lower() == ".rrd"
        else Given([_tabled(config, file)], simulated=False)
        for file in files
    ]
    found, simulated = [r for g in read for r in g.records], any(g.simulated for g in read)
    moved = [n for k, n in enumerate(found[0].inputs) if any(len(r.changes(k)) for r in found)]
    if not config.linkage and 0 < len(moved) < len(found[0].inputs) == len(found[0].outputs):
        found = [_only(r, moved) for r in found]
    return Given(found, simulated, tuple(d for g in read for d in g.doubts))


def _recorded(config: Identify, file: Path) -> Given:
    from analysis.recording import reader as recording
    from analysis.recording.caveats import caveats

    for flag in config.given:
        if flag != "--angle":  # names a signal here
            raise TwinError(f"{flag} is only for tables; {file} is a recording")
    run = recording.read(file)
    measured = "gimbal/measured" in run.series
    default = None if config.rate else "gimbal/measured" if measured else "gimbal/simulated"
    angle = config.angle or default
    found = from_recording(
        run,
        angle=angle,
        rate=config.rate,
        gyro_delay=1e-3 * config.gyro_delay_ms,
        initial=config.initial,
        pulses=config.from_pulses,
        name=str(file),
    )
    exact = angle == "gimbal/simulated"
    doubts = caveats([run], [str(file)])
    if run.properties.get("command") == "fly":
        told = f"{file} is of a flight, whose commands answer its angles: noise and delay go round"
        doubts += (f"{told} the loop into the estimate (twin step excites a gimbal alone)",)
    return Given([_as_read(found) if exact else found], exact, doubts)


def _as_read(r: Record) -> Record:
    assert r.angle is not None
    noise = np.random.default_rng(0).normal(0.0, READING, r.angle.shape)
    return replace(r, angle=r.angle + noise)


def _tabled(config: Identify, file: Path) -> Record:
    if config.from_pulses:
        raise TwinError(f"--from-pulses is about recordings of a rig; {file} is a table")
    rate, gyro_delay = _names(config.rate), 1e-3 * config.gyro_delay_ms
    return replace(_record_of(config, file, rate, gyro_delay, config.initial), name=str(file))


def seen(config: Columns, files: Sequence[Path]) -> list[Recording]:
    """Read recordings, and tables as such.

    Raises
    ------
    TwinError, AnalysisError : a file or flag that cannot be used, in one line
    """
    from analysis.recording.reader import read
    from analysis.recording.run import recording_of

    if config.given and files and not any(is_table(f) for f in files):
        raise TwinError(f"{config.given[0]} is only for tables; {files[0]} is a recording")
    return [recording_of(_dense(_record_of(config, f))) if is_table(f) else read(f) for f in files]


def is_table(file: Path) -> bool:
    """Whether a file's name is that of a table; what is none is taken for a recording."""
    return file.suffix.lower() in KINDS


def _record_of(
    config: Columns,
    file: Path,
    rate: tuple[str, ...] = (),
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
) -> Record:
    if not config.time or not config.input:
        raise TwinError(
            f"{file}: name its columns: --time t --input u1,u2 --angle pot1,pot2"
            + (" --rate gyro1,gyro2" if isinstance(config, Identify) else "")
        )
    if config.commands is not None and config.input_stamps is not None:
        raise TwinError(f"--input-stamps {config.input_stamps}: --commands has stamps of its own")
    return to_record(
        tables.read(file),
        time=config.time,
        inputs=_names(config.input),
        rate=rate,
        angle=_names(config.angle),
        unit=config.unit or "rad",
        input_unit=config.input_unit,
        time_scale=config.time_scale,
        gyro_delay=gyro_delay,
        commands=None if config.commands is None else tables.read(config.commands),
        input_stamps=config.input_stamps or "shown",
        initial=initial,
        before=None if config.before is None else _numbers("--before", config.before),
    )


def _numbers(flag: str, text: str) -> list[float]:
    try:
        found = [float(n) for n in _names(text)]
    except ValueError:
        raise TwinError(f"{flag} {text}: numbers, separated by commas") from None
    if not found or not np.isfinite(found).all():
        raise TwinError(f"{flag} {text}: finite numbers, separated by commas")
    return found


def _dense(r: Record) -> Record:
    """The record with its commands at every sample too, as a recording of the twin has them."""
    within = (r.input_time > r.time[0]) & (r.input_time < r.time[-1])
    stamps = np.union1d(r.time, r.input_time[within])
    return replace(r, input_time=stamps, input=r.held_input(stamps))


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(n.strip() for n in (text or "").split(",") if n.strip())


def _only(r: Record, moved: list[str]) -> Record:
    """The axes that were commanded; of one that never was nothing can be learnt."""
    columns = [r.inputs.index(n) for n in moved]
    return replace(
        r,
        input=r.input[:, columns],
        angle=None if r.angle is None else r.angle[:, columns],
        rate=None if r.rate is None else r.rate[:, columns],
        inputs=tuple(r.inputs[k] for k in columns),
        outputs=tuple(r.outputs[k] for k in columns),
    )
