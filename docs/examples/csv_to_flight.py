"""Own measurement to model to flight: a CSV of a gimbal's steps, identified and flown.

    python docs/examples/csv_to_flight.py [FOLDER]

The CSV is made here from a simulated rig, as a data logger would write it: one row a sample, the
command in force and the measured angles in degrees. Its commands were given at any time since the
sample before, hence `input_stamps="sampled"`.
"""

import sys
from pathlib import Path

import numpy as np

import twin


def log(file):
    """Write `t, u_x, u_y, x, y` of a step test."""
    recording = file.with_suffix(".rrd")
    run = twin.read(twin.step(gimbal="emulator", repeats=1, hold_s=0.5, out=recording))
    measured = run["gimbal/measured"]
    command = run["gimbal/command"].held(measured.time)
    table = np.column_stack([measured.time, np.degrees(command), np.degrees(measured.values)])
    np.savetxt(file, table, "%.6f", delimiter=",", header="t,u_x,u_y,x,y", comments="")


def main(folder):
    """Identify a model of the measured gimbal, and fly with it and with the shipped one."""
    csv = folder / "measured.csv"
    log(csv)
    identified = twin.identify(
        csv, time="t", input="u_x,u_y", angle="x,y", angle_unit="deg", input_stamps="sampled",
        out=folder / "model.json",
    )  # fmt: skip
    for e in identified.model.estimates:
        print(f"{e.name:22} {e.value:8.4g} ± {1.96 * e.std:.2g} {e.unit}")
    ends = []
    for name, model in (("own model", identified), ("shipped model", None)):
        flight = twin.fly(
            gimbal="transfer-function", model=model, programme="step", duration_s=5.0,
            out=folder / f"{name.replace(' ', '_')}.rrd",
        )  # fmt: skip
        ends.append(twin.read(flight)["vehicle/position"].values[-1])
        print(f"{name:14} attitude error {flight.attitude_error_rms_deg:.2f}° rms")
    print(f"after 5 s the paths are {np.linalg.norm(ends[0] - ends[1]):.2f} m apart")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
