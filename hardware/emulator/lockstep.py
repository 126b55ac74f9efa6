"""What simulated rigs have in common: a bench, a cable, and world time in ticks of the firmware."""

from abc import ABC, abstractmethod

from hardware.device import LOOP_US
from hardware.emulator.bench import Bench, RigParameters, reference_rig
from hardware.emulator.cable import Cable
from hardware.emulator.injection import Injection
from hardware.emulator.plant import Plant
from hardware.frames import Pair, Triple
from hardware.protocol import constants


class LockstepRig(ABC):
    """A bench whose board runs in lockstep with world time, `time_us`; the board's clock is skewed.

    Parameters
    ----------
    parameters : the rig; the reference rig if omitted
    plant : physics; the analytic plant if omitted
    injections : faults, from `injection.parse`
    seed : of the noise
    """

    def __init__(
        self,
        parameters: RigParameters | None,
        plant: Plant | None,
        injections: tuple[Injection, ...],
        seed: int,
    ) -> None:
        self.parameters = parameters or reference_rig()
        self.bench = Bench(self.parameters, plant, injections, seed)
        self.time_us = 0
        self._tick = 0
        self._tick_s = LOOP_US * 1e-6 / (1 + self.parameters.skew)
        self._cable = Cable(injections, seed)

    @property
    def time_ns(self) -> int:
        """World time [ns], the clock of a lockstep link."""
        return self.time_us * 1000

    @property
    def _fault_time(self) -> float:
        return self.time_us * 1e-6 - self.bench.delay

    def truth(self) -> tuple[Pair, Pair]:
        """Return the true gimbal angles [rad] and rates [rad/s]."""
        return self.bench.plant.angles(), self.bench.plant.rates()

    def advance_us(self, duration: int) -> None:
        """Advance world time [µs]."""
        self.time_us += duration
        while (self._tick + 1) * self._tick_s * 1e6 <= self.time_us:
            self._advance_tick()

    @abstractmethod
    def _advance_tick(self) -> None:
        """Advance the bench and run the board for one tick; count it in `_tick`."""

    def _set_pulses(self, ticks: tuple[int, int, int]) -> None:
        """Give the servos pulses of these widths in ticks of the board's timer."""
        # A fast clock makes short microseconds and short pulses.
        second = constants.TICK / (1 + self.parameters.skew)
        a, b, c = ticks
        pulses: Triple = (a * second, b * second, c * second)
        self.bench.set_pulses(pulses)
