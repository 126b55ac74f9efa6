"""Flights with the emulated rig beside flights with a model of it.

`python -m tests.benchmarks.gimbal_model` prints the tables of docs/hil.md: the shipped identified
model, and the linkage. Whole flights under power, 15 s.
"""

import tempfile
from pathlib import Path

from tests.twin.test_reference_gimbal import apart, flights

SECONDS = 15.0
PROGRAMMES = {"hold": "hold", "step": "step of 5°", "doublet": "doublet of 5°"}


def table(model: str) -> list[str]:
    """Lines of the table of one model against the rig."""
    lines = [
        "| programme | nose, rms | path, largest distance | relative to the path length |",
        "|---|---|---|---|",
    ]
    for programme, title in PROGRAMMES.items():
        with tempfile.TemporaryDirectory() as folder:
            runs = flights(Path(folder), programme, SECONDS, ("emulator", model))
            angle, distance, flown = apart(runs, SECONDS)
        share = 100 * distance / flown
        lines.append(f"| {title} | {angle:.2f}° | {distance:.1f} m | {share:.2f} % |")
    return lines


if __name__ == "__main__":
    for gimbal in ("transfer-function", "linkage"):
        print(gimbal, *table(gimbal), sep="\n", flush=True)
