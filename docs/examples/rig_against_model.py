"""Rig against model: the same test signal on a rig and on the identified model, and a report.

    python docs/examples/rig_against_model.py [FOLDER] [PORT]

PORT is that of a gimbal on the bench, such as /dev/ttyUSB0 or COM3; a simulated one if omitted.
"""

import sys
from pathlib import Path

import twin


def main(folder, port="emulator"):
    """Step both, compare them, and write one page about both."""
    signal = {"signal": "multisine", "amplitude_deg": 5.0, "band_hz": (0.5, 10.0), "repeats": 1}
    rig = twin.step(gimbal=port, out=folder / "rig.rrd", **signal)
    model = twin.step(gimbal="transfer-function", out=folder / "model.rrd", **signal)
    compared = twin.compare(rig, model, out=folder / "compared.rrd")
    for axis in compared.comparison.axes:
        print(f"{axis.axis}: fit {axis.aligned.fit:.1f} %, delay {1e3 * axis.delay:.1f} ms")
    page = twin.report(rig, model, out=folder / "report.html")
    print(f"report: {page.file}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."), *sys.argv[2:3])
