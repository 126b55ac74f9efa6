"""Settings of the verbs about a vehicle's model: vehicle, parameters."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from twin.config.options import Output, Parameters
from twin.config.types import POSITIONAL, Flag
from twin.errors import TwinError


@dataclass(frozen=True)
class Vehicle(Output):
    """Show a vehicle's masses and stability, build its MJCF, or import a design."""

    group: ClassVar[str] = "vehicle"

    action: Annotated[Literal["show", "build", "import"], POSITIONAL]
    """show: print mass, inertia, centre of pressure and static margin; build: write the MJCF of a
    description with every coefficient and its source; import: write the description of an
    OpenRocket design."""
    file: Annotated[Path, POSITIONAL]
    """Description of the vehicle (TOML) or OpenRocket design (.ork); `show` also takes an MJCF
    file, `import` only a design."""
    _: KW_ONLY
    motor: Path | None = None
    """Motor file, or FILE:NAME, in place of the one that the vehicle names."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism, in place of the one that the vehicle names."""
    out: Path | None = None
    """File that `build` (.xml) or `import` (.toml) writes, runs/NAME.xml or runs/NAME.toml if
    omitted; `show` draws a description from the side (.svg)."""

    def validate(self) -> None:
        """Refuse files of another kind.

        Raises
        ------
        TwinError : the file and what it must be
        """
        super().validate()
        described = self.file.suffix.lower() in (".toml", ".ork")
        if self.action == "build" and not described:
            raise TwinError(f"twin vehicle build {self.file}: must be a description (.toml, .ork)")
        if self.action == "import" and self.file.suffix.lower() != ".ork":
            raise TwinError(f"twin vehicle import {self.file}: must be an OpenRocket design (.ork)")
        if self.action == "import" and self.mechanism is not None:
            raise TwinError(
                "--mechanism: an OpenRocket design has none; add `gimbal` to the result"
            )
        if self.action == "show" and self.out is not None and not described:
            raise TwinError(f"--out: draws descriptions (.toml, .ork); {self.file} is not one")


@dataclass(frozen=True)
class ListParameters(Parameters):
    """List every name that `--set` takes, with its value, unit and meaning."""

    group: ClassVar[str] = "list"

    words: Annotated[tuple[str, ...], POSITIONAL] = ()
    """Only parameters whose name or meaning has all of these words, for example wind."""
    _: KW_ONLY
    scene: str = "flight"
    """Scene: flight, bench, turntable, or an MJCF file."""
    vehicle: Path | None = None
    """Description (TOML) or MJCF file of the vehicle; the reference vehicle if omitted."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; the reference mechanism if omitted."""
    json: Flag = False
    """Print one JSON object: value, unit and meaning by name."""
