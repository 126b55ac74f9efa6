"""A 9 g servo: pulse to shaft angle, with dead band, motor, friction, slew limit and backlash."""

from dataclasses import dataclass, replace
from enum import StrEnum
from math import radians

import numpy as np

from hardware.parts import SERVO_TRAVEL
from hardware.protocol import constants

PULSE_CENTRE = constants.PULSE_NEUTRAL * constants.TICK  # s


class Drive(StrEnum):
    """How a servo is driven."""

    NORMAL = "normal"
    LIMP = "limp"  # no power
    JAMMED = "jammed"  # its gear train is blocked


@dataclass(frozen=True, slots=True)
class Wear:
    """Changes of a servo that leave it in working order.

    Attributes
    ----------
    backlash : more of it [rad]
    friction, voltage : times the new servo's [1]
    """

    backlash: float = 0.0
    friction: float = 1.0
    voltage: float = 1.0


@dataclass(frozen=True, slots=True)
class ServoParameters:
    """Parameters of one servo; 0 switches dead band, friction, slew limit or backlash off.

    Motor and gear: SG90 fitted by danb0b (robotics notes, DC motor identification), R 10 Ω,
    k_t = k_e 4.5e-3, b 1.4e-6 N·m·s, gear 55.5, controller clipped at ±5 V. Travel, dead band and
    backlash: measured ranges of 9 g servos.

    Attributes
    ----------
    resistance : of the winding [Ω]
    torque_constant : N·m/A, equal to the back-EMF constant [V·s/rad]
    viscous : motor friction [N·m·s/rad]
    inertia : of motor and gear, at the motor [kg·m²]
    gear : motor turns per shaft turn [1]
    voltage : limit of the controller's output [V]
    gain : of its position loop [V/rad of shaft]
    dead_band : position error without effect [rad of shaft]
    friction : dry friction, as a voltage at the motor [V]
    slew_limit : of the shaft [rad/s]
    backlash : full width between shaft and horn [rad]
    travel : shaft angle per pulse width [rad/s]
    trim : pulse width of the shaft's zero, beyond 1.5 ms [s]
    """

    resistance: float = 10.0
    torque_constant: float = 4.5e-3
    viscous: float = 1.4e-6
    inertia: float = 3.0e-8
    gear: float = 55.5
    voltage: float = 5.0
    gain: float = 30.0
    dead_band: float = radians(0.25)
    friction: float = 0.08
    slew_limit: float = 0.0
    backlash: float = radians(0.8)
    travel: float = SERVO_TRAVEL
    trim: float = 0.0

    def command(self, pulse: float) -> float:
        """Return the shaft angle commanded by a pulse width [s] → [rad]."""
        return (pulse - PULSE_CENTRE - self.trim) * self.travel


def sample(rng: np.random.Generator) -> ServoParameters:
    """Return a servo with random tolerances: speed ±20 %, gain ±35 %, travel ±4 %, trim ±40 µs."""
    base = ServoParameters()
    board = rng.spawn(1)[0]  # of the servo's electronics
    return replace(
        base,
        resistance=base.resistance * rng.uniform(0.8, 1.25),
        torque_constant=base.torque_constant * rng.uniform(0.9, 1.1),
        voltage=base.voltage * board.uniform(0.88, 1.12),
        gain=base.gain * board.uniform(0.65, 1.35),
        dead_band=radians(rng.uniform(0.1, 0.5)),
        friction=rng.uniform(0.03, 0.15),
        backlash=radians(rng.uniform(0.5, 1.5)),
        travel=base.travel * rng.uniform(0.96, 1.04),
        trim=rng.uniform(-40e-6, 40e-6),
    )


class Servo:
    """State of a servo; `angle` is that of the horn, behind the backlash."""

    def __init__(self, parameters: ServoParameters) -> None:
        self.parameters = parameters
        self.drive = Drive.NORMAL
        self.shaft = 0.0
        self.speed = 0.0  # of the shaft
        self.angle = 0.0
        p = parameters
        loss = p.torque_constant**2 + p.viscous * p.resistance
        self._time_constant = p.inertia * p.resistance / loss
        self._speed_per_volt = p.torque_constant / loss / p.gear

    def advance(self, dt: float, command: float) -> float:
        """Advance by dt [s] towards a shaft angle [rad]; return the horn angle [rad]."""
        p = self.parameters
        if self.drive is Drive.JAMMED:
            self.speed = 0.0
            return self.angle
        error = command - self.shaft if self.drive is Drive.NORMAL else 0.0
        volts = 0.0 if abs(error) < p.dead_band else p.gain * error
        volts = min(max(volts, -p.voltage), p.voltage)
        # Backward Euler: stable however short the motor's time constant is.
        blend = dt / (dt + self._time_constant)
        free = self.speed + blend * (volts * self._speed_per_volt - self.speed)
        drag = blend * p.friction * self._speed_per_volt
        self.speed = max(free - drag, 0.0) if free > 0 else min(free + drag, 0.0)
        if p.slew_limit > 0:
            self.speed = min(max(self.speed, -p.slew_limit), p.slew_limit)
        self.shaft += self.speed * dt
        half = p.backlash / 2
        self.angle = min(max(self.angle, self.shaft - half), self.shaft + half)
        return self.angle
