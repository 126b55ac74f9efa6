"""A gimbal by its few numbers: each stands once, every part of the model follows from them.

Lengths along the tube count from the pivot; those without a sense are sizes. The defaults are
the reference mechanism.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Final

from twin.physics.vehicle.design import MASS, SIZE, Allowed, VehicleError
from twin.physics.vehicle.read import table, tables_of
from twin.physics.vehicle.text import text_of

ANGLE: Final = Allowed("angle", math.radians(1.0), math.radians(20.0))
SMALL: Final = Allowed("length", 0.0, 0.05)
PARTS: Final = ("bulkhead", "bracket", "ring", "holder", "horn", "rod_end")
SLIM, WIDE = 0.0075, 0.0115  # m between motor and bore: thinnest parts, parts of the reference


@dataclass(frozen=True, kw_only=True)
class Servo:
    """A servo, its shaft at one end of the case; defaults: SG90 data sheet.

    Attributes
    ----------
    length, depth, width : of the case along the horn's arm, along the shaft, along the tube [m]
    shaft : axis of the shaft from the middle of the case, towards its end [m]
    ears : length over the ears [m]
    screws : distance of the holes in the ears [m]
    flange : middle of the ears behind the top of the case [m]
    torque : at stall [N m]; the no-load speed is that of the default servo
    """

    length: Annotated[float, SIZE] = 0.0228
    depth: Annotated[float, SIZE] = 0.0225
    width: Annotated[float, SIZE] = 0.0122
    shaft: Annotated[float, SMALL] = 0.0053
    ears: Annotated[float, SIZE] = 0.0322
    screws: Annotated[float, SIZE] = 0.0278
    flange: Annotated[float, SMALL] = 0.00535
    mass: Annotated[float, MASS] = 0.009
    torque: Annotated[float, Allowed("number", 0.001, 10.0)] = 0.1824


@dataclass(frozen=True, kw_only=True)
class Dimensions:
    """A cardan gimbal around a motor, moved by two servos forward of it through pushrods.

    Attributes
    ----------
    bore : inner diameter of the tube [m]
    motor, motor_length, motor_mass, propellant : of the motor, loaded [m, kg]
    forward : forward end of the motor, forward of the pivot [m]
    aft : end of the tube, aft of the pivot [m]
    lever : of a rod's ball from the axis [m]
    height : of these balls, forward of the pivot [m]
    horn : arm of a horn [m]
    offset : of the horn's ball farther out than the holder's [m]
    stud : of the horn's ball outside the horn's face [m]
    servo_x, servo_y : shafts, forward of the pivot [m]
    stroke : commanded either way; the reach of the servos covers it [rad]
    stops : either way [rad]
    """

    bore: Annotated[float, SIZE] = 0.052
    motor: Annotated[float, SIZE] = 0.029
    motor_length: Annotated[float | None, SIZE] = None
    motor_mass: Annotated[float | None, MASS] = None
    propellant: Annotated[float | None, MASS] = None
    forward: Annotated[float, SIZE] = 0.036
    aft: Annotated[float, SIZE] = 0.030
    lever: Annotated[float, SIZE] = 0.0205
    height: Annotated[float, SIZE] = 0.013
    horn: Annotated[float, SIZE] = 0.008
    offset: Annotated[float, SMALL] = 0.0028
    stud: Annotated[float, SMALL] = 0.0028
    servo_x: Annotated[float, SIZE] = 0.054
    servo_y: Annotated[float, SIZE] = 0.0695
    stroke: Annotated[float, ANGLE] = math.radians(8.0)
    stops: Annotated[float, ANGLE] = 0.174533
    servo: Servo = field(default_factory=Servo)
    stl: tuple[tuple[str, Path], ...] = ()

    def __post_init__(self) -> None:
        for fits, text in self._rules():
            if not fits:
                raise VehicleError(text)

    def _rules(self) -> Iterator[tuple[bool, str]]:
        """Conditions without which nothing can be built, and what is wrong otherwise."""
        least = self.motor + 2 * SLIM
        yield (
            self.bore >= least - 1e-9,
            (
                f"bore = {self.bore:g} m: must be {least:g} m or more around a motor of"
                f" {self.motor:g} m"
            ),
        )
        yield self.stops > self.stroke, "stops: must be larger than stroke"
        yield (
            self.motor / 2 < self.lever < self.bore / 2,
            (
                f"lever = {self.lever:g} m: must lie between the motor and the bore,"
                f" {self.motor / 2:g} to {self.bore / 2:g} m"
            ),
        )
        gap = self.servo_y - self.servo_x - self.servo.width
        yield gap >= 0.002, "servo_y: must be the servo's width and 2 mm or more ahead of servo_x"
        yield (
            self.servo_x - self.servo.width / 2 > self.forward,
            (
                f"servo_x = {self.servo_x:g} m: the servo would sit in the motor; must be more than"
                f" {self.forward + self.servo.width / 2:g} m"
            ),
        )
        yield self.height < self.servo_x, "height: must be less than servo_x"
        weighs = self.burning < self.loaded
        yield weighs, f"propellant = {self.burning:g} kg: must be less than motor_mass"

    @property
    def size(self) -> float:
        """Length of the motor [m]; in proportion to the reference's if not given."""
        return self.motor_length or 0.2134

    @property
    def loaded(self) -> float:
        """Mass of the loaded motor [kg]."""
        return self.motor_mass or 0.2034 * (self.motor / 0.029) ** 2 * self.size / 0.2134

    @property
    def burning(self) -> float:
        """Mass of the propellant [kg]."""
        return self.propellant or 0.1164 / 0.2034 * self.loaded

    @property
    def rods(self) -> tuple[float, float]:
        """Lengths between the centres of the balls (x, y) [m]."""
        x, y = (math.hypot(self.offset, s - self.height) for s in (self.servo_x, self.servo_y))
        return x, y

    def wall(self, slim: float, wide: float) -> float:
        """Radius at a distance from the motor: in the narrowest bore, in a wide enough one [m]."""
        share = min((self.bore / 2 - self.motor / 2 - SLIM) / (WIDE - SLIM), 1.0)
        return self.motor / 2 + slim + max(share, 0.0) * (wide - slim)


def read(path: Path) -> Dimensions:
    """Dimensions of a TOML file; `stl` names files that take the place of drawn parts.

    Raises
    ------
    VehicleError : unreadable, or the key, its value and what would be right
    """
    content = tables_of(text_of(path, "mechanism"), str(path))
    if not content:
        raise VehicleError(f"{path}: is empty; must have at least one dimension, such as stroke")
    try:
        servo = table(Servo, content.pop("servo", {}), "servo")
        own = content.pop("stl", {})
        if not isinstance(own, dict) or not all(isinstance(v, str) for v in own.values()):
            raise VehicleError('stl: must be a table such as { holder = "mine.stl" }')
        if unknown := [name for name in own if name not in PARTS]:
            raise VehicleError(f"stl: no part {unknown[0]!r}; valid: {', '.join(PARTS)}")
        drawn = tuple((name, path.parent / file) for name, file in own.items())
        size: Dimensions = table(Dimensions, content, "")
        return replace(size, servo=servo, stl=drawn)
    except VehicleError as error:
        raise VehicleError(f"{path}: {error}") from None
