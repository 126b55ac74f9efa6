"""Print the silhouette numerics of a vehicle: `python -m twin.physics.aerodynamics FILE.xml`."""

import argparse
from pathlib import Path

import mujoco

from twin.physics.aerodynamics.silhouette import NODES, strip_table


def main() -> None:
    """Compile the file, slice its geometry and print `<numeric>` elements to paste into it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicle", type=Path, help="MJCF file with a body 'vehicle'")
    parser.add_argument("--nodes", type=int, default=NODES, help="stations in all")
    options = parser.parse_args()
    try:
        model = mujoco.MjModel.from_xml_path(str(options.vehicle))
        z, area = strip_table(model, options.nodes)
    except ValueError as error:
        parser.error(f"{options.vehicle}: {' '.join(str(error).split())}")
    for name, values in (("air_strip_z", z), ("air_strip_area", area)):
        print(f'<numeric name="{name}" data="{" ".join(f"{v:.6g}" for v in values)}"/>')


if __name__ == "__main__":
    main()
