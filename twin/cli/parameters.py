"""`twin parameters`: every name that `--set` takes, with its value, unit and meaning."""

from dataclasses import dataclass

import numpy as np

from twin.config import ListParameters
from twin.config.parameters import unit_and_meaning
from twin.config.result import Result, Rows
from twin.plant.compiled import compiled
from twin.plant.model.model import ModelConfig, load
from twin.plant.model.overrides import DECIDED
from twin.plant.model.overrides import parameters as values_of

MOST_SHOWN = 4  # values of one parameter
NOT_SIMULATED = "gimbal_print_", "print_"  # dimensions of printed parts


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model; with several values each is set by its index, NAME[0]."""

    name: str
    values: tuple[float, ...]
    unit: str
    meaning: str


@dataclass(frozen=True)
class ParametersResult(Result):
    """Parameters of a model."""

    parameters: tuple[Parameter, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values: by name, the value or values, unit and meaning."""
        return {
            p.name: {
                "value": p.values[0] if len(p.values) == 1 else list(p.values),
                "unit": p.unit,
                "meaning": p.meaning,
            }
            for p in self.parameters
        }

    def rows(self) -> Rows:
        """One row a parameter."""
        rows: Rows = []
        for p in self.parameters:
            shown = " ".join(f"{v:.5g}" for v in p.values[:MOST_SHOWN])
            more = f" … ({len(p.values)})" if len(p.values) > MOST_SHOWN else ""
            name = f"{p.name}[0…{len(p.values) - 1}]" if len(p.values) > 1 else p.name
            rows.append((name, f"{shown}{more} {p.unit}".ljust(24) + f" {p.meaning}"))
        return rows


def parameters(config: ListParameters) -> ParametersResult:
    """List the parameters of a model whose name or meaning contains every word.

    Raises
    ------
    TwinError : a file, name or number that cannot be used, in one line
    """
    with compiled():
        model = load(
            ModelConfig(
                scene=config.scene,
                vehicle=config.vehicle,
                mechanism=config.mechanism,
                overrides=config.overrides,
            )
        ).mj
    found = (_described(name, values) for name, values in values_of(model).items())
    words = [word.lower() for word in config.words]
    return ParametersResult(
        tuple(
            p
            for p in found
            if p.name not in DECIDED
            and not p.name.startswith(NOT_SIMULATED)
            and all(word in f"{p.name} {p.meaning}".lower() for word in words)
        )
    )


def _described(name: str, values: np.ndarray) -> Parameter:
    given = tuple(values.tolist())
    unit, meaning = unit_and_meaning(name) or ("", "of this model")
    return Parameter(name, given, unit, meaning)
