"""`twin vehicle import`: an OpenRocket design as a description of a vehicle."""

import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from analysis.files import write_text
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.config.vehicle import Vehicle as Settings
from twin.physics import motor, openrocket, vehicle
from twin.physics.vehicle.check import check_outline, check_parts


@dataclass(frozen=True)
class ImportResult(Result):
    """A description that was written, and how it compares with OpenRocket's own figures.

    Attributes
    ----------
    file, source : description and design
    parts : number of parts of the body, fin sets, masses and parachutes
    mass : without the motor [kg]
    stored_mass : the same in the design's stored simulations; None where there are none [kg]
    centre_of_pressure, stored_centre_of_pressure : at small angles of attack, from the tip [m]
    motor : that the design names; it has no thrust curve
    left_out : parts and settings that a description cannot have
    warnings : what of the design does not fit together, and what to do
    with_casing : the stored mass includes the motor's casing
    outdated : the stored figures are of a design that was changed since
    """

    file: str
    source: str
    parts: tuple[int, int, int, int]
    mass: float
    stored_mass: float | None
    centre_of_pressure: float
    stored_centre_of_pressure: float | None
    motor: str
    left_out: tuple[str, ...]
    warnings: tuple[str, ...]
    needs_motor: bool
    with_casing: bool
    outdated: bool

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return asdict(self)

    def rows(self) -> Rows:
        """What was written, the comparison, and what was left out."""
        body, fins, masses, chutes = self.parts
        stale = ", stored before the design's last change" if self.outdated else ""
        mass = _beside(self.mass, self.stored_mass, "kg", stale)
        pressure = _beside(self.centre_of_pressure, self.stored_centre_of_pressure, "m", stale)
        flag = " --motor FILE.eng" if self.needs_motor else ""
        casing = ", with its motor's casing" if self.with_casing else ""
        rows = [
            ("design", self.source),
            ("description", self.file),
            ("parts", f"{body} of the body, {fins} fin sets, {masses} masses, {chutes} parachutes"),
            ("mass, no motor", mass + casing),
            ("centre of pressure", pressure),
            ("motor", self.motor or "none"),
        ]
        rows += [("left out" if k == 0 else "", text) for k, text in enumerate(self.left_out)]
        rows += [("WARNING", text) for text in self.warnings]
        return [*rows, ("next", f"twin fly --vehicle {self.file}{flag}")]


def _beside(own: float, stored: float | None, unit: str, stale: str) -> str:
    if stored is None:
        return f"{own:.4g} {unit}; the design stores none to compare"
    text = f"{own:.4g} {unit}, OpenRocket {stored:.4g} {unit}"
    return (f"{text}: {100 * (own / stored - 1):+.2f} %" if stored > 0 else text) + stale


def import_design(config: Settings) -> ImportResult:
    """Write the description of an OpenRocket design.

    Raises
    ------
    TwinError : a design that cannot be read, or the part that a vehicle cannot have
    """
    out = config.out or Path("runs") / f"{config.file.stem}.toml"
    out = writable(out, ".toml", force=config.force)
    root = openrocket.document(config.file)
    found = openrocket.described(config.file)
    stored = openrocket.stored(root)
    design, mass = found.design, stored.mass
    if config.motor is not None:
        engine = motor.load(config.motor)
        file, name = motor.split_name(config.motor)
        beside = os.path.relpath(file.resolve(), out.parent.resolve())
        text = beside if name is None else f"{beside}:{name}"
        design = replace(design, motor=replace(design.motor, file=text))
        if stored.with_casing and mass is not None:
            mass -= engine.loaded_mass - engine.propellant_mass
    comments = [f"Imported from {vehicle.printable(config.file.name)}, OpenRocket."]
    comments += [f"Motor of the design: {found.motor or 'none'}."]
    text = vehicle.toml(design, [*comments, *(f"Left out: {item}." for item in found.left_out)])
    checked = vehicle.parse(text, str(config.file), out)
    check_parts(checked)
    check_outline(checked, found.outline)
    if config.motor is not None:
        vehicle.Vehicle.of(replace(checked, motor_data=engine))
    write_text(out, text)
    return ImportResult(
        file=str(out),
        source=str(config.file),
        parts=(len(design.body), len(design.fins), len(design.masses), len(design.parachutes)),
        mass=found.airframe.mass,
        stored_mass=mass,
        centre_of_pressure=found.centre_of_pressure,
        stored_centre_of_pressure=stored.centre_of_pressure,
        motor=found.motor,
        left_out=found.left_out,
        warnings=found.warnings,
        needs_motor=config.motor is None,
        outdated=stored.outdated,
        with_casing=stored.with_casing and config.motor is None,
    )
