"""A vehicle's numerics with their sources, as the compiled forces read them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from twin.physics.motor.apply import REPLACES, numerics_of
from twin.physics.motor.grain import Grain
from twin.physics.native.names import ALL
from twin.physics.vehicle.barrowman import Term
from twin.physics.vehicle.built import Vehicle
from twin.physics.vehicle.design import Chute

CURVE: Final = 64  # points of a thrust curve
INDEX: Final = 128  # entries of native_index, with room for more
OFF, APOGEE = -1.0, 1e6  # delay or height of a parachute that does not open by it; any height [m]
CLEARANCE: Final = 0.2  # m between the lowest part and the ground
_UNIT: Final = {numeric.name: numeric.unit for numeric in ALL}


@dataclass(frozen=True)
class Coefficient:
    """One numeric: its values and where they come from."""

    name: str
    values: tuple[float, ...]
    source: str

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return _UNIT.get(self.name, "")


def coefficients(vehicle: Vehicle) -> tuple[Coefficient, ...]:
    """All numerics of a vehicle, in the order in which they are written."""
    groups = (
        _air(vehicle),
        _drag(vehicle),
        _wind(vehicle),
        _ramp(vehicle),
        _motor(vehicle),
        _chutes(vehicle),
    )
    return tuple(Coefficient(n, _floats(v), s) for group in groups for n, v, s in group)


Row = tuple[str, object, str]


def _floats(values: object) -> tuple[float, ...]:
    return tuple(float(v) for v in np.atleast_1d(np.asarray(values, dtype=float)))


def _air(vehicle: Vehicle) -> list[Row]:
    design, origin = vehicle.design, vehicle.origin
    z, area = vehicle.strips
    damping, forcing = vehicle.roll
    axial, drag = design.drag, "given"
    if axial is None:
        axial, text = vehicle.drag.total, vehicle.drag.text
        drag = f"Mach 0.3, motor off: {text} (OpenRocket TD 3.4)"
    crossflow = "1.2 of a long cylinder (Hoerner 1965) times its slenderness (NASA TR R-474)"
    if design.crossflow_drag is not None:
        crossflow = "given"
    mean = float(area @ np.abs(z - (origin - _loaded_centre(vehicle))) / area.sum())
    return [
        ("air_enabled", 1, "1: air, 0: vacuum"),
        ("air_model", 0, "0: strip integral, 1: area moments of the thesis"),
        ("air_altitude", design.launch.altitude, "of the ground above mean sea level"),
        ("air_crossflow_drag", vehicle.crossflow, crossflow),
        ("air_strip_z", z, "stations of a Gauss-Legendre quadrature over the outline"),
        ("air_strip_area", area, "width, mean over the roll angle (Cauchy), times dz"),
        ("air_reference_area", vehicle.area, "largest cross-section of the body"),
        ("air_axial_drag", axial, drag),
        ("air_nose_slope", _slopes(vehicle.body_terms), _sources(vehicle.body_terms)),
        ("air_nose_z", _stations(vehicle.body_terms, origin), "centres of pressure of these"),
        ("air_fin_slope", _slopes(vehicle.fin_terms), _sources(vehicle.fin_terms)),
        ("air_fin_z", _stations(vehicle.fin_terms, origin), "centres of pressure of these"),
        ("air_roll_damping", damping, "lift slope of a fin times ∫ c y² dy (Barrowman 1967)"),
        ("air_roll_forcing", forcing, "the same with c y dy, times the cant of the fins"),
        ("air_pitch_damping", 0, "beyond what the local flow of each part gives"),
        ("air_thesis_radius", mean, "mean distance of the outline from the centre of mass"),
        ("air_thesis_offset", 0.1, "of the thesis; used by air_model 1 only"),
    ]


def _drag(vehicle: Vehicle) -> list[Row]:
    """Drag over the Mach number, where the design names a table."""
    table = vehicle.drag_table
    if table is None:
        return []
    source = f"{vehicle.design.drag_table}; takes the place of air_axial_drag"
    rows: list[Row] = [
        ("air_drag_mach", table.mach, source),
        ("air_drag_coasting", table.coasting, "motor off"),
    ]
    if table.thrusting is not None:
        rows.append(("air_drag_thrusting", table.thrusting, "motor on"))
    return rows


def _chutes(vehicle: Vehicle) -> list[Row]:
    chutes = vehicle.design.parachutes
    if not chutes:
        return []
    nose = vehicle.outline.segments[0].end
    at = [nose if c.position is None else c.position for c in chutes]
    heights = [_opens_below(c) for c in chutes]
    return [
        ("chute_drag_area", [c.drag * math.pi / 4 * c.diameter**2 for c in chutes], "flat circle"),
        ("chute_delay", [OFF if c.delay is None else c.delay for c in chutes], "after burnout"),
        ("chute_height", heights, f"on the way down; {APOGEE:g} is the apogee"),
        ("chute_z", [vehicle.origin - x for x in at], "where they pull"),
    ]


def _opens_below(chute: Chute) -> float:
    if chute.height is not None:
        return chute.height
    return APOGEE if chute.delay is None else OFF


def _slopes(terms: Iterable[Term]) -> list[float]:
    return [term.slope for term in terms] or [0.0]


def _stations(terms: Iterable[Term], origin: float) -> list[float]:
    return [origin - term.station for term in terms] or [0.0]


def _sources(terms: Iterable[Term]) -> str:
    return "; ".join(f"{t.name}: {t.source}" for t in terms) or "none"


def _loaded_centre(vehicle: Vehicle) -> float:
    """Station of the centre of mass with motor; a gimbal is counted at its pivot [m]."""
    motor, airframe = vehicle.motor, vehicle.airframe
    moment = airframe.mass * airframe.station
    moment += motor.loaded_mass * (vehicle.outline.nozzle - motor.length / 2)
    if vehicle.carrier is not None:
        moment += vehicle.carrier.mass * vehicle.origin
    return moment / vehicle.mass


def _wind(vehicle: Vehicle) -> list[Row]:
    rows: list[Row] = [
        ("wind_speed", 0, "at the reference height"),
        ("wind_azimuth", 0, "from east to north: where it blows to"),
        ("wind_exponent", 0.143, "1/7, open country (Counihan 1975); 0: constant"),
        ("wind_reference_height", 10, "standard of weather stations (WMO No. 8)"),
        ("wind_turbulence", 0, "gust rms over wind_speed"),
        ("wind_length", 150, "near 150 m height (MIL-F-8785C)"),
        ("wind_seed", 0, "whole number"),
        ("wind_modes", [0.0] * 112, "16 modes, written when the model is loaded"),
        ("wind_model", 0, "gusts: 0 von Karman, 1 Dryden"),
        ("gravity_radius", 0, "6356766: gravity falls with height; 0: uniform"),
    ]
    if vehicle.sounding is not None:
        source = f"{vehicle.design.launch.profile}; wind to east, north, density, temperature"
        rows.append(("air_profile", vehicle.sounding, source))
    return rows


def _ramp(vehicle: Vehicle) -> list[Row]:
    launch, (lower, upper) = vehicle.design.launch, vehicle.buttons
    return [
        ("ramp_position", [0, 0, foot_height(vehicle)], "where the lower rail button rests"),
        ("ramp_elevation", launch.elevation, f"{math.degrees(launch.elevation):.6g} degrees"),
        ("ramp_azimuth", launch.azimuth, "from east to north"),
        ("ramp_length", launch.rail, "0: no rail"),
        ("ramp_lug", [vehicle.origin - lower, vehicle.origin - upper], "lower and upper button"),
        ("ramp_stiffness", launch.stiffness, "of the rail at each button; 0: rigid"),
        ("ramp_damping", launch.damping, "of an elastic rail"),
    ]


def foot_height(vehicle: Vehicle) -> float:
    """Height of the rail's foot above the ground, so that the tail stays clear of it [m]."""
    launch = vehicle.design.launch
    if launch.height is not None:
        return launch.height
    behind = max(vehicle.outline.end - vehicle.buttons[0], 0.0)
    span = max((placed.plan.span for placed in vehicle.outline.fins), default=0.0)
    aside = vehicle.outline.largest_radius + span
    return CLEARANCE + behind * math.sin(launch.elevation) + aside * math.cos(launch.elevation)


def _motor(vehicle: Vehicle) -> list[Row]:
    motor, mount = vehicle.motor, vehicle.design.motor
    grain = Grain.of(motor, mount.burn)
    values = numerics_of(motor, grain, CURVE)
    bore = motor.diameter if mount.diameter is None else mount.diameter
    source = {
        "motor_time": f"motor {motor.name}",
        "motor_thrust": "unused points repeat the end",
        "motor_impulse": "of the points above",
        "motor_grain_length": "propellant of 1700 kg/m3 in a liner of 2 mm",
        "motor_burn": "1: end burner, 0: core burner",
    }
    rows: list[Row] = [(name, value, source.get(name, "")) for name, value in values.items()]
    rows.insert(3, ("motor_ignition", 0, ""))
    rows.insert(7, ("motor_diameter", bore, "of the mount"))
    rows.append(("motor_misalignment", [0, 0], "thrust turned about x and y of the nozzle"))
    rows.append(("motor_swirl", 0, "roll moment of the jet over its thrust"))
    if vehicle.carrier is not None:
        rows.append((REPLACES, 1, "1: the motor of these numerics replaces that of the mechanism"))
    return rows
