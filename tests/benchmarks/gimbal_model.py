"""Flights with the emulated rig beside flights with a model of it, whole and under power (15 s).

python -m tests.benchmarks.gimbal_model [transfer-function | linkage]
prints the tables of docs/hil.md: the shipped identified model, and the linkage.
"""

import sys
import tempfile
from pathlib import Path

from tests.twin.plant.test_reference_gimbal import apart, flights

SECONDS = 15.0
PROGRAMMES = {
    "hold": {},
    "step": {},
    "doublet": {},
    "pitch-over": {},
    "point --off-axis-deg 15 15": {"off_axis_deg": (15.0, 15.0)},
}
HEAD = "| programme | attitude, rms | worst | path, largest distance | of the distance flown |"


def row(model: str, name: str) -> str:
    """Line of the table: one programme flown by the rig and by a model."""
    programme = name.split()[0]
    with tempfile.TemporaryDirectory() as folder:
        runs = flights(Path(folder), programme, SECONDS, ("emulator", model), **PROGRAMMES[name])
        angle, worst, distance, flown = apart(runs, SECONDS)
    share = 100 * distance / flown
    return f"| `{name}` | {angle:.2f}° | {worst:.2f}° | {distance:.1f} m | {share:.2f} % |"


if __name__ == "__main__":
    for gimbal in sys.argv[1:] or ("transfer-function", "linkage"):
        print(gimbal, HEAD, "|---|---|---|---|---|", sep="\n")
        for name in PROGRAMMES:
            print(row(gimbal, name), flush=True)
