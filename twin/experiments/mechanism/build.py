"""`twin mechanism build` and `twin meshes`: the model of a gimbal, and its printable parts."""

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

from twin.config.mechanism import Mechanism as Settings
from twin.config.mechanism import Meshes
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.mechanism.figures import REFERENCE
from twin.physics.mechanism.build import mjcf
from twin.physics.mechanism.dimensions import Dimensions, read


@dataclass(frozen=True)
class BuildResult(Result):
    """Files of a mechanism that were written.

    Attributes
    ----------
    file : MJCF, or the folder of the parts
    parts : printable parts (STL in millimetres)
    rods_mm : between the centres of the balls (x, y); empty where only parts were drawn
    """

    file: str
    parts: tuple[str, ...]
    rods_mm: tuple[float, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """JSON values; lengths in millimetres where the name says so."""
        return asdict(self)

    def rows(self) -> Rows:
        """What was written, and what to do with it."""
        rows = [("written", self.file)]
        rows += [("part" if k == 0 else "", part) for k, part in enumerate(self.parts)]
        if self.rods_mm:
            x, y = self.rods_mm
            rows.append(
                ("rods", f"{x:.1f} mm (x), {y:.1f} mm (y) between the centres of the balls")
            )
            rows.append(("", f"twin mechanism check {self.file}"))
        return rows


def built(config: Settings) -> BuildResult:
    """Write the MJCF of a mechanism, with its parts in a folder beside it.

    Raises
    ------
    TwinError : dimensions that cannot be, or files that cannot be written
    """
    assert config.file is not None
    size = read(config.file)
    out = config.out or Path("runs") / f"{config.file.stem}.xml"
    out = writable(out, ".xml", force=config.force)
    parts = write(size, out)
    x, y = size.rods
    return BuildResult(str(out), tuple(map(str, parts)), (x * 1e3, y * 1e3))


def write(size: Dimensions, out: Path) -> tuple[Path, ...]:
    """MJCF of a mechanism at `out`, its parts in the folder of that name without extension.

    Raises
    ------
    TwinError : a part cannot be drawn, or a file in its place cannot be used
    """
    folder = out.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    part = out.with_name(f"{out.stem}.partial.xml")  # MuJoCo goes by the ending
    part.write_text(mjcf(size, folder.name), encoding="utf-8")
    try:
        found = _drawn(part, folder, dict(size.stl))
    except TwinError:
        part.unlink()
        raise
    part.replace(out)
    return found


def draw(config: Meshes) -> BuildResult:
    """Write the printable parts of a mechanism.

    Raises
    ------
    TwinError : a mechanism without the names that the parts are drawn around
    """
    out = config.out or Path("runs") / "parts"
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"--out {out}: {error.strerror}") from None
    file = config.mechanism or REFERENCE
    if file.suffix.lower() == ".toml":
        size = read(file)
        model = writable(out / f"{file.stem}.xml", ".xml", force=config.force)
        model.write_text(mjcf(size, "."), encoding="utf-8")
        return BuildResult(str(out), tuple(map(str, _drawn(model, out, dict(size.stl)))))
    return BuildResult(str(out), tuple(map(str, _drawn(file, out, {}))))


def _drawn(model: Path, folder: Path, own: dict[str, Path]) -> tuple[Path, ...]:
    """Parts of a model, drawn or copied from the builder's own files."""
    from meshes import MeshError, check
    from meshes.generate import generate

    try:
        written = generate(folder, model)
        for name, file in own.items():
            check(file)
            shutil.copyfile(file, written[name])
    except (MeshError, OSError) as error:
        raise TwinError(str(error)) from None
    return tuple(written.values())
