"""Own vehicle: a copy of the shipped one with another payload and ramp, and an own motor.

    python docs/examples/own_vehicle.py [FOLDER]

docs/vehicles.md lists the names that a vehicle has to carry.
"""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import mjcf
import twin

SHIPPED = Path(mjcf.__file__).parent

# RASP format: name, diameter [mm], length [mm], delays, propellant and loaded mass [kg], maker;
# then time [s] and thrust [N], to a last point of zero thrust
MOTOR = """; 180 N s over 10 s
Own180 29 213.4 P 0.105 0.195 own
  0.1 30
  0.6 22
  5.0 18
  9.8 15
 10.0 0
"""


def write_vehicle(folder):
    """Write `vehicle.xml` and its airframe; the gimbal is the shipped one."""
    tree = ET.parse(SHIPPED / "parts" / "airframe.xml")
    tree.find(".//geom[@name='payload']").set("mass", "0.30")  # kg
    tree.find(".//numeric[@name='ramp_elevation']").set("data", "1.0472")  # rad
    tree.write(folder / "airframe.xml")
    vehicle = folder / "vehicle.xml"
    vehicle.write_text(
        f"""<mujoco model="own_vehicle">
  <asset><model name="mechanism" file="{(SHIPPED / "mechanism.xml").as_posix()}"/></asset>
  <include file="airframe.xml"/>
</mujoco>
"""
    )
    return vehicle


def main(folder):
    """Fly the shipped and the own vehicle."""
    vehicle, motor = write_vehicle(folder), folder / "own.eng"
    motor.write_text(MOTOR)
    for name, own in (("shipped", {}), ("own", {"vehicle": vehicle, "motor": motor})):
        flight = twin.fly(
            gimbal="transfer-function", programme="pitch-over", amplitude_deg=10.0, duration_s=20.0,
            out=folder / f"{name}.rrd", **own,
        )  # fmt: skip
        print(
            f"{name:8} {flight.mass_kg:.2f} kg, {flight.max_speed_m_s:5.1f} m/s,"
            f" burnout {flight.powered_slant_range_m:.0f} m away,"
            f" attitude error {flight.attitude_error_rms_deg:.2f}° rms"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
