"""A described vehicle from the side as an SVG picture: shape, motor, centres of mass, pressure."""

from collections.abc import Iterable
from html import escape
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.vehicle import Vehicle

Array = NDArray[np.float64]
WIDTH, MARGIN = 1000.0, 40.0  # of the picture, and around the vehicle
POINTS: Final = 60  # of the outline of a part
LINE: Final = 22.0  # height of a line of text
SHAPE = 'fill="{}" stroke="#333" stroke-width="1.2"'


def drawing(vehicle: Vehicle, marks: Iterable[tuple[str, float, str]]) -> str:
    """SVG text of a vehicle, nose to the left, to scale.

    Fins stand to either side; `marks` are label, station from the tip [m] and colour.
    """
    outline = vehicle.outline
    marks = sorted(marks, key=lambda mark: -mark[1])  # texts run to the right of their lines
    scale = (WIDTH - 2 * MARGIN) / outline.end
    reach = max([outline.largest_radius, *(f.radius + f.plan.span for f in outline.fins)])
    middle = MARGIN + reach * scale
    height = 2 * middle + LINE * (len(marks) + 1)

    def polygon(x: Array, y: Array, fill: str) -> str:
        points = zip(MARGIN + scale * x, middle - scale * y, strict=True)
        text = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
        return f'<polygon points="{text}" {SHAPE.format(fill)}/>'

    def both(x: Array, y: Array, fill: str) -> list[str]:
        return [polygon(x, y, fill), polygon(x, -y, fill)]

    shapes = []
    for placed in outline.fins:
        shapes += both(placed.start + placed.plan.x, placed.radius + placed.plan.y, "#d9331f")
    for segment in outline.segments:
        x = np.linspace(0.0, 1.0, POINTS) ** 2 * segment.part.length  # dense where a nose is blunt
        r = segment.radius(x)
        fill = "#ededf0" if segment.front == segment.aft else "#f4b6ac"
        shapes.append(polygon(segment.start + np.append(x, x[::-1]), np.append(r, -r[::-1]), fill))
    front, casing = outline.nozzle - vehicle.motor.length, outline.casing
    box = np.array([front, outline.nozzle, outline.nozzle, front])
    shapes.append(polygon(box, casing * np.array([1.0, 1.0, -1.0, -1.0]), "#33333888"))
    for k, (label, station, colour) in enumerate(marks):
        at, y = MARGIN + scale * station, 2 * middle + LINE * k
        shapes.append(
            f'<line x1="{at:.1f}" y1="{middle:.1f}" x2="{at:.1f}" y2="{y:.1f}" stroke="{colour}"/>'
            f'<circle cx="{at:.1f}" cy="{middle:.1f}" r="5" fill="{colour}"/>'
            f'<text x="{min(at, WIDTH - 320):.1f}" y="{y + 15:.1f}" fill="{colour}">'
            f"{escape(label)}: {station:.4g} m</text>"
        )
    title = f"{vehicle.design.name}: {outline.end:.4g} m, {2 * outline.largest_radius * 1e3:.4g} mm"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:.0f}"'
    style = 'font-family="sans-serif" font-size="15"'
    return "\n".join(
        [f"{head} {style}>", f'<rect width="{WIDTH:g}" height="{height:.0f}" fill="white"/>',
         f'<text x="{MARGIN:g}" y="25">{escape(title)}</text>', *shapes, "</svg>\n"]
    )  # fmt: skip
