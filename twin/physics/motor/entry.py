"""One motor of a file, usable or not."""

from dataclasses import dataclass

from twin.physics.motor.curve import Motor


@dataclass(frozen=True)
class Entry:
    """One motor of a file.

    Attributes
    ----------
    name : designation, as its file gives it
    maker : manufacturer; empty where the file gives none
    motor : None where the entry cannot be used
    fault : why it cannot be used, one line with its place in the file
    """

    name: str
    maker: str = ""
    motor: Motor | None = None
    fault: str = ""

    def is_called(self, name: str) -> bool:
        """Whether a name is this motor's: its designation, or maker and designation."""
        return name in (self.name, f"{self.maker} {self.name}")
