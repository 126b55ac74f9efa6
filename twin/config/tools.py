"""Settings of export, viewer and doctor."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from twin.config.base import Settings
from twin.config.options import Output
from twin.config.types import POSITIONAL, Flag, Port, Range
from twin.errors import TwinError


@dataclass(frozen=True)
class Export(Output):
    """Write a recording in the format of another program.

    csv, parquet, mat: all signals in SI and the texts, read again equal wherever a recording is
    expected, and by pandas or SciPy. mcap: signals as messages. kml: path of a flight on a map.
    glb, usd: the scene with its motion, for example for Blender.
    """

    group: ClassVar[str] = "export"

    recording: Annotated[Path, POSITIONAL]
    """Recording (.rrd), or its export as csv, parquet or mat, without a scene for glb and usd."""
    _: KW_ONLY
    to: Literal["csv", "parquet", "mat", "mcap", "kml", "glb", "usd"] = "csv"
    """Format; mcap and usd need the extra of that name."""
    latitude_deg: Annotated[float, Range(-90.0, 90.0, "deg")] = 0.0
    """Latitude of the launch site, for kml."""
    longitude_deg: Annotated[float, Range(-180.0, 180.0, "deg")] = 0.0
    """Longitude of the launch site, for kml."""
    height_m: Annotated[float, Range(-500.0, 9000.0, "m")] = 0.0
    """Height of the launch site above the sea, for kml."""
    out: Path | None = None
    """File to write; the name of the recording with the ending of the format if omitted."""

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return (self.to,) if self.to in ("mcap", "usd") else ()


@dataclass(frozen=True)
class View(Settings):
    """Open recordings in the Rerun viewer; several are overlaid, each from its time zero."""

    group: ClassVar[str] = "viewer"

    recordings: Annotated[tuple[Path, ...], POSITIONAL]
    """Recordings (.rrd)."""
    _: KW_ONLY
    web: Flag = False
    """Serve it to a browser on this machine instead of opening a window."""
    port: Annotated[Port, Range(1, 65535)] = 9090
    """Port of `--web` on 127.0.0.1."""


@dataclass(frozen=True, kw_only=True)
class Doctor(Settings):
    """Report what this machine provides, what is missing, and what to do about it.

    With `--vehicle` or `--mechanism`, report on that file instead; with `--port`, on a board.
    """

    group: ClassVar[str] = "doctor"

    vehicle: Path | None = None
    """Description (TOML) or MJCF file of a vehicle: report mass, thrust to weight, static margin,
    fit of its coefficients to its geometry."""
    mechanism: Path | None = None
    """MJCF file of a gimbal mechanism: report mobility, workspace and reach."""
    port: str | None = None
    """Port of a board, such as /dev/ttyUSB0 or COM3: report firmware, IMUs, potentiometers and
    switches as it answers, without moving the servos."""
    compile: Flag = False
    """Compile now what the verbs otherwise compile on first use, about 30 s."""
    json: Flag = False
    """Print the findings as one JSON object."""

    def validate(self) -> None:
        """Refuse settings without effect.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        others = self.vehicle is not None or self.mechanism is not None or self.compile
        if self.port is not None and others:
            raise TwinError(f"--port {self.port}: reports on a board only, without other flags")
