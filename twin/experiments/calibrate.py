"""`twin calibrate`: drive a rig to its limit switches, solve, write the file."""

import secrets
from dataclasses import dataclass
from math import degrees, radians, sqrt
from typing import Any

from hardware.calibration import Calibration, CalibrationError, CalibrationRig, Procedure, write
from hardware.calibration.file import to_dict
from hardware.protocol import constants
from twin import status
from twin.config import Calibrate
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.config.seats import is_port
from twin.errors import TwinError
from twin.hil import RigGimbal, RigOptions, mechanism_map, open_rig, switch_angles
from twin.plant.compiled import compiled
from twin.plant.model.model import ModelConfig, load

COMMAND_NS = 10_000_000
STEP_NS = 2_000_000
NAMING_NS = 1_000_000_000
PATIENCE_NS = 3_000_000_000  # without a frame: cable out, or a rig that has died
FIGURE = 1.96  # standard deviations of a 95 % interval
REPORTED = (0.0, radians(8.0))  # angles at which the map's uncertainty is given


@dataclass(frozen=True)
class CalibrationResult(Result):
    """A calibration and where it was written.

    Attributes
    ----------
    file : written
    calibration : result of the run
    duration_s : rig time
    gimbal : the rig's seat
    unit : serial number of a simulated rig that was asked for
    """

    file: str
    calibration: Calibration
    duration_s: float
    gimbal: str = "emulator"
    unit: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """The file's content, its path, and the map's uncertainty at 0 and 8° on both axes."""
        sigma = [[degrees(s) for s in self.calibration.sigma((a, a))] for a in REPORTED]
        return {
            "file": self.file,
            "duration_s": self.duration_s,
            "angle_sigma_deg": sigma,
            **to_dict(self.calibration),
        }

    def rows(self) -> Rows:
        """The calibration as a table, with 95 % intervals."""
        c = self.calibration
        rows = [("rig", f"{c.rig:08x}, calibrated in {self.duration_s:.0f} s")]
        for k, axis in enumerate("xy"):
            zero = FIGURE * sqrt(c.zero_covariance[k][k]) * 1e6
            gain, slip = degrees(c.matrix[k][k]) * 1e-6, degrees(c.matrix[k][1 - k]) * 1e-6
            error = FIGURE * degrees(sqrt(c.matrix_covariance[3 * k][3 * k])) * 1e-6
            play = FIGURE * degrees(c.hysteresis_sigma[k])
            again = degrees(c.repeatability[k])
            loose = f"{_positive(degrees(c.hysteresis[k]), play)}, repeats within {again:.2f}°"
            rows += [
                (f"zero {axis}", f"{c.zero[k] * 1e6:.1f} ± {zero:.1f} µs"),
                (f"servo {axis}", f"{gain * 1e3:.2f} ± {error * 1e3:.2f} °/ms"),
                (f"from servo {'yx'[k]}", f"{slip * 1e3:.2f} °/ms"),
                (f"play {axis}", loose),
                (f"between switches {axis}", f"{degrees(c.deviation[k]):.2f}° rms off the map"),
                (f"commanded {axis}", self._uncertainty(k)),
            ]
        if c.minimal:
            rows.append(("potentiometers", "none: the IMU on the holder shows the angles"))
            rows += [
                (f"accelerometer {axis}", f"zero {degrees(p.zero):.2f}°, scale {p.gain:.3f}")
                for axis, p in zip("xy", c.potentiometers[::2], strict=True)
            ]
        for name, p in (
            () if c.minimal else zip(("x_a", "x_b", "y_a", "y_b"), c.potentiometers, strict=True)
        ):
            line = f"zero {p.zero:.4f}, {degrees(p.gain):.1f}° over its track"
            rows.append((f"potentiometer {name}", line))
        bias = ", ".join(f"{degrees(b):.2f}" for b in c.gyro.bias)
        rows.append(("gyro bias", f"{bias} °/s"))
        if is_port(self.gimbal):
            rows.append(("timing", "not judged: the board itself dates readings and pulses"))
        if c.note:
            rows.append(("note", c.note))
        rig = self.gimbal if self.unit is None else f"{self.gimbal} --unit {self.unit}"
        command = f"twin mirror --gimbal {rig} --calibration {self.file}"
        return [*rows, ("calibration", self.file), ("", command)]

    def _uncertainty(self, axis: int) -> str:
        sigmas = (FIGURE * degrees(self.calibration.sigma((a, a))[axis]) for a in REPORTED)
        return ", ".join(
            f"± {s:.2f}° at {degrees(a):g}°" for a, s in zip(REPORTED, sigmas, strict=True)
        )


def _positive(value: float, half: float) -> str:
    """A figure [°] that cannot be negative, with half its interval: a limit where that holds 0."""
    return f"{value:.2f} ± {half:.2f}°" if value > half else f"below {max(value, 0.0) + half:.2f}°"


def calibrate(config: Calibrate) -> CalibrationResult:
    """Calibrate a rig and write the file; nothing is written unless the result is plausible.

    Raises
    ------
    CalibrationError : a switch, servo or sensor does not do what it should; says which
    TwinError, HardwareError : the rig cannot be opened, or the file cannot be written
    """
    writable(config.out, ".json", force=config.force)
    rig = _rig(config)
    options = RigOptions(
        seat=config.gimbal,
        unit=config.unit,
        faults=config.fault,
        seed=config.seed,
        fuse=False,
        minimal=config.minimal,
        track=radians(config.potentiometer_deg),
        mechanism=config.mechanism,
    )
    with compiled(), open_rig(options, None) as seat:
        began = seat.now_ns()
        try:
            result = _drive(seat, rig)
        except KeyboardInterrupt as interrupt:
            interrupt.add_note("no file was written, the servos are sent to neutral")
            raise
        finally:
            seat.rig.neutral()
        duration = (seat.now_ns() - began) * 1e-9
    write(config.out, result)
    return CalibrationResult(str(config.out), result, duration, config.gimbal, config.unit)


def _rig(config: Calibrate) -> CalibrationRig:
    bench = load(ModelConfig(scene="bench", mechanism=config.mechanism)).mj
    if config.switch_deg is None:
        angles = switch_angles(bench)
    else:
        a, b, c, d = (radians(v) for v in config.switch_deg)
        angles = (a, b, c, d)
        if not (0 < a < 1 and -1 < b < 0 < c < 1 and -1 < d < 0):
            raise TwinError(
                f"--switch-deg {' '.join(f'{v:g}' for v in config.switch_deg)}: must be the angles"
                " of +x, -x, +y, -y, such as 9 -9 9 -9"
            )
    return CalibrationRig(
        switch_angle=angles,
        repeats=config.repeats,
        seed=config.seed,
        linearisation=mechanism_map(bench).linearisation,
        minimal=config.minimal,
        track=radians(config.potentiometer_deg),
    )


def _numbered(seat: RigGimbal) -> int:
    """Serial number of the board; one that has none is given one, which it keeps."""
    end = seat.now_ns() + NAMING_NS
    while seat.rig.hello is None or not seat.rig.hello.serial:
        seat.rig.name(secrets.randbelow(constants.SERIAL_BLANK - 1) + 1)
        for _ in range(50):
            seat.wait(STEP_NS)
            seat.rig.poll()
        if seat.now_ns() > end:
            raise CalibrationError(
                "the board has no serial number and takes none; flash the firmware in"
                " hardware/firmware anew"
            )
    return seat.rig.hello.serial


def _drive(seat: RigGimbal, rig: CalibrationRig) -> Calibration:
    procedure = Procedure(rig, _numbered(seat))
    session = seat.rig.session
    received = seat.now_ns()
    next_command = received
    status.say(lambda: f"calibrating {procedure.progress:4.0%}")
    while not procedure.done:
        seat.wait(STEP_NS)
        now = seat.now_ns()
        for frame in seat.rig.poll():
            pulses = procedure.step(frame)
            received = now
        if received == now and now >= next_command:
            seat.rig.send_pulses(*pulses)
            next_command = now + COMMAND_NS
        if seat.rig.session != session:
            raise CalibrationError(
                f"the connection was lost at {procedure.progress:.0%} of the calibration"
                f" ({seat.rig.reason}{f', {seat.rig.started}' if seat.rig.started else ''});"
                " check cable and supply and start again"
            )
        if now - received > PATIENCE_NS:
            raise CalibrationError(
                f"the rig fell silent at {procedure.progress:.0%} of the calibration; check its"
                " cable and start again"
            )
    return procedure.result()
