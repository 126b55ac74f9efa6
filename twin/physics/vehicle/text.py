"""Text files that describe a vehicle, read within limits."""

from pathlib import Path
from typing import Final

from analysis.files import FileError, content
from twin.physics.vehicle.design import VehicleError

LARGEST_FILE: Final = 200_000  # bytes


def text_of(path: Path, what: str) -> str:
    """Text of a file in UTF-8; `what` it is stands in messages.

    Raises
    ------
    VehicleError : it cannot be read, is too large, or not a text
    """
    try:
        return content(path, LARGEST_FILE).decode("utf-8-sig")
    except FileError as error:
        raise VehicleError(f"cannot read {what} {error}") from None
    except UnicodeDecodeError:
        raise VehicleError(f"{path} is not a text in UTF-8") from None
