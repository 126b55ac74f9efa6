"""MPU6050s on the Pi's I²C bus and, where there is one, an MCP3008 for the potentiometers.

Registers: InvenSense RM-MPU-6000A-00 revision 4.2. The Pi itself has no ADC.
"""

import threading
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from hardware.frames import HardwareError
from hardware.protocol import constants

SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG = 0x19, 0x1A, 0x1B, 0x1C
ACCEL_XOUT_H, PWR_MGMT_1, WHO_AM_I = 0x3B, 0x6B, 0x75
READING = 14  # accelerometer, temperature, gyro: three, one, three words
CLOCK_PLL_X = 1
FS_SEL_500, AFS_SEL_4 = 1 << 3, 1 << 3
assert constants.GYRO_RANGE_DPS == 500
assert constants.ACCELEROMETER_RANGE_G == 4

T = TypeVar("T")


class BusError(HardwareError):
    """The I²C or SPI bus cannot be used."""


class Bus(Protocol):
    """The part of `smbus2.SMBus` that is used."""

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one register."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read registers from one on."""


class Spi(Protocol):
    """The part of `spidev.SpiDev` that is used."""

    def xfer2(self, values: list[int]) -> list[int]:
        """Exchange bytes."""


def open_bus(number: int = 1) -> Bus:
    """Return the I²C bus of the Pi's header.

    Raises
    ------
    BusError : smbus2 is missing, the bus is off, or no permission
    """
    try:
        from smbus2 import SMBus
    except ImportError:
        raise BusError(
            "smbus2 is not installed: run `pip install '.[pi]'` in a clone of the project"
        ) from None
    try:
        bus: Bus = SMBus(number)
    except OSError as error:
        raise BusError(
            f"cannot open /dev/i2c-{number}: {error.strerror}; `sudo raspi-config nonint "
            "do_i2c 0` switches it on, group i2c may use it"
        ) from None
    return bus


class Imu:
    """One MPU6050; it is set up again after every failed read."""

    def __init__(self, bus: Bus, address: int) -> None:
        self.bus, self.address = bus, address
        self.dlpf = -1
        self.identity = 0

    def read(self, dlpf: int) -> tuple[int, int, int, int, int, int] | None:
        """Return gyro and accelerometer counts at a low-pass setting, None without an answer."""
        try:
            if dlpf != self.dlpf:
                self._set_up(dlpf)
            data = self.bus.read_i2c_block_data(self.address, ACCEL_XOUT_H, READING)
        except OSError:
            self.dlpf = -1
            return None
        if not any(data):  # asleep: a short dip of its supply has reset it
            self.dlpf = -1
            return None
        a, g = [_word(data, i) for i in (0, 2, 4)], [_word(data, i) for i in (8, 10, 12)]
        return g[0], g[1], g[2], a[0], a[1], a[2]

    def _set_up(self, dlpf: int) -> None:
        for register, value in (
            (PWR_MGMT_1, CLOCK_PLL_X),
            (CONFIG, dlpf),
            (GYRO_CONFIG, FS_SEL_500),
            (ACCEL_CONFIG, AFS_SEL_4),
            (SMPLRT_DIV, 0),
        ):
            self.bus.write_byte_data(self.address, register, value)
        self.identity = self.bus.read_i2c_block_data(self.address, WHO_AM_I, 1)[0]
        self.dlpf = dlpf


def _word(data: list[int], at: int) -> int:
    value = data[at] << 8 | data[at + 1]
    return value - 0x10000 if value & 0x8000 else value


class Mcp3008:
    """Eight 10-bit channels on SPI; 0…3 potentiometers, 4 and 5 joystick (datasheet DS21295D)."""

    def __init__(self, spi: Spi) -> None:
        self.spi = spi

    def read(self, channel: int) -> int | None:
        """Return the code of a channel, 0…1023, None when the bus fails."""
        try:
            answer = self.spi.xfer2([1, (8 + channel) << 4, 0])
        except OSError:
            return None
        return (answer[1] & 3) << 8 | answer[2]


def open_adc() -> Mcp3008 | None:
    """Return the MCP3008 on SPI 0.0, None when there is no SPI or spidev is not installed."""
    try:
        import spidev  # type: ignore[import-not-found,unused-ignore]

        spi = spidev.SpiDev()
        spi.open(0, 0)
        spi.max_speed_hz = 1_000_000
    except (ImportError, OSError):
        return None
    return Mcp3008(spi)


class Sampler(Generic[T]):
    """Reads a bus in a separate thread: the kernel takes a second to give up a stuck bus.

    Before `start` it reads in the caller's thread, for tests in lockstep.

    Parameters
    ----------
    read : reads one sample
    first : value of `latest` before the first sample
    """

    def __init__(self, read: Callable[[], T], first: T) -> None:
        self.latest = first
        self._read = read
        self._asked, self._ready = threading.Event(), threading.Event()
        self._ready.set()
        self._thread: threading.Thread | None = None
        self._stopped = False
        self._error: Exception | None = None

    @property
    def ready(self) -> bool:
        """Whether the latest sample is complete, in `latest`.

        Raises the exception that ended the thread, if any.
        """
        if self._error is not None:
            raise self._error
        return self._ready.is_set()

    def wait(self, seconds: float) -> None:
        """Wait until `ready`, at most `seconds` [s]."""
        self._ready.wait(seconds)

    def ask(self) -> None:
        """Start a sample, unless one is running."""
        if not self.ready:
            return
        self._ready.clear()
        self._asked.set()
        if self._thread is None:
            self._sample()

    def start(self) -> None:
        """Read in a daemon thread from now on."""
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread after its current sample."""
        self._stopped = True
        self._asked.set()

    def _serve(self) -> None:
        while self._asked.wait() and not self._stopped:
            try:
                self._sample()
            except Exception as error:  # raised again by `ready`
                self._error = error
                return

    def _sample(self) -> None:
        self._asked.clear()
        self.latest = self._read()
        self._ready.set()
