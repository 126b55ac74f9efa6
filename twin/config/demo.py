"""Settings of `twin demo`."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from twin.config.base import Settings
from twin.config.seats import SIMULATED, is_port, is_rig
from twin.config.types import Flag, Seed, Unit
from twin.errors import TwinError


@dataclass(frozen=True, kw_only=True)
class Demo(Settings):
    """Calibrate, measure, model and fly a gimbal; leaves a folder with one page that explains it.

    The rig is a simulated one unless `--gimbal` names a port; then its servos move.
    """

    group: ClassVar[str] = "demo"

    gimbal: str = "emulator"
    """Rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    unit: Unit | None = None
    """Serial number of a simulated rig with random tolerances; 3 if omitted."""
    calibration: Path | None = None
    """Calibration file (JSON) of the rig; it is driven to its limit switches if omitted."""
    seed: Seed = 0
    """Random seed."""
    out: Path | None = None
    """Folder to create; runs/demo-DATE-TIME if omitted."""
    json: Flag = False
    """Print the results as one JSON object."""

    def validate(self) -> None:
        """Refuse what is not a rig.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if not is_rig(self.gimbal):
            raise TwinError(f"--gimbal {self.gimbal}: must be a rig: emulator, firmware or a port")
        if is_port(self.gimbal) and self.unit is not None:
            raise TwinError(f"--unit {self.unit}: is for simulated rigs; --gimbal is a port")

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return ("report",)

    @property
    def serial(self) -> int | None:
        """Serial number of the simulated rig; None on a port."""
        return (3 if self.unit is None else self.unit) if self.gimbal in SIMULATED else None
