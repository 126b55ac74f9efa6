"""Vehicles from a short description: TOML file, checked design, coefficients, MJCF."""

from twin.physics.vehicle.built import Vehicle
from twin.physics.vehicle.carrier import mechanism_file
from twin.physics.vehicle.design import Design, Gimbal, VehicleError
from twin.physics.vehicle.mjcf import mjcf
from twin.physics.vehicle.read import (
    described,
    motor_path,
    parse,
    printable,
    read,
    with_motor,
)
from twin.physics.vehicle.write import toml

__all__ = [
    "Design",
    "Gimbal",
    "Vehicle",
    "VehicleError",
    "described",
    "mechanism_file",
    "mjcf",
    "motor_path",
    "parse",
    "printable",
    "read",
    "toml",
    "with_motor",
]
