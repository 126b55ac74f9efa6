"""A design with everything that follows from it: outline, masses, coefficients."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from twin.physics.aerodynamics.silhouette import strips
from twin.physics.motor import Motor
from twin.physics.vehicle import barrowman, drag
from twin.physics.vehicle.barrowman import Term
from twin.physics.vehicle.carrier import Carrier, carrier, mechanism_file
from twin.physics.vehicle.check import (
    check_gimbal,
    check_masses,
    check_motor,
    check_outline,
    check_parts,
)
from twin.physics.vehicle.design import Design, VehicleError
from twin.physics.vehicle.drag_table import DragTable, read_drag
from twin.physics.vehicle.fit import misfits
from twin.physics.vehicle.lumps import Lump, lumps, total
from twin.physics.vehicle.outline import Outline
from twin.physics.vehicle.sounding import read_sounding

Array = NDArray[np.float64]
STATIONS = 40  # of the crossflow quadrature, at least
LEAST = 4  # stations of a panel


@dataclass(frozen=True)
class Vehicle:
    """A checked design and what follows from it.

    Attributes
    ----------
    carrier : the mechanism's place for the motor; None where the motor is fixed
    origin : station of the vehicle's frame [m]: stations x have z = origin - x
    parts : masses of the airframe
    airframe : all of them together, without motor and mechanism
    """

    design: Design
    motor: Motor
    carrier: Carrier | None
    outline: Outline
    origin: float
    parts: tuple[Lump, ...]
    airframe: Lump

    @classmethod
    def of(cls, design: Design) -> "Vehicle":
        """Check a design and compute what follows from it.

        Raises
        ------
        VehicleError : parts that cannot be or do not fit each other
        """
        try:
            return cls._checked(design)
        except VehicleError as error:
            if design.source is None or str(error).startswith(str(design.source)):
                raise
            raise VehicleError(f"{design.source}: {error}") from None

    @classmethod
    def _checked(cls, design: Design) -> "Vehicle":
        check_parts(design)
        motor = design.motor_data
        if motor is None:
            raise VehicleError("motor.file is missing; name a motor file there or with --motor")
        held = None if design.gimbal is None else carrier(mechanism_file(design))
        bare = Outline.of(design)
        check_gimbal(design, bare, held)
        nozzle = _nozzle(design, bare, motor, held)
        outline = Outline.of(design, motor.diameter / 2, nozzle)
        check_outline(design, outline)
        check_motor(design, outline, held)
        parts = lumps(design, outline)
        airframe = total(parts)
        check_masses(outline, parts, airframe)
        origin = nozzle - motor.length / 2 if design.origin is None else design.origin
        if design.gimbal is not None:
            origin = design.gimbal.pivot
        return cls(design, motor, held, outline, origin, parts, airframe)

    @property
    def notes(self) -> tuple[str, ...]:
        """Parts that take each other's place, one line each."""
        return misfits(self.design, self.outline, self.motor, self.carrier)

    @property
    def area(self) -> float:
        """Reference area: the largest cross-section of the body [m²]."""
        return math.pi * self.outline.largest_radius**2

    @property
    def mass(self) -> float:
        """Launch mass [kg]."""
        held = 0.0 if self.carrier is None else self.carrier.mass
        return self.airframe.mass + held + self.motor.loaded_mass

    @cached_property
    def body_terms(self) -> tuple[Term, ...]:
        """Normal force of nose, transitions and steps."""
        return tuple(barrowman.body_terms(self.outline, self.area))

    @cached_property
    def fin_terms(self) -> tuple[Term, ...]:
        """Normal force of the fin sets."""
        return tuple(barrowman.fin_term(placed, self.area) for placed in self.outline.fins)

    @cached_property
    def roll(self) -> tuple[float, float]:
        """Roll damping [m⁴] and forcing by cant [m³]."""
        each = [barrowman.roll(placed, self.area) for placed in self.outline.fins]
        return sum(d for d, _ in each), sum(f for _, f in each)

    @cached_property
    def drag(self) -> drag.Drag:
        """Axial drag from the shape."""
        return drag.axial(self.outline, self.area, self.design.roughness)

    @cached_property
    def drag_table(self) -> DragTable | None:
        """Drag over the Mach number; None where the design names no table.

        Raises
        ------
        VehicleError : the file cannot be used
        """
        name = self.design.drag_table
        return read_drag(self.design.beside(name)) if name else None

    @cached_property
    def sounding(self) -> Array | None:
        """Wind and air over height, as the numeric `air_profile`; None where none is named.

        Raises
        ------
        VehicleError : the file cannot be used
        """
        launch = self.design.launch
        if not launch.profile:
            return None
        return read_sounding(self.design.beside(launch.profile), launch.altitude)

    @cached_property
    def crossflow(self) -> float:
        """Crossflow drag coefficient, as given or from the slenderness."""
        if self.design.crossflow_drag is not None:
            return self.design.crossflow_drag
        return drag.across(self.outline.end / (2 * self.outline.largest_radius))

    @cached_property
    def strips(self) -> tuple[Array, Array]:
        """Stations z [m] of the frame and areas b dz [m²] of the crossflow quadrature."""
        edges = self.origin - self.outline.corners()[::-1]
        edges = edges[np.concatenate([[True], np.diff(edges) > 1e-6])]
        lengths = np.diff(edges)
        counts = np.full(lengths.size, LEAST)
        for _ in range(STATIONS - int(counts.sum())):
            counts[np.argmax(lengths / counts)] += 1
        return strips(lambda z: self.outline.width(self.origin - z), list(edges), counts.tolist())

    @property
    def centre_of_pressure(self) -> float:
        """Station of the centre of pressure at small angles of attack [m]."""
        return barrowman.centre_of_pressure(self.outline)

    @property
    def buttons(self) -> tuple[float, float]:
        """Stations of the lower and the upper rail button [m]."""
        tail = self.outline.tail
        given = self.design.rail_buttons or (tail - 0.05 * tail, tail - 0.4 * tail)
        return max(given), min(given)


def _nozzle(design: Design, outline: Outline, motor: Motor, held: Carrier | None) -> float:
    """Station of the nozzle exit [m]."""
    if held is not None and design.gimbal is not None:
        return design.gimbal.pivot - held.forward + motor.length
    return outline.tail + design.motor.overhang
