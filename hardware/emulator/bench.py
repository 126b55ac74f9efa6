"""Analog part of a simulated rig: pulse widths to voltages and registers, for any firmware."""

from dataclasses import dataclass
from math import radians

import numpy as np

from hardware.emulator.actuation import Actuation
from hardware.emulator.injection import Injection
from hardware.emulator.plant import AnalyticPlant, Plant, PlantParameters, sample_parameters
from hardware.emulator.sensors import Gaussian, ImuPair, SensorParameters
from hardware.emulator.sensors import sample as sample_sensors
from hardware.emulator.servo import ServoParameters
from hardware.frames import PAIR_NAMES, POTENTIOMETER_NAMES, Pair, Triple
from hardware.parts import GYRO_DELAY_S, GYRO_SAMPLE_S, POTENTIOMETER_TRAVEL
from hardware.protocol import constants as c

DRAINS = {("supply", "sag"), ("supply", "droop")}  # faults that lower it for all
OPEN_WIRE_TIME = 1e-3  # s; a pull-down of 1 MΩ empties the input's and cable's 1 nF


@dataclass(frozen=True, slots=True)
class RigParameters:
    """Parameters in which one rig differs from another.

    Attributes
    ----------
    plant : mechanism and servos of the analytic plant
    sensors : their errors
    skew : by how much the device's clock is fast [1]; a ceramic resonator is good to 5e-3
    joystick : rest position of its two axes, −1…1
    """

    plant: PlantParameters
    sensors: SensorParameters
    skew: float = 0.0
    joystick: Pair = (0.0, 0.0)


def reference_rig() -> RigParameters:
    """Return the nominal rig: no tolerances, only noise, dead band, friction and backlash."""
    return RigParameters(PlantParameters(), SensorParameters())


def sample_rig(seed: int) -> RigParameters:
    """Return a rig with random tolerances; the same seed gives the same rig."""
    rng = np.random.default_rng([seed, 1])
    return RigParameters(
        plant=sample_parameters(rng),
        sensors=sample_sensors(rng),
        skew=float(rng.uniform(-3e-3, 3e-3)),
    )


class Bench:
    """Servos, gimbal and sensors over any plant.

    Parameters
    ----------
    parameters : the rig
    plant : physics with its own servos; the analytic plant if omitted
    injections : faults
    seed : of the sensors' noise

    Attributes
    ----------
    time : rig time [s]
    paused : whether the time of faults stands still, as during a check before a run
    """

    def __init__(
        self,
        parameters: RigParameters | None = None,
        plant: Plant | None = None,
        injections: tuple[Injection, ...] = (),
        seed: int = 0,
    ) -> None:
        self.parameters = parameters or reference_rig()
        self.plant: Plant = plant or AnalyticPlant(self.parameters.plant)
        self.injections = injections
        self.joystick = self.parameters.joystick
        self.time = self._fault_time = 0.0
        self.paused = False
        self.dlpf = c.DLPF
        rng = np.random.default_rng([seed, 2])
        self._uniform = np.random.default_rng([seed, 3])
        self._gaussian = Gaussian(rng)
        self._imus = ImuPair(self.parameters.sensors.imus, np.random.default_rng([seed, 4]))
        self._held: dict[Injection, float] = {}
        self._frozen: dict[str, list[int]] = {}
        self._dips = [f for f in injections if (f.target, f.kind) == ("supply", "reset")]
        self._drains = any((f.target, f.kind) in DRAINS for f in injections)
        self._closed = [False] * 4
        self._shaft: Triple = (0.0, 0.0, 0.0)
        self._actuation = Actuation(self.plant, injections)
        self._watch_switches()

    @property
    def delay(self) -> float:
        """By how much the time of faults is behind the rig's [s]."""
        return self.time - self._fault_time

    def set_pulses(self, pulses: Triple) -> None:
        """Apply pulse widths [s]; call it when a PWM frame begins."""
        servos: tuple[ServoParameters, ...] = self.parameters.plant.servos
        third = servos[2].command(pulses[2])
        if self.injections and self._value("turntable", "stuck"):
            third = self._shaft[2]
        self._shaft = servos[0].command(pulses[0]), servos[1].command(pulses[1]), third

    def advance(self, dt: float) -> None:
        """Advance everything by dt [s], about 1 ms."""
        shaft = self._shaft
        if self._actuation.faulty:
            shaft = self._actuation.shafts(shaft, self._fault_time, dt)
        if self._drains:
            self.plant.set_supply(self._supply())
        self.plant.advance(dt, shaft)
        self.time += dt
        if not self.paused:
            self._fault_time += dt
        self._watch_switches()
        gyro, force = self.plant.holder_imu()
        base_gyro, base_force = self.plant.base_imu()
        jump = radians(self._value("gyro", "bias"))
        truth = np.array([*gyro, *force, *base_gyro, *base_force])
        if jump:
            truth[:3] += jump
        if self.injections:
            truth[:3] *= 1.0 + self._value("gyro", "gain")
            truth[6:9] += radians(self._value("base_gyro", "bias"))
        self._imus.advance(dt, truth, GYRO_DELAY_S[self.dlpf], GYRO_SAMPLE_S[self.dlpf])

    def _watch_switches(self) -> None:
        s = self.parameters.sensors
        x, y = self.plant.angles()
        for i, angle in enumerate((x, -x, y, -y)):
            limit = abs(s.switch_angle[i])
            self._closed[i] = angle >= (limit - s.differential if self._closed[i] else limit)

    def _value(self, target: str, kind: str) -> float:
        for injection in self.injections:
            if (
                injection.target == target
                and injection.kind == kind
                and injection.active(self._fault_time)
            ):
                return injection.strength
        return 0.0

    def potentiometer_codes(self) -> tuple[int, int, int, int]:
        """Return the ADC's codes of the four potentiometers."""
        s = self.parameters.sensors
        angles = self.plant.angles()
        supply = 1.0 + s.supply_ripple * self._gaussian()
        if self.injections:
            supply *= self._supply()
            angles = self._displaced(angles[0], 0), self._displaced(angles[1], 1)
        codes = []
        for i, sensor in enumerate(s.potentiometers):
            fraction = sensor.fraction(angles[i // 2]) * supply
            if self.injections:
                fraction = self._broken(POTENTIOMETER_NAMES[i], fraction)
            code = fraction * c.ADC_LEVELS + sensor.noise * self._gaussian()
            codes.append(min(max(int(code), 0), c.ADC_LEVELS - 1))
        return (codes[0], codes[1], codes[2], codes[3])

    def _supply(self) -> float:
        """Return what faults leave of the supply that servos and potentiometers share [1]."""
        return max(0.0, 1.0 - self._value("supply", "sag") - self._risen("supply", "droop"))

    def _risen(self, target: str, kind: str) -> float:
        """Return what a fault that grows at a constant rate has grown to."""
        for f in self.injections:
            if f.target == target and f.kind == kind and f.active(self._fault_time):
                return f.value * (self._fault_time - f.start)
        return 0.0

    def _displaced(self, angle: float, axis: int) -> float:
        """Return the angle that both potentiometers of an axis are turned to [rad]."""
        name = PAIR_NAMES[axis]
        for fault in self.injections:
            if fault.target != name or fault.kind != "stuck":
                continue
            if fault.active(self._fault_time):
                angle = self._held.setdefault(fault, angle)
            else:
                self._held.pop(fault, None)
        return angle + radians(self._value(name, "slipped") + self._risen(name, "drift"))

    def _broken(self, name: str, fraction: float) -> float:
        for fault in self.injections:
            if fault.target != name:
                continue
            if not fault.active(self._fault_time):
                self._held.pop(fault, None)
            elif fault.kind == "glitch":
                if self._uniform.random() < fault.value:
                    fraction = self._uniform.random()
            elif fault.kind == "stuck":
                fraction = self._held.setdefault(fault, fraction)
            elif fault.kind == "open":
                fraction *= float(np.exp(-(self._fault_time - fault.start) / OPEN_WIRE_TIME))
            elif fault.kind == "offset":
                fraction += radians(fault.value) / POTENTIOMETER_TRAVEL
            elif fault.kind == "drift":
                turned = radians(fault.value) * (self._fault_time - fault.start)
                fraction += turned / POTENTIOMETER_TRAVEL
            elif fault.kind == "gain":
                fraction += (fraction - 0.5) * fault.value
        return fraction

    def imu_counts(self, age: Pair = (0.0, 0.0)) -> list[int]:
        """Return both IMUs' registers (12,): gyro and accelerometer of holder, then of base.

        Parameters
        ----------
        age : how long ago each was read, at most two advances [s]
        """
        counts = self._imus.counts(age)
        for name, half in (("gyro", slice(0, 6)), ("base_gyro", slice(6, 12))):
            if self.injections and self._value(name, "frozen"):
                counts[half] = self._frozen.setdefault(name, counts[half])
            else:
                self._frozen.pop(name, None)
        return counts

    def imu_updates(self) -> list[tuple[float, int]]:
        """Return when the IMUs' registers changed in the latest `advance`, as `ImuPair.updates`."""
        return self._imus.updates()

    def imu_present(self) -> tuple[bool, bool]:
        """Return whether the IMUs of holder and base answer on the bus."""
        if not self.injections:
            return True, True
        return not self._value("imu", "unplug"), not self._value("base_imu", "unplug")

    def supply_dipped(self) -> bool:
        """Return whether a dip of the supply resets the board now; true once for each."""
        past = [f for f in self._dips if f.start <= self._fault_time]
        self._dips = [f for f in self._dips if f not in past]
        return bool(past)

    def switch_bits(self) -> int:
        """Return the closed switches: bits 0…3 are +x, −x, +y, −y."""
        return sum(closed << i for i, closed in enumerate(self._closed))

    def joystick_codes(self) -> tuple[int, int]:
        """Return the ADC's codes of the joystick."""
        half = c.ADC_LEVELS // 2
        x, y = (min(max(round(half + half * v), 0), c.ADC_LEVELS - 1) for v in self.joystick)
        return x, y
