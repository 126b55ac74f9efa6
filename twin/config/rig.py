"""Settings of the verbs about rigs: rig, calibrate, mirror."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from twin.config.base import flag
from twin.config.options import Output, Parameters, Run, SimulatedRig
from twin.config.seats import is_rig
from twin.config.types import TRANSFER_FUNCTION, Duration, Flag, Frequency, Kind, Port, Range, Seed
from twin.config.types import Step as TimeStep
from twin.errors import TwinError

Track = Annotated[float, Range(90.0, 360.0, "°")]
TRACK_DEG = 240.0


@dataclass(frozen=True, kw_only=True)
class Rig(SimulatedRig, Parameters):
    """Serve a simulated rig in real time on a port of this machine, until interrupted."""

    group: ClassVar[str] = "service"

    kind: Kind = "emulator"
    """A rig emulated in Python, or the real firmware on a simulated Arduino Nano (firmware)."""
    port: Port | None = None
    """TCP port on 127.0.0.1, 0 for a free one; a pseudo-terminal if omitted."""
    link: Path | None = None
    """Symbolic link to make to the pseudo-terminal while it is served, for example /tmp/rig."""
    scene: Literal["bench", "turntable"] = "bench"
    """Clamped (bench), or on a base that a third servo turns (turntable)."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; the reference mechanism if omitted."""
    seed: Seed = 0
    """Random seed of the sensor noise."""
    minimal: Flag = False
    """Serve a rig without potentiometers, with one IMU on the holder."""
    potentiometer_deg: Track = TRACK_DEG
    """Travel of the potentiometers' tracks [°]."""
    duration_s: Duration | None = None
    """Time to serve [s]; until interrupted if omitted."""
    json: Flag = False
    """Print the port as one JSON object."""

    def validate(self) -> None:
        """Refuse two ports at once, and a travel of potentiometers that are not there.

        Raises
        ------
        TwinError : the flags
        """
        super().validate()
        _has_tracks(minimal=self.minimal, track=self.potentiometer_deg)
        if self.port is not None and self.link is not None:
            raise TwinError("--link is the name of a pseudo-terminal; it excludes --port")


def _has_tracks(*, minimal: bool, track: float) -> None:
    if minimal and track != TRACK_DEG:
        raise TwinError("--potentiometer-deg is of potentiometers; it excludes --minimal")


OF_A_RIG = ("gimbal", "fault", "unit", "calibration", "no_check", "shadow", "shadow_set")
SwitchAngle = Annotated[float, Range(-45.0, 45.0, "°")]


@dataclass(frozen=True, kw_only=True)
class Calibrate(SimulatedRig, Output):
    """Drive a rig to its four limit switches and write its calibration file."""

    group: ClassVar[str] = "calibration"

    gimbal: str = "emulator"
    """Rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; the reference mechanism if omitted."""
    switch_deg: tuple[SwitchAngle, SwitchAngle, SwitchAngle, SwitchAngle] | None = None
    """Angles at which the switches +x, -x, +y and -y close [°]; those of the printed calibration
    frame if omitted."""
    minimal: Flag = False
    """The rig has no potentiometers: angles by the IMU on the holder. Later runs read this from the
    calibration file."""
    potentiometer_deg: Track = TRACK_DEG
    """Travel of the potentiometers' tracks by their data sheet [°], for example 300 or 333."""
    repeats: Annotated[int, Range(1, 100)] = 3
    """Number of approaches to each switch, at each of the other servo's positions."""
    seed: Seed = 0
    """Random seed: noise of a simulated rig, and order of the approaches."""
    out: Path = Path("calibration.json")
    """Calibration file to write."""

    def validate(self) -> None:
        """Refuse a travel of potentiometers that are not there.

        Raises
        ------
        TwinError : the flags
        """
        super().validate()
        _has_tracks(minimal=self.minimal, track=self.potentiometer_deg)


@dataclass(frozen=True, kw_only=True)
class Mirror(Run):
    """Let the simulated gimbal follow a rig's live readings, or a recording, and record both."""

    group: ClassVar[str] = "mirror"

    scene: str = "bench"
    gimbal: str = "emulator"
    """Rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    steer: Literal["keys", "joystick"] | None = None
    """Steer with the arrow keys (space: zero, q: end) or with the rig's joystick; only observe if
    omitted."""
    playback: Path | None = None
    """Follow this recording (.rrd) instead of a rig; as fast as possible unless `--clock wall`."""
    duration_s: Duration | None = None
    """Time to run [s]; until interrupted if omitted."""
    serve: Port | None = None
    """Port on this machine for a live Rerun viewer."""
    dt: TimeStep | None = 0.0005
    """Physics time step [s]."""
    control_hz: Frequency = 2000.0
    """Rate at which the rig is polled [Hz]."""

    def validate(self) -> None:
        """Refuse what is neither a rig nor a recording.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if self.playback is None and not is_rig(self.gimbal):
            raise TwinError(
                f"--gimbal {self.gimbal}: twin mirror needs a rig (emulator, firmware or a port)"
                " or --playback FILE"
            )
        if self.model is not None and self.shadow != TRANSFER_FUNCTION:
            raise TwinError(
                f"--model {self.model}: twin mirror simulates it beside the rig with --shadow"
                " transfer-function only"
            )
        if self.playback is not None:
            self._check_playback()

    def _check_playback(self) -> None:
        """Refuse what is of a rig: the recording takes its place."""
        if self.steer is not None:
            raise TwinError(f"--steer {self.steer}: a recording cannot be steered")
        for name in OF_A_RIG:
            if getattr(self, name) != getattr(Mirror, name):
                raise TwinError(f"{flag(name)}: needs a rig; --playback takes its place")

    @property
    def real_time(self) -> bool:
        """Whether the run keeps pace with the wall clock; only a playback may go faster."""
        return self.clock == "wall" or (self.clock is None and self.playback is None)
