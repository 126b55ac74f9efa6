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

    The SG90 of `mjcf/mechanism.xml`, equal by test: 1.8 kgf·cm of stall and 0.11 s/60° at 4.8 V by
    its data sheet, winding, viscous friction and gear as fitted by danb0b (robotics notes, DC motor
    identification), an iron rotor of 8 mm and 2.5 g, full voltage at 0.1 rad of error. Travel, dead
    band and backlash: measured ranges of 9 g servos.

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
    torque_constant: float = 0.38 / 55.5
    viscous: float = 1.4e-6
    inertia: float = 2.0e-8
    gear: float = 55.5
    voltage: float = 4.8
    gain: float = 47.4
    dead_band: float = radians(0.25)
    friction: float = 0.158
    slew_limit: float = 0.0
    backlash: float = radians(0.8)
    travel: float = SERVO_TRAVEL
    trim: float = 0.0

    def command(self, pulse: float) -> float:
        """Return the shaft angle commanded by a pulse width [s] → [rad]."""
        return (pulse - PULSE_CENTRE - self.trim) * self.travel


def sample_supply(rng: np.random.Generator) -> float:
    """Return the supply of a rig over the nominal one: 4 NiMH cells of 1.1 to 1.4 V are ±12 % [1].

    Both servos hang on it.
    """
    return float(rng.uniform(0.88, 1.12))


def sample(rng: np.random.Generator, supply: float = 1.0) -> ServoParameters:
    """Return a servo with random tolerances: winding ±22 %, constant ±10 %, travel ±4 %.

    Its gain is that of a pulse stretcher, set by a capacitor of ±20 % and a resistor of ±5 %
    (0.76 to 1.26 in the worst case), and proportional to the supply.

    Parameters
    ----------
    rng : random generator
    supply : of the rig, over the nominal one [1]
    """
    base = ServoParameters()
    board = rng.spawn(1)[0]  # of the servo's electronics
    return replace(
        base,
        resistance=base.resistance * rng.uniform(0.8, 1.25),
        torque_constant=base.torque_constant * rng.uniform(0.9, 1.1),
        voltage=base.voltage * supply,
        gain=base.gain * supply * board.uniform(0.76, 1.26),
        dead_band=radians(rng.uniform(0.1, 0.5)),
        friction=base.friction * rng.uniform(0.4, 1.9),
        backlash=radians(rng.uniform(0.5, 1.5)),
        travel=base.travel * rng.uniform(0.96, 1.04),
        trim=rng.uniform(-40e-6, 40e-6),
    )


class Servo:
    """State of a servo; `angle` is that of the horn, behind the backlash.

    Gain and limit of its controller are proportional to the supply.
    """

    def __init__(self, parameters: ServoParameters) -> None:
        self.parameters = parameters
        self.drive = Drive.NORMAL
        self.supply = 1.0  # voltage over that of the parameters
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
        volts = min(max(volts, -p.voltage), p.voltage) * self.supply
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
