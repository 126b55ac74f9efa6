"""A model under the commands of one file: the other motion of `twin compare --with`."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.recording import Measurement, TimeSeries
from analysis.recording.loader import is_table
from twin.config import Compare
from twin.config.seats import OF_SERVOS
from twin.errors import TwinError
from twin.evaluation.inputs import seen
from twin.hil.connect import RigOptions, calibration_of
from twin.hil.history import Source, gimbal_angles
from twin.plant.authority import stops
from twin.plant.compiled import compiled
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

SETTLE_STEPS = 500  # of 1 ms: the model rests at the first command before the record begins
LONGEST = 3600.0  # s


@dataclass(frozen=True)
class Beside:
    """A measured run, and a model under its commands.

    Attributes
    ----------
    run : commands and angles, both of the gimbal
    simulated : angles of the model every millisecond, from the first stamp to the last
    """

    run: Measurement
    simulated: TimeSeries


def beside(config: Compare) -> Beside:
    """Simulate a gimbal with the commands of a file, which act at their stamps.

    Raises
    ------
    TwinError, AnalysisError : a file, model or unit that cannot be used, commands outside the stops
    """
    assert config.with_ is not None
    run = _in_gimbal_angles(config, config.recordings[0])
    begin, end = float(run.command.time[0]), float(run.time[-1])
    if not 0.0 < end - begin <= LONGEST:
        raise TwinError(f"{run.name}: {end - begin:.0f} s from the first command to the last angle")
    # converted already; of radians, given or assumed, a refusal asks whether they are degrees
    unit = "rad" if (config.input_unit or config.angle_unit or "rad") == "rad" else "deg"
    with compiled():
        plant = _plant(config, config.with_)
        ends = stops(plant.twin.mj)
        source = Source(config.recordings[0], unit=unit, ratio=config.ratio, flag=_flag(config))
        angles = gimbal_angles(source, run.command, None, "both", ends)
        period = plant.dt_ns * 1e-9
        steps = int((end - begin) / period) + 2
        time = np.asarray(begin + period * np.arange(steps), np.float64)
        row = np.searchsorted(run.command.time, time + 1e-9, side="right") - 1
        values = np.empty((len(time), 2))
        plant.drive((float(angles[0, 0]), float(angles[0, 1])))
        plant.advance(SETTLE_STEPS)
        for k, at in enumerate(row.tolist()):
            values[k] = plant.gimbal_angle
            plant.drive((float(angles[at, 0]), float(angles[at, 1])))
            plant.advance(1)
    name = f"{config.with_} (simulated)"
    both = TimeSeries(name, time, values, "rad", ("x", "y"))
    return Beside(run, both.select(run.outputs))


def _flag(config: Compare) -> str:
    """The flag that the unit of the commands is given by."""
    return "--angle-unit" if config.input_unit is None else "--input-unit"


def _in_gimbal_angles(config: Compare, file: Path) -> Measurement:
    """The run with its commands and angles as gimbal angles."""
    pulses = is_table(file) and config.input_unit in ("us", "percent")
    run = seen(replace(config, input_unit="1") if pulses else config, (file,))[0]
    if not run.axes:
        raise TwinError(f"{file}: has no axis with commands and measured angles")
    command, ratio = run.command, config.ratio or 1.0
    if config.ratio is not None and not is_table(file):
        raise TwinError(f"--ratio is only for tables; {file} is a recording")
    if pulses:
        source = Source(file, unit=str(config.input_unit))
        given = replace(command, values=source.scaled(command.values))
        map_ = calibration_of(RigOptions("linkage", mechanism=config.mechanism))
        both = gimbal_angles(source, given, map_, "both", None)
        columns = ["xy".index(n) for n in command.components]
        command = replace(command, values=both[:, columns])
    else:
        command = replace(command, values=command.values * ratio)
    angles = replace(run.angles, values=run.angles.values * ratio)
    return replace(run, command=command, angle=angles)


def _plant(config: Compare, model: str) -> Plant:
    linkage = model == "linkage"
    for name in () if linkage else config.overrides:
        if name.startswith(OF_SERVOS):
            raise TwinError(f"--set {name} needs --with linkage: an identified model has no servos")
    return Plant(
        load(
            ModelConfig(
                scene="bench",
                gimbal="linkage" if linkage else "transfer-function",
                transfer_function=None if linkage else Path(model),
                mechanism=config.mechanism,
                overrides=config.overrides,
            )
        )
    )
