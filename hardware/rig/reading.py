"""Counts on the wire to SI units, by the scales the device gave in HELLO."""

from math import radians
from typing import cast

from hardware.frames import SensorFrame, Triple
from hardware.parts import STANDARD_GRAVITY
from hardware.protocol import Hello, Telemetry
from hardware.protocol.messages import IMU_COUNTS


class Converter:
    """Turns one device's telemetry into sensor frames."""

    def __init__(self, hello: Hello) -> None:
        self.tick = hello.tick_ns * 1e-9
        self.gyro = radians(hello.gyro_range_dps) / IMU_COUNTS
        self.accelerometer = hello.accelerometer_range_g * STANDARD_GRAVITY / IMU_COUNTS
        self.adc = 1.0 / hello.adc_levels

    def frame(self, t: Telemetry, time_ns: int, device_us: int) -> SensorFrame:
        """Return a telemetry frame in SI units.

        Parameters
        ----------
        t : as received
        time_ns : host time of the sample [ns]
        device_us : device time of the sample, unwrapped [µs]
        """
        adc, gyro, acc = self.adc, self.gyro, self.accelerometer
        p = t.potentiometer
        return SensorFrame(
            time_ns=time_ns,
            device_us=device_us,
            potentiometer=(p[0] * adc, p[1] * adc, p[2] * adc, p[3] * adc),
            gyro=_scaled(t.holder_gyro, gyro),
            accelerometer=_scaled(t.holder_accelerometer, acc),
            base_gyro=_scaled(t.base_gyro, gyro),
            base_accelerometer=_scaled(t.base_accelerometer, acc),
            pulse=_scaled(t.pulse, self.tick),
            switches=cast(
                tuple[bool, bool, bool, bool], tuple(bool(t.switches >> i & 1) for i in range(4))
            ),
            joystick=(2 * adc * t.joystick[0] - 1, 2 * adc * t.joystick[1] - 1),
            flags=t.flags,
        )

    def ticks(self, pulse: float) -> int:
        """Return a pulse width [s] in the device's ticks."""
        return round(pulse / self.tick)


def _scaled(values: tuple[int, int, int], scale: float) -> Triple:
    return values[0] * scale, values[1] * scale, values[2] * scale


def unwrap(previous: int, stamp: int) -> int:
    """Return a 32-bit device stamp [µs] as the nearest continuation of an unwrapped one [µs]."""
    step = (stamp - previous) & 0xFFFF_FFFF
    return previous + (step if step < 0x8000_0000 else step - 0x1_0000_0000)
