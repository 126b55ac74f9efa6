"""Whether the holder IMU answers while a rig is calibrated, and its readings change."""

from hardware.calibration.errors import CalibrationError
from hardware.frames import SensorFrame, Triple
from hardware.protocol import Flags

PATIENCE_US = 1_000_000  # an IMU that comes back is set up again sooner
HOLDER_IMU = int(Flags.HOLDER_IMU)  # an enum's `&` takes 1 µs


class ImuWatch:
    """Takes every frame; a bench without noise does not exist, so equal readings are none."""

    def __init__(self) -> None:
        self._answered: int | None = None  # device time of the last new reading [µs]
        self._changed = 0  # of the last one that differed from the one before [µs]
        self._reading: tuple[Triple, Triple] | None = None

    def check(self, frame: SensorFrame) -> None:
        """Take a frame.

        Raises
        ------
        CalibrationError : no new reading for a second, or the same one all the time
        """
        now = frame.device_us
        if self._answered is None:
            self._answered = self._changed = now
        if frame.flags & HOLDER_IMU:
            self._answered = now
            reading = frame.gyro, frame.accelerometer
            if reading != self._reading:
                self._reading, self._changed = reading, now
        if now - self._answered > PATIENCE_US:
            raise CalibrationError(
                "the holder IMU (0x68) does not answer; check VCC, GND, SDA, SCL and AD0"
            )
        if now - self._changed > PATIENCE_US:
            raise CalibrationError(
                "the holder IMU (0x68) repeats one reading; switch the rig off and on again"
            )
