"""`twin mechanism`: figures of a gimbal, its model from a few numbers, and a search for one."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from twin.config.mechanism import Mechanism as Settings
from twin.experiments.mechanism.build import BuildResult, built, write
from twin.experiments.mechanism.figures import REFERENCE, MechanismResult, figures
from twin.experiments.mechanism.search import SearchResult, searched
from twin.physics.mechanism.dimensions import read

__all__ = ["BuildResult", "MechanismResult", "SearchResult", "mechanism"]


def mechanism(config: Settings) -> MechanismResult | BuildResult | SearchResult:
    """Show, check, build or search a mechanism.

    Raises
    ------
    TwinError : a file that is not a mechanism, or a result that cannot be written, in one line
    """
    if config.action == "search":
        return searched(config)
    if config.action == "build":
        return built(config)
    clear = config.action == "check"
    file = config.file or REFERENCE
    if file.suffix.lower() != ".toml":
        return figures(file, config.load_g, config.gap_mm, clear=clear)
    with TemporaryDirectory(prefix="tvc-twin-") as folder:
        model = Path(folder) / f"{file.stem}.xml"
        write(read(file), model)
        found = figures(model, config.load_g, config.gap_mm, clear=clear)
    return replace(found, file=str(file))
