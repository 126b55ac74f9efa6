"""Colours, widths and names of the lines of every signal."""

import functools
from dataclasses import dataclass

import rerun as rr

from analysis import schema

Color = tuple[int, int, int]

COMMAND: Color = (135, 135, 135)
MEASURED: Color = (255, 140, 30)
SIMULATED: Color = (70, 150, 255)
STOP: Color = (200, 60, 60)
RESIDUAL: Color = (240, 110, 190)
BAND: Color = (90, 210, 160)
THRUST: Color = (255, 210, 60)
X, Y, Z, W = (230, 80, 80), (90, 190, 90), (80, 130, 240), (180, 120, 220)
_CYCLE = (X, Y, Z, W, (200, 180, 60), (80, 190, 200))

# One colour per meaning. Rerun draws the entities in alphabetical order, command below measured
# below simulated, and other below reference; each is narrower than the one below it, so that all
# are seen where they agree.
_WIDEST, _WIDE, _PLAIN = 6.0, 4.0, 1.5
_MEANING: dict[str, tuple[Color, float]] = {
    "command": (COMMAND, _WIDEST),
    "setpoint": (COMMAND, _WIDEST),
    "measured": (MEASURED, _WIDE),
    "reference": (MEASURED, _PLAIN),
    "simulated": (SIMULATED, _PLAIN),
    "other": (SIMULATED, _WIDE),
    "tilt": (SIMULATED, _PLAIN),
    "residual": (RESIDUAL, _PLAIN),
}
# What people call the axes of the world.
_WORLD = {"x": "east", "y": "north", "z": "up"}
_IN_WORLD = ("vehicle/position", "vehicle/velocity", "vehicle/wind")


@dataclass(frozen=True, slots=True)
class Lines:
    """Style of the lines of one entity, each of the same length."""

    names: list[str]
    colors: list[Color]
    widths: list[float]

    def archetype(self) -> rr.SeriesLines:
        """Return it as Rerun takes it."""
        return _series(tuple(self.names), tuple(self.colors), tuple(self.widths))


@functools.cache  # a run shows each in its first layout, its data and its last layout
def _series(
    names: tuple[str, ...], colors: tuple[Color, ...], widths: tuple[float, ...]
) -> rr.SeriesLines:
    return rr.SeriesLines(names=names, colors=colors, widths=widths)


def last(name: str) -> str:
    """Last part of a signal's name, with spaces."""
    return name.rsplit("/", 1)[-1].replace("_", " ")


def meaning(name: str) -> tuple[Color, float] | None:
    """Colour and width of a signal that has one meaning on both axes, else None."""
    return _MEANING.get(last(name))


def labels(name: str) -> list[str]:
    """Legend of a signal's components, with its unit where a plot may mix several."""
    signal = schema.SIGNALS[name]
    if name in _IN_WORLD:
        return [_WORLD[c] for c in signal.components]
    if len(signal.components) == 1:
        return [last(name)]
    return [f"{last(name)} {c}" for c in signal.components]


def lines(name: str, first: int = 0) -> Lines:
    """Colours, from a place in their cycle on, and legend of all components of a signal."""
    count = len(schema.SIGNALS[name].components)
    same = meaning(name)
    cycle = [_CYCLE[(first + k) % len(_CYCLE)] for k in range(count)]
    colors = [same[0]] * count if same else cycle
    return Lines(labels(name), colors, [same[1] if same else _PLAIN] * count)


def one_axis(name: str, axis: int) -> Lines:
    """Style that shows one of two components.

    The other one has no width instead of being invisible: the legend merges equal names.
    """
    color, width = meaning(name) or (_CYCLE[axis], _PLAIN)
    return Lines([last(name)] * 2, [color] * 2, [width * (axis == 0), width * (axis == 1)])


def without_last(given: Lines) -> Lines:
    """The same without the last component; as in `one_axis` it has no width and no own name."""
    return Lines(
        [*given.names[:-1], given.names[0]],
        [*given.colors[:-1], given.colors[0]],
        [*given.widths[:-1], 0.0],
    )
