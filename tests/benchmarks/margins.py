"""Static margin over the angle of attack: the table of docs/aerodynamics.md.

`python -m tests.benchmarks.margins` prints it for the reference vehicle.
"""

from importlib.resources import files

import mujoco
import numpy as np

from twin.physics.aerodynamics.stability import Stability

ANGLES = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0)  # degrees


def table(model: mujoco.MjModel, end: float) -> str:
    """Markdown: centre of pressure and moments over the angle of attack, before and after burn."""
    head = "| angle of attack | centre of pressure | margin, loaded | margin, empty |"
    head += " M / q [cm³]: crossflow | Barrowman | sum, loaded | sum, empty |"
    lines = [head, "|" + "---|" * 8]
    full = Stability(model)
    rows = [(full.centre_of_pressure(a), full.station, full.moment(a)) for a in _radians()]
    empty = full.at(end)
    for degrees, (centre, station, (cross, linear)) in zip(ANGLES, rows, strict=True):
        a = np.radians(degrees)
        margins = [(s - centre) / full.diameter for s in (station, empty.station)]
        values = (cross * 1e6, linear * 1e6, (cross + linear) * 1e6, sum(empty.moment(a)) * 1e6)
        lines.append(
            f"| {degrees:g}° | {centre:.3f} m | {margins[0]:+.2f} | {margins[1]:+.2f} | "
            + " | ".join(f"{v:+.1f}" for v in values)
            + " |"
        )
    full.at(0.0)
    return "\n".join(lines)


def _radians() -> list[float]:
    return [float(a) for a in np.radians(ANGLES)]


def main() -> None:
    """Print the table."""
    model = mujoco.MjModel.from_xml_path(str(files("mjcf") / "vehicle.xml"))
    print(table(model, float(model.numeric("motor_time").data.max())))


if __name__ == "__main__":
    main()
