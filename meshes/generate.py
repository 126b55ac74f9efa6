"""Draw every printed part and write it beside this file: `python -m meshes.generate`."""

from collections.abc import Callable, Mapping
from pathlib import Path

from meshes import parts, rig
from meshes.drawing import MJCF, Drawing
from meshes.solids import Solid
from meshes.stl import check, write

HERE = Path(__file__).resolve().parent
# part -> (the model it is drawn around, what draws it)
PARTS: Mapping[str, tuple[str, Callable[[Drawing], Solid]]] = {
    "bulkhead": ("mechanism", parts.bulkhead),
    "bracket": ("mechanism", parts.bracket),
    "ring": ("mechanism", parts.ring),
    "holder": ("mechanism", parts.holder),
    "horn": ("mechanism", parts.horn),
    "rod_end": ("mechanism", parts.rod_end),
    "calibration_rig": ("bench", rig.calibration_rig),
}


def generate(folder: Path = HERE) -> dict[str, Path]:
    """Write the STL of each part into `folder` and check it.

    Raises
    ------
    MeshError : a part came out open or empty
    """
    drawings = {name: Drawing.read(MJCF / f"{name}.xml") for name, _ in PARTS.values()}
    written = {}
    for name, (model, draw) in PARTS.items():
        written[name] = folder / f"{name}.stl"
        write(written[name], draw(drawings[model]))
        check(written[name])
    return written


def main() -> None:
    """Regenerate the committed parts and name them."""
    for name, path in generate().items():
        print(f"{name:18} {path.stat().st_size / 1024:7.1f} KiB")


if __name__ == "__main__":
    main()
