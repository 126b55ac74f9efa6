"""Draw every printed part and write it beside this file: `python -m meshes.generate`."""

from collections.abc import Callable, Mapping
from pathlib import Path

from meshes import parts
from meshes.drawing import MJCF, Drawing
from meshes.solids import Solid
from meshes.stl import check, write

HERE = Path(__file__).resolve().parent
PARTS: Mapping[str, Callable[[Drawing], Solid]] = {
    "bulkhead": parts.bulkhead,
    "bracket": parts.bracket,
    "ring": parts.ring,
    "holder": parts.holder,
    "horn": parts.horn,
    "rod_end": parts.rod_end,
}


def generate(folder: Path = HERE) -> dict[str, Path]:
    """Write the STL of each part into `folder` and check it.

    Raises
    ------
    MeshError : a part came out open or empty
    """
    drawing = Drawing.read(MJCF / "mechanism.xml")
    written = {}
    for name, draw in PARTS.items():
        written[name] = folder / f"{name}.stl"
        write(written[name], draw(drawing))
        check(written[name])
    return written


def main() -> None:
    """Regenerate the committed parts and name them."""
    for name, path in generate().items():
        print(f"{name:18} {path.stat().st_size / 1024:7.1f} KiB")


if __name__ == "__main__":
    main()
