"""The compiled firmware on a simulated ATmega328P, wired to the emulator's bench."""

from pathlib import Path

from hardware.device import LOOP_US
from hardware.emulator.bench import RigParameters
from hardware.emulator.emulator import identity
from hardware.emulator.injection import Injection
from hardware.emulator.lockstep import LockstepRig
from hardware.emulator.plant import Plant
from hardware.protocol import constants


class FirmwareRig(LockstepRig):
    """Same bench, faults and methods as `Emulator`, with the compiled firmware in place of Python.

    Parameters
    ----------
    parameters : the rig; the reference rig if omitted
    plant : physics; the analytic plant if omitted
    injections : faults, from `injection.parse`
    seed : of the noise
    elf : a built firmware; this tree's own if omitted

    Raises
    ------
    hardware.simavr.nano.SimulatedNanoError : the AVR tools are missing
    """

    def __init__(
        self,
        parameters: RigParameters | None = None,
        *,
        plant: Plant | None = None,
        injections: tuple[Injection, ...] = (),
        seed: int = 0,
        elf: Path | None = None,
    ) -> None:
        from hardware.simavr.nano import BASE, HOLDER, SimulatedNano

        self._sensors = (HOLDER, BASE)
        super().__init__(parameters, plant, injections, seed)
        self.nano = SimulatedNano(elf, identity(self.parameters))
        self._present = (True, True)
        self._ticks = [constants.PULSE_NEUTRAL] * 3

    def write(self, data: bytes) -> None:
        """Send bytes to the rig.

        Raises
        ------
        UnpluggedError : the cable is unplugged
        """
        self._cable.check(self._fault_time)
        self.nano.write(self._cable.carry(data, self._fault_time))

    def read(self) -> bytes:
        """Return the bytes that have arrived from the rig.

        Raises
        ------
        UnpluggedError : the cable is unplugged
        """
        data = self.nano.read()
        self._cable.check(self._fault_time)
        return self._cable.carry(data, self._fault_time)

    def close(self) -> None:
        """Free the simulator."""
        self.nano.close()

    def _advance_tick(self) -> None:
        self._show_sensors()
        self.bench.advance(self._tick_s)
        self._run_nano()
        pulses = self.nano.pulses()
        if pulses:
            for pulse in pulses:
                self._ticks[pulse.servo] = pulse.ticks
            a, b, c = self._ticks
            self._set_pulses((a, b, c))
        if self._present[0]:
            self.bench.dlpf = self.nano.dlpf(self._sensors[0])
        self._tick += 1
        if self.bench.supply_dipped():
            self.nano.reset()

    def _show_sensors(self) -> None:
        bench = self.bench
        stick = bench.joystick_codes()
        self.nano.set_adc([*bench.potentiometer_codes(), 0, 0, *stick])
        bits = bench.switch_bits()
        self.nano.set_switches([bool(bits >> i & 1) for i in range(4)])
        present = bench.imu_present()
        for k, sensor in enumerate(self._sensors):
            if present[k] != self._present[k]:
                self.nano.plug_imu(sensor, present[k])
        self._present = present

    def _run_nano(self) -> None:
        """Run the program for a tick; the IMUs change their registers when they sample."""
        done = 0
        for age, k in self.bench.imu_updates():
            at = round(LOOP_US * (1.0 - age / self._tick_s))  # whole µs do not drift
            self.nano.advance_us(at - done)
            done = at
            imu = self.bench.imu_counts((age, age))[6 * k : 6 * k + 6]
            self.nano.set_imu_counts(self._sensors[k], imu[:3], imu[3:])
        self.nano.advance_us(LOOP_US - done)
