"""Read a recording: settings, events, signals as arrays, and all of them in one table.

    python docs/examples/read_recording.py [FOLDER] [RUN.rrd]

Without RUN.rrd a short flight is recorded first. Needs pandas (extra `notebook`) for the table.
"""

import sys
from pathlib import Path

import numpy as np

import twin


def main(folder, file=None):
    """Print what a recording holds, and write its table."""
    if file is None:
        file = twin.fly(programme="doublet", at_s=1.0, duration_s=6.0, out=folder / "run.rrd")
    run = twin.read(file)
    print("command", run.properties["command"], "with seed", run.properties["seed"])
    for event in run.events:
        print(f"{event.time:8.3f} s {event.level} {event.text}")
    for name, signal in run.series.items():
        hz = (len(signal.time) - 1) / np.ptp(signal.time)
        print(f"{name:26} {len(signal.time):6} rows at {hz:4.0f} Hz, {signal.unit}")
    command, angle = run["gimbal/command"], run["gimbal/simulated"]
    behind = np.degrees(command.values - angle.values)  # both in rad, at the same stamps
    print("gimbal behind its command:", np.sqrt((behind**2).mean(axis=0)).round(2), "° rms")
    velocity = run["vehicle/velocity"]
    speed = np.linalg.norm(velocity.values, axis=1)
    print(f"top speed {speed.max():.1f} m/s at {velocity.time[speed.argmax()]:.2f} s")
    table = run.frame(["gimbal/command", "gimbal/simulated", "vehicle/mass"])
    table.to_csv(folder / "run.csv")
    print(table.describe().loc[["min", "max"]].round(4).to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."), *sys.argv[2:3])
