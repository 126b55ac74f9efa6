"""`twin vehicle`: what a vehicle weighs and how stable it is, and its MJCF."""

import math
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Final

import mujoco
import numpy as np

from analysis.files import write_text
from twin.config.paths import writable
from twin.config.vehicle import Vehicle as Settings
from twin.experiments.vehicle.drawing import drawing
from twin.experiments.vehicle.openrocket import ImportResult, import_design
from twin.experiments.vehicle.result import BuildResult, Part, State, VehicleResult
from twin.physics import vehicle as vehicles
from twin.physics.aerodynamics.stability import ROOT, Stability
from twin.plant.authority import balance, numeric
from twin.plant.model.compose import design_of, is_description
from twin.plant.model.model import ModelConfig, TwinModel, load

PIVOT: Final = 0.03  # m forward of the end of the body, docs/vehicles.md
BURN: Final = (0.0, 0.25, 0.5, 0.75, 1.0)  # shares of the burn time
ANGLES: Final = (0.0, 2.0, 5.0, 10.0)  # degrees


def vehicle(config: Settings) -> VehicleResult | BuildResult | ImportResult:
    """Show, build or import a vehicle.

    Raises
    ------
    TwinError : a file that cannot be read or written, or a vehicle that cannot be built
    """
    if config.action == "import":
        return import_design(config)
    return _build(config) if config.action == "build" else _show(config)


def _described(config: Settings) -> vehicles.Vehicle:
    design, _ = design_of(config.file, config.motor)
    if config.mechanism is not None and design.gimbal is not None:
        held = replace(design.gimbal, mechanism=str(config.mechanism.resolve()))
        design = replace(design, gimbal=held)
    return vehicles.Vehicle.of(design)


def _build(config: Settings) -> BuildResult:
    built = _described(config)
    out = writable(
        config.out or Path("runs") / f"{config.file.stem}.xml", ".xml", force=config.force
    )
    text = vehicles.mjcf(built, out.parent.resolve())
    write_text(out, text)
    return BuildResult(str(out), str(config.file))


def _show(config: Settings) -> VehicleResult:
    twin = load(ModelConfig(vehicle=config.file, mechanism=config.mechanism, motor=config.motor))
    built = _described(config) if is_description(config.file) else None
    result = report(twin, str(config.file), built)
    if config.out is None or built is None:
        return result
    out = writable(config.out, ".svg", force=config.force)
    full, empty = (built.origin - result.states[k].centre_of_mass for k in (0, -1))
    marks = [
        ("centre of mass, loaded", full, "#1f5fd9"),
        ("centre of mass, empty", empty, "#4aa3ff"),
    ]
    marks.append(("centre of pressure", built.origin - result.centre_of_pressure["0"], "#b00020"))
    write_text(out, drawing(built, marks))
    return replace(result, drawn=str(out))


def report(twin: TwinModel, name: str, built: vehicles.Vehicle | None = None) -> VehicleResult:
    """Figures of a loaded vehicle, and of the design that it was built from."""
    model = copy(twin.mj)
    air = Stability(model)
    ignition = float(model.numeric("motor_ignition").data[0])
    burn = float(model.numeric("motor_time").data.max())
    radians = [max(math.radians(angle), ROOT) for angle in ANGLES]
    pressure = [air.centre_of_pressure(angle) for angle in radians]
    states = tuple(_state(model, air, ignition, share * burn, pressure[0]) for share in BURN)
    source = ""
    if built is not None:
        source = "as the description states" if built.design.drag is not None else ""
        source = source or f"from the shape: {built.drag.text}"
        if built.drag_table is not None:
            mach, drag = built.drag_table.mach, built.drag_table.coasting
            source = (
                f"in flight {built.design.drag_table} takes its place: {drag.min():.3g} to"
                f" {drag.max():.3g} with the motor off, Mach {mach[0]:g} to {mach[-1]:g}"
            )
    return VehicleResult(
        name=name,
        states=states,
        centre_of_pressure={f"{a:g}": float(z) for a, z in zip(ANGLES, pressure, strict=True)},
        diameter=air.diameter,
        drag=float(model.numeric("air_axial_drag").data[0]),
        drag_source=source,
        terms=() if built is None else (*built.body_terms, *built.fin_terms),
        tip=None if built is None else built.origin,
        thrust=float(np.max(model.numeric("motor_thrust").data)),
        notes=twin.notes,
        parts=() if built is None else _parts(built),
        launch=_launch(model),
        gimbal=_gimbal(twin, built),
    )


def _launch(model: mujoco.MjModel) -> str:
    names = ("ramp_elevation", "ramp_azimuth", "ramp_length", "air_altitude")
    given = [values[0] for name in names if (values := numeric(model, name)) is not None]
    if len(given) < len(names):
        return "no rail"
    elevation, azimuth, rail, altitude = given
    return (
        f"elevation {math.degrees(elevation):.4g}°, azimuth {math.degrees(azimuth):.4g}° (from east"
        f" to north), rail {rail:.4g} m, ground {altitude:.4g} m above the sea"
    )


def _gimbal(twin: TwinModel, built: vehicles.Vehicle | None) -> str:
    """Where the pivot is; of a description without one, where the shipped mechanism fits."""
    if twin.gimbal != "fixed":
        return "pivot at the origin" if built is None else f"pivot at {built.origin:.4g} m"
    if built is None:
        return "none, the motor is fixed"
    end = built.outline.end
    design = replace(
        built.design,
        gimbal=vehicles.Gimbal(pivot=end - PIVOT),
        origin=None,
        motor=replace(built.design.motor, overhang=0.0, diameter=None),
    )
    try:
        vehicles.Vehicle.of(design)
    except vehicles.VehicleError as error:
        return f"none; the shipped one does not fit: {str(error).rpartition('.toml: ')[2]}"
    return (
        f'none; gimbal = {{ pivot = "{end - PIVOT:.4g} m" }} puts the shipped one'
        f" {1e3 * PIVOT:g} mm forward of the end of the body; motor then without overhang, diameter"
    )


def _parts(built: vehicles.Vehicle) -> tuple[Part, ...]:
    """Masses as a builder weighs them; the gimbal without the motor."""
    counts = {
        fins.name or f"fins {k + 1}": f"{round(fins.count)} fins, together"
        for k, fins in enumerate(built.design.fins)
    }
    found = [
        Part(f"{p.name} ({counts[p.name]})" if p.name in counts else p.name, p.mass, p.station)
        for p in built.parts
    ]
    motor = built.motor
    middle = built.outline.nozzle - motor.length / 2
    found.append(Part(f"motor {motor.name}, loaded", motor.loaded_mass, middle))
    if built.carrier is not None:
        gimbal = built.carrier
        found.append(Part("gimbal without motor", gimbal.mass, built.origin - gimbal.centre))
    return tuple(found)


def _state(
    model: mujoco.MjModel, air: Stability, ignition: float, time: float, pressure: float
) -> State:
    station = air.at(ignition + time).station
    mass, _, transverse, axial = balance(model)
    return State(time, mass, station, transverse, axial, (station - pressure) / air.diameter)
