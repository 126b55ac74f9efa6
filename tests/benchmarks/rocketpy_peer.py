"""Valetudo in RocketPy: processor time of its flights to the ground, and what they reach.

    PYTHON -P tests/benchmarks/rocketpy_peer.py FLIGHTS

PYTHON has RocketPy; nothing else of this project is imported. Reads the description, thrust curve
and drag of mjcf/examples/flights, as the twin does; prints one JSON object.
"""

import csv
import json
import sys
import time
import tomllib
from importlib.metadata import version
from pathlib import Path

from rocketpy import Environment, Flight, GenericMotor, Rocket

FOLDER = Path(__file__).resolve().parents[2] / "mjcf" / "examples" / "flights"
# s, longest step of the converged flight; the solver gives up at a relative tolerance of 1e-8
FINEST = 0.01


def main() -> None:
    """Fly as often as asked, then once with short steps."""
    design = tomllib.loads(FOLDER.joinpath("valetudo.toml").read_text())
    built = time.process_time()
    rocket, air = _rocket(design), Environment(elevation=design["launch"]["altitude"])
    built = time.process_time() - built
    _fly(rocket, air, design)  # what is computed once for all flights
    spent, flight = [], None
    for _ in range(int(sys.argv[1])):
        began = time.process_time()
        flight = _fly(rocket, air, design)
        spent.append(time.process_time() - began)
    converged = _fly(rocket, air, design, max_time_step=FINEST)
    figures = {
        "version": version("rocketpy"),
        "flight_s": built + min(spent),
        "flown": _reached(flight, air),
        "converged": _reached(converged, air),
    }
    print(json.dumps(figures))


def _reached(flight: Flight, air: Environment) -> tuple[float, float, float]:
    """Apogee above the rail's foot, level distance at the ground [m]; time of the apogee [s]."""
    level = (flight.x_impact**2 + flight.y_impact**2) ** 0.5
    return flight.apogee - air.elevation, level, flight.apogee_time


def _fly(rocket: Rocket, air: Environment, design: dict, **options: float) -> Flight:
    launch = design["launch"]
    elevation, azimuth = (float(launch[k].rstrip("°")) for k in ("elevation", "azimuth"))
    return Flight(
        rocket, air, rail_length=launch["rail"], inclination=elevation, heading=90.0 - azimuth,
        **options,
    )  # fmt: skip


def _rocket(design: dict) -> Rocket:
    """Stations are those of the description: from the tip of the nose."""
    nose, tube = design["body"]
    fins, halves = design["fins"][0], design["masses"]
    mass = sum(half["mass"] for half in halves)
    centre = sum(half["mass"] * half["position"] for half in halves) / mass
    across = sum(half["mass"] * (half["position"] - centre) ** 2 for half in halves)
    radius, lump = _metres(nose["diameter"]) / 2, halves[0]["diameter"] / 2
    off, on = (_drag(column) for column in (1, 2))
    rocket = Rocket(
        radius=radius, mass=mass, inertia=(across, across, 0.5 * mass * lump**2),
        power_off_drag=off, power_on_drag=on, center_of_mass_without_motor=centre,
        coordinate_system_orientation="nose_to_tail",
    )  # fmt: skip
    rocket.add_nose(length=_metres(nose["length"]), kind="ogive", position=0.0)
    rocket.add_trapezoidal_fins(
        n=fins["count"], root_chord=fins["root"], tip_chord=fins["tip"], span=fins["span"],
        sweep_length=fins["sweep"], position=fins["position"],
    )  # fmt: skip
    rocket.add_motor(_motor(), position=_metres(nose["length"]) + _metres(tube["length"]))
    rocket.set_rail_buttons(*design["rail_buttons"])
    return rocket


def _motor() -> GenericMotor:
    lines = FOLDER.joinpath("valetudo.eng").read_text().splitlines()
    head, *points = [line.split() for line in lines if line and not line.startswith(";")]
    diameter, length, propellant, loaded = (float(head[k]) for k in (1, 2, 4, 5))
    curve = [[0.0, 0.0], *([float(t), float(f)] for t, f in points)]
    return GenericMotor(
        thrust_source=curve, burn_time=curve[-1][0], chamber_radius=diameter / 2000,
        chamber_height=length / 1000, chamber_position=length / 2000, dry_mass=loaded - propellant,
        center_of_dry_mass_position=length / 2000, propellant_initial_mass=propellant,
        nozzle_radius=diameter / 2000,
    )  # fmt: skip


def _drag(column: int) -> list[list[float]]:
    with FOLDER.joinpath("valetudo_drag.csv").open() as file:
        rows = list(csv.reader(file))[1:]
    return [[float(row[0]), float(row[column])] for row in rows]


def _metres(text: str) -> float:
    return float(text.removesuffix(" m"))


if __name__ == "__main__":
    main()
