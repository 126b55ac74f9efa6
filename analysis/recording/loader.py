"""One way to read a measurement, whether the file is a recording or a table."""

from pathlib import Path

from analysis.recording import reader, tables
from analysis.recording.columns import Columns, measurement_of_table
from analysis.recording.exported import is_exported
from analysis.recording.measurements import (
    COMMAND,
    MEASURED,
    SIMULATED,
    Initial,
    Measurement,
    check_stamps,
)
from analysis.recording.series import Recording, RecordingError


def load(
    path: Path | str,
    columns: Columns | None = None,
    *,
    angle: str | None = None,
    rate: str | None = None,
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
) -> Measurement:
    """Read the commands and readings of one run.

    Parameters
    ----------
    path : a recording (.rrd), or a table (.csv, .txt, .log, .jsonl, .mat and others) with `columns`
    angle, rate, gyro_delay, initial : as for `measurement_of`; a table names its signals in
        `columns`

    Raises
    ------
    AnalysisError : files that cannot be read, unknown names, and what no `Measurement` may hold
    """
    path = Path(path)
    if not is_table(path):
        return measurement_of(
            reader.read(path), str(path), angle=angle, rate=rate, gyro_delay=gyro_delay,
            initial=initial,
        )  # fmt: skip
    if columns is None:
        raise RecordingError(f"{path}: a table; say which columns hold what (columns=Columns(...))")
    return measurement_of_table(
        tables.read(path), columns, gyro_delay=gyro_delay, initial=initial, name=str(path)
    )


def is_table(path: Path) -> bool:
    """Whether a file is a table whose columns must be named; any other is taken for a recording.

    Tables that `twin export` wrote are recordings.
    """
    return path.suffix.lower() in tables.KINDS and not is_exported(path)


def measurement_of(
    recording: Recording,
    name: str = "recording",
    *,
    angle: str | None = None,
    rate: str | None = None,
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
) -> Measurement:
    """Take command, angle and rate of the gimbal's axes from a recording.

    Parameters
    ----------
    angle : signal; without it and without `rate` the measured angle, or the simulated one where
        nothing was measured
    rate : signal, for example `sensors/gyro`
    gyro_delay : delay of the gyro's own filter [s]; taken out of the rate

    Raises
    ------
    RecordingError : signals that were not recorded, and what no `Measurement` may hold
    """
    if angle is None and rate is None:
        angle = MEASURED if MEASURED in recording.series else SIMULATED
    for signal in (COMMAND, angle, rate):
        if signal is not None and signal not in recording.series:
            held = ", ".join(recording.series) or "nothing"
            raise RecordingError(f"{name} has no {signal}; it holds {held}")
    command = recording[COMMAND].known()
    angles, rates = (
        None if s is None else recording[s].select(command.components).known()
        for s in (angle, rate)
    )
    if rates is not None and gyro_delay:
        rates = rates.shifted(-gyro_delay)
    for series in (angles, rates):
        if series is not None:
            check_stamps(series.time, series.name, name, 3)
    return Measurement(command, angles, rates, initial, name=name, recording=recording)
