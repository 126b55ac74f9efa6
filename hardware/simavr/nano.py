"""The compiled firmware on a simulated ATmega328P (libsimavr), in lockstep with any plant.

libsimavr is under the GPL-3; the C file that uses it is kept separate in `hardware/simavr` and is
compiled into the user's cache when the first `SimulatedNano` is made.
"""

import ctypes
import hashlib
import shutil
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache as remember
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Self

from hardware.firmware.build import build_elf, cache, compile_with, missing_tools
from hardware.frames import HardwareError
from hardware.protocol import BAUD, constants

SHIM = Path(__file__).resolve().with_name("shim.c")
PACKAGES = "apt install gcc gcc-avr avr-libc simavr libsimavr-dev libelf-dev"
CYCLES_PER_US = constants.CLOCK_HZ // 1_000_000
HOLDER, BASE = 0, 1
_IMU_25_DEGREES = round((25 - 36.53) * 340)  # RM-MPU-6000A-00, 4.19
_CONFIG = 0x1A  # RM-MPU-6000A-00, 4.3: bits 0…2 are the low-pass setting
_SERIAL, _SERIAL_CHECK = 16, 0x5A  # address in the EEPROM, and initial value of its check byte
_BUFFER = 1 << 14
_PULSES = 64


class SimulatedNanoError(HardwareError):
    """The simulated Nano could not be built, or has stopped; the message is one line."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """One servo pulse at a pin.

    Attributes
    ----------
    time_us : rising edge on the simulated Nano's clock since power-up [µs]
    servo : 0 x, 1 y, 2 turntable
    ticks : width [0.5 µs]
    """

    time_us: float
    servo: int
    ticks: int


class _CPulse(ctypes.Structure):
    _fields_ = [
        ("cycle", ctypes.c_uint64),
        ("channel", ctypes.c_uint32),
        ("width", ctypes.c_uint32),
    ]


def missing() -> list[str]:
    """Return the missing packages and tools of `SimulatedNano`; empty if it can be made."""
    absent = missing_tools()
    absent += [tool for tool in ("gcc",) if shutil.which(tool) is None]
    if not Path("/usr/include/simavr/sim_avr.h").exists():
        absent.append("libsimavr-dev")
    return absent


def _build_shim() -> Path:
    digest = hashlib.sha256(SHIM.read_bytes()).hexdigest()[:8]
    library = cache() / f"simavr-shim-{digest}.so"
    if not library.exists():
        if absent := missing():
            raise SimulatedNanoError(f"the simulated Nano needs {', '.join(absent)}: {PACKAGES}")
        flags = ["-O2", "-Wall", "-Wextra", "-shared", "-fPIC"]
        compile_with(["gcc", *flags, str(SHIM), "-lsimavr", "-lelf"], library)
    return library


_SIGNATURES: dict[str, tuple[object, list[object]]] = {
    "open": (ctypes.c_void_p, [ctypes.c_char_p, ctypes.c_uint32]),
    "close": (None, []),
    "reset": (None, []),
    "boot": (None, [ctypes.c_uint32]),
    "cycle": (ctypes.c_uint64, []),
    "run_until": (ctypes.c_int, [ctypes.c_uint64]),
    "write": (ctypes.c_uint32, [ctypes.c_char_p, ctypes.c_uint32]),
    "read": (ctypes.c_uint32, [ctypes.c_char_p, ctypes.c_uint32]),
    "set_eeprom": (None, [ctypes.c_uint32, ctypes.c_char_p, ctypes.c_uint32]),
    "set_adc": (None, [ctypes.POINTER(ctypes.c_uint16)]),
    "set_pin_d": (None, [ctypes.c_uint32, ctypes.c_uint32]),
    "set_imu": (None, [ctypes.c_uint32, ctypes.c_char_p]),
    "plug_imu": (None, [ctypes.c_uint32, ctypes.c_uint32]),
    "hold_bus": (None, [ctypes.c_uint32]),
    "hang": (None, []),
    "imu_register": (ctypes.c_uint32, [ctypes.c_uint32, ctypes.c_uint32]),
    "pulses": (ctypes.c_uint32, [ctypes.POINTER(_CPulse), ctypes.c_uint32]),
}


@remember
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(_build_shim()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, f"nano_{name}")
        function.restype = result
        function.argtypes = arguments if name == "open" else [ctypes.c_void_p, *arguments]
    return library


class SimulatedNano:
    """A Nano with the rig's firmware: bytes and sensor values to bytes and servo pulses.

    Time passes in `advance_us` only; sensor values are held until they are set again.

    Parameters
    ----------
    elf : a built firmware; this tree's own when None
    serial : serial number in its EEPROM, u32; erased if omitted

    Raises
    ------
    SimulatedNanoError : tools are missing, or the file is not an AVR program
    FirmwareError : the firmware does not build
    """

    def __init__(self, elf: Path | None = None, serial: int | None = None) -> None:
        self._c = _library()
        self._elf = elf or build_elf()
        handle = self._c.nano_open(str(self._elf).encode(), BAUD)
        if not handle:
            raise SimulatedNanoError(f"{self._elf}: not a program for the ATmega328P")
        self._nano: int | None = handle
        self._until = 0  # [cycles]
        self._adc = (ctypes.c_uint16 * 8)()
        self._bytes = ctypes.create_string_buffer(_BUFFER)
        self._edges = (_CPulse * _PULSES)()
        for sensor in (HOLDER, BASE):
            self.set_imu_counts(sensor, (0, 0, 0), (0, 0, 0))
        if serial is not None:
            number = serial.to_bytes(4, "little")
            kept = bytes([*number, _SERIAL_CHECK ^ reduce(xor, number)])
            self._c.nano_set_eeprom(handle, _SERIAL, kept, len(kept))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the simulator; closing it twice is harmless."""
        if self._nano is not None:
            self._c.nano_close(self._nano)
            self._nano = None

    @property
    def time_us(self) -> float:
        """Time since power-up by the Nano's crystal [µs]."""
        return float(self._c.nano_cycle(self._open()) / CYCLES_PER_US)

    def advance_us(self, duration: float) -> None:
        """Run the program for `duration` µs of its clock, rounded to a cycle of 1/16 µs.

        Rounding does not accumulate for whole µs.

        Raises
        ------
        SimulatedNanoError : the program has crashed or ended
        """
        self._until += round(duration * CYCLES_PER_US)
        if self._c.nano_run_until(self._open(), self._until):
            raise SimulatedNanoError(f"{self._elf.name} stopped at {self.time_us:.0f} µs")

    def reset(self) -> None:
        """Pull the reset line, as opening the port of a real Nano does; the clock continues."""
        self._c.nano_reset(self._open())

    def boot(self, r2: int) -> None:
        """Reset through a bootloader that clears MCUSR and leaves a value in r2."""
        self._c.nano_boot(self._open(), r2)

    def write(self, data: bytes) -> int:
        """Send bytes at 20 µs each, beginning now; return how many the queue had room for."""
        return int(self._c.nano_write(self._open(), data, len(data)))

    def read(self) -> bytes:
        """Return the bytes that have arrived since the last call."""
        count = self._c.nano_read(self._open(), self._bytes, _BUFFER)
        return ctypes.string_at(self._bytes, count)

    def pulses(self) -> list[Pulse]:
        """Return the servo pulses since the last call: x and y that began, D3 that ended."""
        pulses: list[Pulse] = []
        while count := self._c.nano_pulses(self._open(), self._edges, _PULSES):
            pulses += [
                Pulse(edge.cycle / CYCLES_PER_US, edge.channel, edge.width)
                for edge in self._edges[:count]
            ]
        return pulses

    def set_adc(self, counts: Sequence[int]) -> None:
        """Set the ADC codes of A0…A7.

        Parameters
        ----------
        counts : eight of 0…1023; potentiometers x_a, x_b, y_a, y_b are 0…3, the joystick 6 and 7
        """
        self._adc[:] = [min(max(int(count), 0), constants.ADC_LEVELS - 1) for count in counts]
        self._c.nano_set_adc(self._open(), self._adc)

    def set_switches(self, closed: Sequence[bool]) -> None:
        """Close or open the limit switches +x, −x, +y, −y."""
        for pin, shut in zip(constants.SWITCH_PINS, closed, strict=True):
            self._c.nano_set_pin_d(self._open(), pin, not shut)

    def set_imu_counts(
        self, sensor: int, gyro: Sequence[int], accelerometer: Sequence[int]
    ) -> None:
        """Set the reading of an MPU6050; a read in progress still returns the previous one.

        Parameters
        ----------
        sensor : HOLDER or BASE
        gyro, accelerometer : three counts each, −32768…32767
        """
        reading = struct.pack(">7h", *accelerometer, _IMU_25_DEGREES, *gyro)
        self._c.nano_set_imu(self._open(), sensor, reading)

    def plug_imu(self, sensor: int, present: bool) -> None:
        """Disconnect a sensor from the bus, or connect it: asleep, as after power-up."""
        self._c.nano_plug_imu(self._open(), sensor, present)

    def hold_bus(self, held: bool) -> None:
        """Hold SDA, so that no I²C transaction ends, or release it."""
        self._c.nano_hold_bus(self._open(), held)

    def hang(self) -> None:
        """Put the program into an endless loop with interrupts off."""
        self._c.nano_hang(self._open())

    def imu_register(self, sensor: int, register: int) -> int:
        """Return a register of an MPU6050 as the firmware left it."""
        return int(self._c.nano_imu_register(self._open(), sensor, register))

    def dlpf(self, sensor: int) -> int:
        """Return the low-pass setting of an MPU6050, 0…6, as the firmware left it."""
        return self.imu_register(sensor, _CONFIG) & 7

    def _open(self) -> int:
        if self._nano is None:
            raise SimulatedNanoError("the simulated Nano has been closed")
        return self._nano
