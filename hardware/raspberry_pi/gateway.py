"""A Raspberry Pi as a rig: the firmware's behaviour over its PWM and buses, on loopback TCP."""

import time
from collections.abc import Callable

from hardware.emulator.device import Device, Sample
from hardware.emulator.server import Port
from hardware.protocol import Board, constants
from hardware.raspberry_pi.pwm import KernelPwm
from hardware.raspberry_pi.sensors import Bus, Imu, Mcp3008

PORT = 5555
BUILD = 0x5249_0100  # "RI", version 1.0: the gateway is Python, there is no image to hash
TICK_US = 1000
_CENTRE = constants.ADC_LEVELS // 2
_SLEEPLESS_US = 200_000  # after a longer pause the deadlines start anew


class Gateway:
    """Serves one host at a time.

    Parameters
    ----------
    pwm : servo outputs
    bus : I²C bus with the IMUs
    port : where the host connects
    adc : potentiometers and joystick; None reads as open wires
    clock : monotonic nanoseconds
    """

    def __init__(
        self,
        pwm: KernelPwm,
        bus: Bus,
        port: Port,
        adc: Mcp3008 | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.pwm, self.port, self.adc = pwm, port, adc
        self.device = Device(Board.RASPBERRY_PI, BUILD)
        self._imus = [Imu(bus, address) for address in constants.IMU_ADDRESSES]
        self._counts = [0] * 12
        self._read_us = [0, 0]
        self._clock = clock
        self._start = clock()
        self._report_us = 0
        self._stopped = False
        self.pwm.set(self.device.pulse)
        self.device.hello()

    def now_us(self) -> int:
        """Return the device's clock [µs]."""
        return (self._clock() - self._start) // 1000

    def step(self) -> None:
        """Take what the host sent, drive the servos, and report when it is time."""
        data = self.port.read()
        now = self.now_us()
        if data:
            self.device.receive(data, now, now)
        self.device.update(now)
        self.pwm.set(self.device.pulse)
        if now >= self._report_us:
            period = 1000 * self.device.config.telemetry_period_ms
            self._report_us = max(self._report_us + period, now - period)
            self._report()
        if self.device.transmit:
            self.port.write(bytes(self.device.transmit))
            self.device.transmit.clear()

    def _report(self) -> None:
        fresh = [self._read(k) for k in (0, 1)]
        now = self.now_us()
        code = [self.adc.read(channel) for channel in range(6)] if self.adc else [0] * 6
        age = [min(now - t, 0xFFFF) for t in self._read_us]
        self.device.report(
            Sample(
                device_us=now,
                frame_us=now % constants.PWM_PERIOD_US,
                potentiometer=(code[0], code[1], code[2], code[3]),
                imu=self._counts,
                imu_age_us=(age[0], age[1]),
                imu_fresh=(fresh[0], fresh[1]),
                pulse=self.device.pulse,
                switches=0,
                joystick=(code[4], code[5]) if self.adc else (_CENTRE, _CENTRE),
            )
        )

    def _read(self, k: int) -> bool:
        counts = self._imus[k].read(self.device.config.dlpf)
        if counts is None:
            return False
        self._counts[6 * k : 6 * k + 6] = counts
        self._read_us[k] = self.now_us()
        return True

    def stop(self) -> None:
        """End `run` after its present step; for another thread or a signal."""
        self._stopped = True

    def run(self) -> None:
        """Serve until `stop`; then the servos go limp and the port closes."""
        deadline = self.now_us()
        try:
            while not self._stopped:
                self.step()
                deadline += TICK_US
                wait = deadline - self.now_us()
                if wait < -_SLEEPLESS_US:
                    deadline = self.now_us()
                elif wait > 0:
                    time.sleep(wait * 1e-6)
        finally:
            self.pwm.close()
            self.port.close()
