"""What the desk's commands can be told: rig, calibrate, mirror."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from twin.config.runs import Run
from twin.config.seats import is_rig
from twin.config.types import Flag, Kind
from twin.errors import TwinError


@dataclass(frozen=True)
class Rig:
    """Serve a simulated rig in real time, to this machine only, until it is interrupted."""

    kind: Kind = "emulator"
    """The firmware's behaviour in Python, or the real firmware on a simulated Nano."""
    port: int | None = None
    """TCP port on 127.0.0.1, 0 for a free one; a pseudo-terminal without it."""
    link: Path | None = None
    """Name to give the pseudo-terminal, for example /tmp/rig."""
    scene: Literal["bench", "turntable"] = "bench"
    """What it stands on: clamped, or on a base that its third servo turns."""
    fault: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """TARGET:KIND[:VALUE][@START[-END]], for example potentiometer_x_a:glitch:0.2. Repeatable."""
    unit: int | None = None
    """Which of many rigs, every tolerance drawn; the rig exactly as drawn without it."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE, any named parameter of the mechanism. Repeatable."""
    seed: int = 0
    """Of the sensors' noise."""
    duration_s: float | None = None
    """How long to serve."""
    json: Flag = False
    """Print where it is served as one JSON object."""


@dataclass(frozen=True)
class Calibrate:
    """Drive a rig to its four limit switches and write what its pulses and readings mean."""

    gimbal: str = "emulator"
    """The rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    out: Path = Path("calibration.json")
    """File to write."""
    switch_deg: tuple[float, float, float, float] | None = None
    """Angles at which switches +x, -x, +y, -y close; those of the printed calibration rig
    without it."""
    repeats: int = 3
    """Approaches per switch and place of the other servo."""
    fault: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """What is wrong with a simulated rig. Repeatable."""
    unit: int | None = None
    """Which of many simulated rigs; the rig exactly as drawn without it."""
    seed: int = 0
    """Of a simulated rig's noise, and of the approaches."""
    json: Flag = False
    """Print the calibration as one JSON object instead of a summary."""


@dataclass(frozen=True)
class Mirror(Run):
    """Let the MuJoCo gimbal follow a rig's live readings, or those on a tape, and record both."""

    scene: str = "bench"
    """A shipped scene, or an MJCF file."""
    gimbal: str = "emulator"
    """The rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    steer: Literal["keys", "joystick"] | None = None
    """Steer with the arrow keys (space: zero, q: end) or the rig's joystick; only watch without
    it."""
    tape: Path | None = None
    """Follow a recorded run (.rrd) instead of a rig, as fast as it goes unless --clock wall."""
    duration_s: float | None = None
    """How long; until it is interrupted without it."""
    serve: int | None = None
    """Port on this machine where the Rerun viewer may watch live."""
    dt: float | None = 0.0005
    """Physics step [s]."""
    control_hz: float = 2000.0
    """Rate at which the rig is looked at."""

    def __post_init__(self) -> None:
        """Refuse what fits nothing.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().__post_init__()
        if self.tape is None and not is_rig(self.gimbal):
            raise TwinError(
                f"--gimbal {self.gimbal}: twin mirror follows a rig (emulator, firmware or a"
                " port) or a --tape"
            )
        if self.tape is not None and self.steer is not None:
            raise TwinError(f"--steer {self.steer}: a tape cannot be steered")
        if self.duration_s is not None and not self.duration_s > 0:
            raise TwinError(f"--duration-s {self.duration_s}: must be greater than zero")

    @property
    def real_time(self) -> bool:
        """Whether the run keeps pace with the wall clock; only a tape may go faster."""
        return self.clock == "wall" or (self.clock is None and self.tape is None)
