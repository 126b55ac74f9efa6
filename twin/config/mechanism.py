"""Settings of `twin mechanism`."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal

from twin.config.options import Output
from twin.config.types import POSITIONAL, Range
from twin.errors import TwinError


@dataclass(frozen=True)
class Mechanism(Output):
    """Show or check a gimbal mechanism: mobility, workspace, resolution, torque, clearances."""

    group: ClassVar[str] = "mechanism"
    effective = MappingProxyType(
        {
            "load_g": ("action", ("show", "check", "search")),
            "gap_mm": ("action", ("check", "search")),
            "wall_mm": ("action", ("search",)),
            "stroke_deg": ("action", ("search",)),
        }
    )

    action: Annotated[Literal["show", "check", "build", "search"], POSITIONAL]
    """show: print mobility, workspace, gain, coupling, resolution and torque; check: measure the
    clearances over the workspace too, and end with exit code 1 if a limit is not met; build: write
    the MJCF and the printable parts of a description; search: find a mechanism that fits a tube
    and a motor, and write its description."""
    file: Annotated[Path | None, POSITIONAL] = None
    """MJCF file of the mechanism or its description (.toml); the reference mechanism if omitted."""
    _: KW_ONLY
    load_g: Annotated[float, Range(0.0, 100.0, "g")] = 1.0
    """Acceleration across the tube that the servos must hold the motor against [g]."""
    gap_mm: Annotated[float, Range(0.0, 10.0, "mm")] = 0.3
    """Smallest clearance that `check` and `search` accept [mm]."""
    tube_mm: Annotated[float, Range(10.0, 500.0, "mm")] | None = None
    """Outer diameter of the tube that `search` must fit [mm]."""
    wall_mm: Annotated[float, Range(0.1, 10.0, "mm")] = 0.8
    """Wall of that tube [mm]."""
    motor_mm: Annotated[float, Range(6.0, 400.0, "mm")] | None = None
    """Diameter of the motor that it must carry [mm]; the reference motor's length, its mass in
    proportion to the cross-section."""
    motor: Path | None = None
    """Motor file, or FILE:NAME, whose diameter, length and masses `search` takes, in place of
    `--motor-mm`."""
    stroke_deg: Annotated[float, Range(1.0, 15.0, "°")] = 8.0
    """Gimbal angle either way that it must command; the stops are 2° beyond [°]."""
    out: Path | None = None
    """File that `build` (.xml, its parts in a folder of that name) or `search` (.toml) writes;
    in runs/ if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect, and actions without what they need.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        motors = (self.motor_mm is not None) + (self.motor is not None)
        if self.action == "search":
            if self.tube_mm is None or motors != 1 or self.file is not None:
                raise TwinError(
                    "twin mechanism search: needs --tube-mm and one of --motor and --motor-mm, no"
                    " file"
                )
            return
        if self.tube_mm is not None or motors:
            raise TwinError(
                "--tube-mm, --motor and --motor-mm: only `twin mechanism search` uses them"
            )
        if self.action == "build":
            if self.file is None or self.file.suffix.lower() != ".toml":
                raise TwinError("twin mechanism build: needs a description (.toml)")
        elif self.out is not None:
            raise TwinError(f"--out: `twin mechanism {self.action}` writes no file")


@dataclass(frozen=True)
class Meshes(Output):
    """Write the printable parts of a mechanism (STL, millimetres)."""

    group: ClassVar[str] = "mechanism"

    _: KW_ONLY
    mechanism: Path | None = None
    """MJCF file of the mechanism or its description (.toml); the reference mechanism if omitted."""
    out: Path | None = None
    """Folder for the parts; runs/parts if omitted."""
