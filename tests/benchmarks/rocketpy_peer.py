"""Described flights in RocketPy: what they reach, or the processor time of one of them.

    PYTHON -P tests/benchmarks/rocketpy_peer.py FLIGHTS          (Valetudo, so often, to the ground)
    PYTHON -P tests/benchmarks/rocketpy_peer.py NAME:WIND ...    (wind at 10 m, m/s to the east)

PYTHON has RocketPy; nothing else of this project is imported. Reads the description, thrust curve,
drag and air of mjcf/examples/flights, as the twin does; prints one JSON object.
"""

import csv
import json
import math
import sys
import time
import tomllib
from importlib.metadata import version
from pathlib import Path

from rocketpy import Environment, Flight, GenericMotor, Rocket

FOLDER = Path(__file__).resolve().parents[2] / "mjcf" / "examples" / "flights"
# s, longest step of the converged flight; the solver gives up at a relative tolerance of 1e-8
FINEST = 0.01
KINDS = {"ogive": "ogive", "haack": "vonkarman"}


def main() -> None:
    """Fly Valetudo as often as asked, or every flight that is named."""
    if sys.argv[1].isdigit():
        print(json.dumps(_timed(int(sys.argv[1]))))
        return
    reached = {}
    for name, wind in (text.split(":") for text in sys.argv[1:]):
        design = _design(name)
        air = _air(design, float(wind))
        flight = _fly(_rocket(design), air, design, terminate_on_apogee=True)
        reached[name] = flight.apogee - air.elevation, flight.apogee_time
    print(json.dumps({"version": version("rocketpy"), "reached": reached}))


def _timed(flights: int) -> dict:
    """Figures of so many flights, and of one with short steps."""
    design = _design("valetudo")
    built = time.process_time()
    rocket, air = _rocket(design), Environment(elevation=design["launch"]["altitude"])
    built = time.process_time() - built
    _fly(rocket, air, design)  # what is computed once for all flights
    spent, flight = [], None
    for _ in range(flights):
        began = time.process_time()
        flight = _fly(rocket, air, design)
        spent.append(time.process_time() - began)
    converged = _fly(rocket, air, design, max_time_step=FINEST)
    return {
        "version": version("rocketpy"),
        "flight_s": built + min(spent),
        "flown": _reached(flight, air),
        "converged": _reached(converged, air),
    }


def _reached(flight: Flight, air: Environment) -> tuple[float, float, float]:
    """Apogee above the rail's foot, level distance at the ground [m]; time of the apogee [s]."""
    level = (flight.x_impact**2 + flight.y_impact**2) ** 0.5
    return flight.apogee - air.elevation, level, flight.apogee_time


def _design(name: str) -> dict:
    return tomllib.loads(FOLDER.joinpath(f"{name}.toml").read_text())


def _air(design: dict, wind: float) -> Environment:
    """Air of the description's profile, or the standard one with a power law of the wind."""
    launch = design["launch"]
    air = Environment(elevation=launch["altitude"])
    if "profile" in launch:
        rows = _rows(launch["profile"])
        height = [row[0] + air.elevation for row in rows]
        east, north = (
            [(h, -row[1] * f(math.radians(row[2]))) for h, row in zip(height, rows, strict=True)]
            for f in (math.sin, math.cos)
        )
        kelvin = [(h, row[3] + 273.15) for h, row in zip(height, rows, strict=True)]
        air.set_atmospheric_model(
            "custom_atmosphere", wind_u=east, wind_v=north, temperature=kelvin
        )
    elif wind:
        law = [(h + air.elevation, wind * (h / 10.0) ** (1 / 7)) for h in range(0, 4000, 5)]
        air.set_atmospheric_model("custom_atmosphere", wind_u=law, wind_v=0.0)
    return air


def _fly(rocket: Rocket, air: Environment, design: dict, **options: float) -> Flight:
    launch = design["launch"]
    elevation, azimuth = (float(launch[k].rstrip("°")) for k in ("elevation", "azimuth"))
    return Flight(
        rocket, air, rail_length=launch["rail"], inclination=elevation, heading=90.0 - azimuth,
        **options,
    )  # fmt: skip


def _rocket(design: dict) -> Rocket:
    """Stations are those of the description: from the tip of the nose."""
    nose, *parts = design["body"]
    fins, masses = design["fins"][0], design["masses"]
    mass = sum(m["mass"] for m in masses)
    centre = sum(m["mass"] * m["position"] for m in masses) / mass
    radius, lump = _metres(nose["diameter"]) / 2, masses[0]["diameter"] / 2
    across = sum(m["mass"] * (m["position"] - centre) ** 2 for m in masses)
    if length := masses[0].get("length"):
        across += mass * (length**2 / 12 + lump**2 / 4)
    drag = [design.get("drag")] * 2 if "drag" in design else _drag(design["drag_table"])
    rocket = Rocket(
        radius=radius, mass=mass, inertia=(across, across, 0.5 * mass * lump**2),
        power_off_drag=drag[0], power_on_drag=drag[1], center_of_mass_without_motor=centre,
        coordinate_system_orientation="nose_to_tail",
    )  # fmt: skip
    end, width = _metres(nose["length"]), 2 * radius
    rocket.add_nose(length=end, kind=KINDS[nose["shape"]], position=0.0)
    for part in parts:
        if part["part"] == "transition":
            before, width = width, _metres(part["diameter"])
            rocket.add_tail(
                top_radius=before / 2, bottom_radius=width / 2, length=_metres(part["length"]),
                position=end,
            )  # fmt: skip
        end += _metres(part["length"])
    rocket.add_trapezoidal_fins(
        n=fins["count"], root_chord=fins["root"], tip_chord=fins["tip"], span=fins["span"],
        sweep_length=fins["sweep"], position=fins["position"], radius=width / 2,
    )  # fmt: skip
    rocket.add_motor(_motor(design["motor"]["file"]), position=end)
    rocket.set_rail_buttons(*design["rail_buttons"])
    return rocket


def _motor(file: str) -> GenericMotor:
    lines = FOLDER.joinpath(file).read_text().splitlines()
    head, *points = [line.split() for line in lines if line and not line.startswith(";")]
    diameter, length, propellant, loaded = (float(head[k]) for k in (1, 2, 4, 5))
    curve = [[0.0, 0.0], *([float(t), float(f)] for t, f in points)]
    return GenericMotor(
        thrust_source=curve, burn_time=curve[-1][0], chamber_radius=diameter / 2000,
        chamber_height=length / 1000, chamber_position=length / 2000, dry_mass=loaded - propellant,
        center_of_dry_mass_position=length / 2000, propellant_initial_mass=propellant,
        nozzle_radius=diameter / 2000,
    )  # fmt: skip


def _drag(file: str) -> list[list[list[float]]]:
    """Tables with the motor off and on; the same where the file has one."""
    rows = _rows(file)
    return [[[row[0], row[min(k, len(row) - 1)]] for row in rows] for k in (1, 2)]


def _rows(file: str) -> list[list[float]]:
    with FOLDER.joinpath(file).open() as table:
        return [[float(value) for value in row] for row in list(csv.reader(table))[1:]]


def _metres(text: str) -> float:
    return float(text.removesuffix(" m"))


if __name__ == "__main__":
    main()
