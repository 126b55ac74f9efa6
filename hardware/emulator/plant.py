"""Physics of a simulated rig: the interface that any plant implements, and an analytic plant."""

from dataclasses import dataclass, field, replace
from math import cos, pi, sin
from typing import Protocol

import numpy as np

from hardware.emulator.servo import Drive, Servo, ServoParameters, Wear, sample, sample_supply
from hardware.frames import Pair, Triple
from hardware.parts import GIMBAL_STOP as STOP
from hardware.parts import STANDARD_GRAVITY as GRAVITY


class Plant(Protocol):
    """Servos, linkage, gimbal and base, driven by shaft angles."""

    def advance(self, dt: float, shaft: Triple) -> None:
        """Advance by dt [s] with the commanded shaft angles of servos x, y and turntable [rad]."""

    def set_drive(self, servo: int, drive: Drive) -> None:
        """Change how servo 0 (x) or 1 (y) is driven from now on."""

    def set_supply(self, share: float) -> None:
        """Set the voltage of the servos from now on, over the nominal one [1]."""

    def set_wear(self, servo: int, wear: Wear) -> None:
        """Change how worn servo 0 (x) or 1 (y) is from now on."""

    def angles(self) -> Pair:
        """Return the gimbal angles x, y [rad]."""

    def rates(self) -> Pair:
        """Return their time derivatives [rad/s]."""

    def holder_imu(self) -> tuple[Triple, Triple]:
        """Return angular rate and specific force in the holder IMU's frame [rad/s], [m/s²]."""

    def base_imu(self) -> tuple[Triple, Triple]:
        """Return the same for the base IMU."""


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """Parameters of the analytic plant.

    Attributes
    ----------
    linkage : gimbal angle per horn angle, rows x and y [1]
    offset : gimbal angles at horn zero [rad]
    natural_frequency, damping : of the gimbal on its linkage [rad/s], [1]
    servos : x, y, turntable
    """

    linkage: tuple[Pair, Pair] = ((0.444, 0.0), (0.0, 0.444))
    offset: Pair = (0.0, 0.0)
    natural_frequency: float = 2 * pi * 25.0
    damping: float = 0.8
    servos: tuple[ServoParameters, ServoParameters, ServoParameters] = field(
        default_factory=lambda: (ServoParameters(), ServoParameters(), ServoParameters())
    )


def sample_parameters(rng: np.random.Generator) -> PlantParameters:
    """Return random parameters: ±4 % linkage ratio, ±4 % cross coupling, ±1.5° assembly error."""
    diagonal = 0.444 * rng.uniform(0.96, 1.04, 2)
    cross = 0.444 * rng.uniform(-0.04, 0.04, 2)
    offset = np.radians(rng.uniform(-1.5, 1.5, 2))
    supply = sample_supply(rng.spawn(1)[0])
    return PlantParameters(
        linkage=(
            (float(diagonal[0]), float(cross[0])),
            (float(cross[1]), float(diagonal[1])),
        ),
        offset=(float(offset[0]), float(offset[1])),
        servos=(sample(rng, supply), sample(rng, supply), ServoParameters()),
    )


class AnalyticPlant:
    """Two servos behind a linkage matrix, each axis a second-order system; base on a turntable.

    The bench stands nozzle up, so body z points down. The turntable turns the base about x.
    """

    def __init__(self, parameters: PlantParameters | None = None) -> None:
        self.parameters = parameters or PlantParameters()
        self.servos = tuple(Servo(p) for p in self.parameters.servos)
        self._angle = list(self.parameters.offset)
        self._rate = [0.0, 0.0]
        self._turn = self._turn_rate = 0.0

    def advance(self, dt: float, shaft: Triple) -> None:
        """Advance by dt [s]; see `Plant`."""
        p = self.parameters
        u = self.servos[0].advance(dt, shaft[0])
        v = self.servos[1].advance(dt, shaft[1])
        w2, d2 = p.natural_frequency**2, 2 * p.damping * p.natural_frequency
        for i, (row, offset) in enumerate(zip(p.linkage, p.offset, strict=True)):
            target = row[0] * u + row[1] * v + offset
            # Implicit in the damping, so that 1 ms is far from the stability limit.
            rate = (self._rate[i] + dt * w2 * (target - self._angle[i])) / (
                1 + dt * d2 + dt * dt * w2
            )
            angle = self._angle[i] + dt * rate
            if abs(angle) > STOP:
                angle, rate = (STOP if angle > 0 else -STOP), 0.0
            self._angle[i], self._rate[i] = angle, rate
        before = self.servos[2].angle
        self._turn = self.servos[2].advance(dt, shaft[2])
        self._turn_rate = (self._turn - before) / dt

    def set_drive(self, servo: int, drive: Drive) -> None:
        """Change how a servo is driven; see `Plant`."""
        self.servos[servo].drive = drive

    def set_supply(self, share: float) -> None:
        """Set the voltage of the servos; see `Plant`."""
        for servo in self.servos:
            servo.supply = share

    def set_wear(self, servo: int, wear: Wear) -> None:
        """Change how worn a servo is; see `Plant`."""
        new = self.parameters.servos[servo]
        self.servos[servo].parameters = replace(
            new,
            backlash=new.backlash + wear.backlash,
            friction=new.friction * wear.friction,
            voltage=new.voltage * wear.voltage,
            gain=new.gain * wear.voltage,
        )

    def angles(self) -> Pair:
        """Return the gimbal angles x, y [rad]."""
        return self._angle[0], self._angle[1]

    def rates(self) -> Pair:
        """Return their time derivatives [rad/s]."""
        return self._rate[0], self._rate[1]

    def holder_imu(self) -> tuple[Triple, Triple]:
        """Return angular rate and specific force on the holder; its centre is on the pivot."""
        x, y = self._angle
        dx = self._rate[0] + self._turn_rate
        rate = (dx * cos(y), self._rate[1], dx * sin(y))
        tilt = x + self._turn
        force = (
            GRAVITY * cos(tilt) * sin(y),
            -GRAVITY * sin(tilt),
            -GRAVITY * cos(tilt) * cos(y),
        )
        return rate, force

    def base_imu(self) -> tuple[Triple, Triple]:
        """Return angular rate and specific force on the base."""
        t = self._turn
        return (self._turn_rate, 0.0, 0.0), (
            0.0,
            -GRAVITY * sin(t),
            -GRAVITY * cos(t),
        )
