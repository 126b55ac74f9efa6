"""Columns of a row: the figures of one flight, and how it ended."""

import types
import typing
from collections.abc import Mapping
from dataclasses import fields

from analysis.flown import GROUND
from twin.experiments.flight.figures import Figures
from twin.experiments.flight.flight import PASSED
from twin.experiments.flight.result import FlightResult
from twin.loop.loop import TIME_UP

NOT_OF_FLIGHT = ("physics_s", "cpu_s", "wall_s", "within_m")  # of this machine, or of the question


def _numbers(kind: type) -> tuple[str, ...]:
    """Fields of a result that are one number, or None."""
    names = []
    for f in fields(kind):
        hint = f.type
        inner = set(typing.get_args(hint)) if isinstance(hint, types.UnionType) else {hint}
        if inner - {types.NoneType} <= {float, int}:
            names.append(f.name)
    return tuple(n for n in names if n not in NOT_OF_FLIGHT)


FIGURES = (*_numbers(FlightResult), *_numbers(Figures))
"""Figures of a flight, columns of every row; empty where they have no meaning for it."""

OUTCOMES: Mapping[str, str] = {
    "point": "passed the point that it steered to",
    "ground": "reached the ground",
    "time": "flew until the time was up",
    "ramp": "never left the ramp",
    "fault": "the rig or one of its sensors failed",
    "diverged": "the simulation left the finite numbers",
    "refused": "the sampled values cannot be flown; the reason is the message of `twin fly`",
    "crashed": "the process that flew it died",
}
"""How a run can end. Of all runs but those refused and crashed, figures and rates are taken."""
NOT_COUNTED = ("refused", "crashed")
_ENDS = {
    PASSED: "point", GROUND: "ground", TIME_UP: "time", "never left the ramp": "ramp",
}  # fmt: skip


def outcome_of(result: FlightResult) -> str:
    """Outcome of a flight that was flown to its end."""
    return "fault" if result.fault is not None else _ENDS[result.ended]


def figures_of(result: FlightResult) -> dict[str, float | None]:
    """Figures of a flight by name."""
    values = result.as_dict()
    return {name: _number(values[name]) for name in FIGURES}


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
