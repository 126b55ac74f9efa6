"""What can be known to fail is reported before a verb's imports and before anything is computed."""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from twin.config import Settings
from twin.config.base import flag, hints
from twin.config.seats import is_port
from twin.config.types import POSITIONAL
from twin.errors import TwinError

WRITTEN = ("out", "link")  # paths of files that need not exist
# modules behind the extras of the installation
EXTRAS = {
    "report": ("plotly",),
    "sysid": ("plotly", "matplotlib", "jinja2", "tabulate", "yaml", "absl", "imageio", "colorama"),
    "gym": ("gymnasium",),
    "notebook": ("pandas", "plotly"),
    "pi": ("smbus2", "rpi_hardware_pwm"),
    "cluster": ("ray",),
    "mcap": ("mcap",),
    "usd": ("pxr", "PIL"),
}


def ready(verb: str, settings: Settings) -> None:
    """Check files, serial port and extras that a verb needs.

    Raises
    ------
    TwinError, HardwareError : what is missing and what to do, in one line
    """
    for extra in settings.extras:
        if absent := lacking(extra):
            raise TwinError(
                f"twin {verb} needs {', '.join(absent)}: run `pip install '.[{extra}]'`"
                " in the project's folder"
            )
    for name, path in _files(settings):
        if not path.exists() and not Path(str(path).rpartition(":")[0] or path).exists():
            raise TwinError(f"cannot read {name}{path}: No such file or directory")
    gimbal = getattr(settings, "gimbal", None) or ""
    if is_port(gimbal) and gimbal.startswith("/") and not Path(gimbal).exists():
        from hardware.link import Link

        Link(gimbal).close()  # raises, with the ports there are


def lacking(extra: str) -> list[str]:
    """Modules of an extra that are not installed."""
    return [module for module in EXTRAS[extra] if find_spec(module) is None]


def _files(settings: Settings) -> Iterator[tuple[str, Path]]:
    """Files that a verb reads, with the flag that names each."""
    for name, hint in hints(type(settings)).items():
        value = getattr(settings, name)
        flagged = "" if POSITIONAL in getattr(hint, "__metadata__", ()) else f"{flag(name)} "
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, Path) and name not in WRITTEN:
                yield flagged, item
