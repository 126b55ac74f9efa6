"""A real servo's commands on the linkage, and on its identified model.

python -m tests.benchmarks.real_servo FOLDER

FOLDER: `servo_sysid_miuzei` (mauicv/servo-sysid, BSD-3-Clause), which is not in this repository.
Linkage and model are fitted to the ten steps; square, triangle, PRBS and chirp are held out.
"""

import csv
import json
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from twin.config import Compare, Identify
from twin.evaluation.compare import compare
from twin.evaluation.identify import identify

FILE = "real-action-state-dataset.json"
PERIOD = 0.02  # s
SCALE = 180.0 / 15.0  # half-turns of the servo to degrees of the gimbal; its 112° are 7.5° then
BEFORE, RETURN = 5, 25  # rows: at rest before a run, and unread while the gimbal goes back
STEP = 30  # rows of a step that are fitted: it has settled by then
START = {"gimbal_servo_slew": 0.8, "gimbal_backlash": 0.002, "gimbal_servo_dead_band": 0.001}
FITTED = (*START, "gimbal_servo_gain", "delay")
HELD_OUT = ("square", "triangle", "prbs", "chirp")
COLUMNS = {"time": "t", "input": "ux,uy", "angle": "x,y", "angle_unit": "deg", "before": "0,0"}

Run = tuple[np.ndarray, np.ndarray]


def runs(folder: Path) -> dict[str, list[Run]]:
    """Commands and angles (n,) of all runs by kind of signal [° of the gimbal]."""
    found: dict[str, list[Run]] = {}
    for run in json.loads((folder / FILE).read_text(encoding="utf-8"))["data"]:
        pair = tuple(SCALE * np.array(run[name]) for name in ("actions", "sensor_data"))
        found.setdefault(run["type"], []).append((pair[0], pair[1]))
    return found


def rows(given: Sequence[Run]) -> Iterator[list[float | str]]:
    """Rows of a table with the first half of the runs on x, beside the other on y."""
    half = (len(given) + 1) // 2
    second = [*given[half:], *given[: len(given) % 2]]  # of an odd number one is on both axes
    count = 0
    for one, other in zip(given[:half], reversed(second), strict=True):
        length = len(one[0])
        commands = np.zeros((BEFORE + length + RETURN, 2))
        angles = np.zeros_like(commands)
        for k, (command, angle) in enumerate((one, other)):
            commands[BEFORE : BEFORE + length, k] = command
            angles[BEFORE : BEFORE + length, k] = angle
        for row, (u, y) in enumerate(zip(commands.tolist(), angles.tolist(), strict=True)):
            read = y if row < BEFORE + length else ["", ""]
            yield [PERIOD * count, *u, *read]
            count += 1


def write(file: Path, table: Iterable[Iterable[float | str]]) -> Path:
    """Write a table as CSV."""
    with file.open("w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows([("t", "ux", "uy", "x", "y"), *table])
    return file


def fits(file: Path, model: str, **linkage: object) -> tuple[float, float]:
    """Fit of a simulation to a table, mean of both axes: as it is, and without its delay [%]."""
    out = file.with_suffix(".rrd")
    found = compare(Compare((file,), with_=model, out=out, force=True, **COLUMNS, **linkage))
    axes = found.comparison.axes
    return (float(np.mean([a.as_is.fit for a in axes])),
            float(np.mean([a.aligned.fit for a in axes])))  # fmt: skip


def main(folder: Path) -> None:
    """Print the parameters found, then a line for each kind of motion."""
    given = runs(folder)
    given["step"] = [(u[:STEP], y[:STEP]) for u, y in given["step"]]
    with tempfile.TemporaryDirectory() as place:
        where = Path(place)
        files = {k: write(where / f"{k}.csv", rows(v)) for k, v in given.items()}
        steps, model, linkage = files["step"], where / "model.json", where / "set.json"
        identify(Identify((steps,), servo=True, out=model, **COLUMNS))
        start = tuple(f"{name}={value}" for name, value in START.items())
        found = identify(
            Identify((steps,), linkage=True, set=start, parameters=FITTED, out=linkage, **COLUMNS)
        )
        for label, text in found.rows():
            print(f"{label:<24}{text}", flush=True)
        print(f"{'fit':<12}{'linkage':>20}{'model':>20}   as it is, without the delay [%]")
        for kind in HELD_OUT:
            both = (
                *fits(files[kind], "linkage", set_from=linkage),
                *fits(files[kind], str(model)),
            )
            print(f"{kind:<12}{both[0]:>12.1f}{both[1]:>8.1f}{both[2]:>12.1f}{both[3]:>8.1f}",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]))
