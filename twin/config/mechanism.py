"""Settings of `twin mechanism`."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from twin.config.options import Output
from twin.config.types import POSITIONAL, Range
from twin.errors import TwinError


@dataclass(frozen=True)
class Mechanism(Output):
    """Show or check a gimbal mechanism: mobility, workspace, resolution, torque, clearances."""

    group: ClassVar[str] = "mechanism"

    action: Annotated[Literal["show", "check"], POSITIONAL]
    """show: print mobility, workspace, gain, coupling, resolution and torque; check: measure the
    clearances over the workspace too, and end with exit code 1 if a limit is not met."""
    file: Annotated[Path | None, POSITIONAL] = None
    """MJCF file of the mechanism; the reference mechanism if omitted."""
    _: KW_ONLY
    load_g: Annotated[float, Range(0.0, 100.0, "g")] = 1.0
    """Acceleration across the tube that the servos must hold the motor against [g]."""
    gap_mm: Annotated[float, Range(0.0, 10.0, "mm")] = 0.3
    """Smallest clearance that `check` accepts [mm]."""

    def validate(self) -> None:
        """Refuse settings without effect.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if self.out is not None:
            raise TwinError("--out: `twin mechanism` writes no file")
