"""What `twin identify` is given, as records: the twin's recordings, and anybody's tables."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.identify import Record, from_recording
from twin.configuration import Identify
from twin.errors import TwinError

# Of a table only; a recording knows its own.
_OF_TABLES = ("time", "input", "unit", "input_unit", "time_scale", "commands")
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
    from analysis import recording
    from analysis.caveats import caveats

    for flag in _OF_TABLES:
        if getattr(config, flag) is not None:
            raise TwinError(
                f"--{flag.replace('_', '-')} is about tables; the recording {file} knows its own"
            )
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
    from analysis import tables

    if config.from_pulses:
        raise TwinError(f"--from-pulses is about recordings of a rig; {file} is a table")
    if not config.time or not config.input:
        raise TwinError(
            f"{file}: name its columns: --time t --input u1,u2 --angle pot1,pot2 --rate gyro1,gyro2"
        )
    found = tables.to_record(
        tables.read(file),
        time=config.time,
        inputs=_names(config.input),
        rate=_names(config.rate),
        angle=_names(config.angle),
        unit=config.unit or "rad",
        input_unit=config.input_unit,
        time_scale=config.time_scale or 1.0,
        gyro_delay=1e-3 * config.gyro_delay_ms,
        commands=None if config.commands is None else tables.read(config.commands),
        initial=config.initial,
    )
    return replace(found, name=str(file))


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
