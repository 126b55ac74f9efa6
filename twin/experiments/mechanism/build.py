"""`twin mechanism build` and `twin meshes`: the model of a gimbal, and its printable parts."""

import filecmp
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from twin.config.mechanism import Mechanism as Settings
from twin.config.mechanism import Meshes
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.mechanism.figures import REFERENCE
from twin.physics.guard import approve, examine
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
    wires_mm : of the wires in them (x, y), to the ends of the bores of the drawn rod ends; empty
        with own rod ends
    """

    file: str
    parts: tuple[str, ...]
    rods_mm: tuple[float, ...] = ()
    wires_mm: tuple[float, ...] = ()

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
            if self.wires_mm:
                x, y = self.wires_mm
                rows.append(("", f"their wires {x:.1f} mm (x), {y:.1f} mm (y)"))
            rows.append(("", f"twin mechanism check {self.file}"))
        return rows


def built(config: Settings) -> BuildResult:
    """Write the MJCF of a mechanism, with its parts in a folder beside it.

    Raises
    ------
    TwinError : dimensions that cannot be, or files that cannot be written
    """
    from meshes.drawing import Drawing
    from meshes.parts import wire

    assert config.file is not None
    size = read(config.file)
    out = config.out or Path("runs") / f"{config.file.stem}.xml"
    out = writable(out, ".xml", force=config.force)
    parts = write(size, out, force=config.force)
    x, y = size.rods
    wires = () if "rod_end" in dict(size.stl) else wire(Drawing.read(out))
    return BuildResult(str(out), tuple(map(str, parts)), (x * 1e3, y * 1e3), wires)


def write(size: Dimensions, out: Path, *, force: bool = False) -> tuple[Path, ...]:
    """MJCF of a mechanism at `out`, its parts in the folder of that name without extension.

    Parameters
    ----------
    force : replace other parts of these names

    Raises
    ------
    TwinError : a part cannot be drawn, or a file in its place cannot be used or replaced
    """
    folder = out.with_suffix("")
    return _saved(folder, out, mjcf(size, folder.name), dict(size.stl), force)


def draw(config: Meshes) -> BuildResult:
    """Write the printable parts of a mechanism.

    Raises
    ------
    TwinError : a mechanism without the names that the parts are drawn around, or a file in the
        place of a part
    """
    out, file = config.out or Path("runs") / "parts", config.mechanism or REFERENCE
    if file.suffix.lower() != ".toml":
        approve(examine([file]), file)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"--out {out}: {error.strerror}") from None
    if file.suffix.lower() == ".toml":
        size = read(file)
        model = writable(out / f"{file.stem}.xml", ".xml", force=config.force)
        parts = _saved(out, model, mjcf(size, "."), dict(size.stl), config.force)
    else:
        parts = _saved(out, file, None, {}, config.force)
    return BuildResult(str(out), tuple(map(str, parts)))


def _saved(
    folder: Path, model: Path, text: str | None, own: dict[str, Path], force: bool
) -> tuple[Path, ...]:
    """Draw the parts beside their place, and move them there where nothing else is lost.

    Parameters
    ----------
    model : MJCF that is written with `text`, or read where that is None
    own : the builder's own files, by part
    """
    from meshes import MeshError, check
    from meshes.generate import generate

    try:
        with TemporaryDirectory(
            dir=folder if folder.is_dir() else folder.parent, prefix=".parts-"
        ) as place:
            source = model
            if text is not None:
                source = Path(place) / model.name
                source.write_text(text, encoding="utf-8")
            # the bench's parts, calibration rig and all, belong to the reference
            drawn = generate(Path(place), None if source == REFERENCE else source)
            for name, file in own.items():
                check(file)
                shutil.copyfile(file, drawn[name])
            moves = [(part, folder / part.name) for part in drawn.values()]
            for part, target in moves:
                _check_target(part, target, own, force)
            for part, target in moves:
                part.replace(target)
            if text is not None:
                source.replace(model)
    except (MeshError, OSError) as error:
        raise TwinError(str(error)) from None
    return tuple(target for _, target in moves)


def _check_target(part: Path, target: Path, own: dict[str, Path], force: bool) -> None:
    """Refuse to replace a builder's own part, and without `force` any other part."""
    if not target.is_file():
        writable(target, force=force)
        return
    if any(target.samefile(file) for file in own.values()):
        raise TwinError(f"--out: {target} is an own part and would be replaced; give another --out")
    if not filecmp.cmp(part, target, shallow=False):
        writable(target, force=force)
