"""Draw every printed part and write it beside this file: `python -m meshes.generate`."""

from collections.abc import Callable, Mapping
from pathlib import Path

from meshes import parts, rig, sensing
from meshes.drawing import MJCF, Drawing
from meshes.errors import MeshError
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
    "potentiometer_shaft": ("mechanism", sensing.shaft),
    "potentiometer_y": ("mechanism", sensing.cradle),
    "potentiometer_x": ("bench", sensing.saddle),
    "calibration_rig": ("bench", rig.calibration_rig),
}
# parts that a mechanism without this numeric does without
OPTIONAL: Mapping[str, str] = {
    "potentiometer_shaft": "print_potentiometer",
    "potentiometer_y": "print_potentiometer",
}


def generate(folder: Path = HERE, mechanism: Path | None = None) -> dict[str, Path]:
    """Write the STL of each part into `folder` and check it.

    Parameters
    ----------
    mechanism : MJCF with the names of the reference mechanism, drawn in its place, without the
        parts of the reference bench: calibration rig and potentiometers of the x axis

    Raises
    ------
    MeshError : a part came out open or empty, or the mechanism lacks a name
    """
    written = {}
    drawings: dict[str, Drawing] = {}
    for name, (model, draw) in PARTS.items():
        if mechanism is not None and model != "mechanism":
            continue
        file = mechanism or MJCF / f"{model}.xml"
        try:
            drawing = drawings.setdefault(model, Drawing.read(file))
            if name in OPTIONAL and not drawing.has(OPTIONAL[name]):
                continue
            solid = draw(drawing)
        except (KeyError, ValueError) as error:
            reason = " ".join(str(error).split())[:200]
            raise MeshError(f"{file}: cannot draw part {name}: {reason}") from None
        written[name] = folder / f"{name}.stl"
        write(written[name], solid)
        check(written[name])
    return written


def main() -> None:
    """Regenerate the committed parts and name them."""
    for name, path in generate().items():
        print(f"{name:18} {path.stat().st_size / 1024:7.1f} KiB")


if __name__ == "__main__":
    main()
