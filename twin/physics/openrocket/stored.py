"""What OpenRocket itself computed and stored in a design: mass and centre of pressure."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np

SLOW: Final = (0.02, 0.3)  # Mach numbers at which the centre of pressure is compared
LEVEL: Final = math.radians(2.0)  # largest angle of attack; above it OpenRocket adds body lift
STALE: Final = ("outdated", "cantrun", "notsimulated")  # marks of OpenRocket: not of this design


@dataclass(frozen=True)
class Stored:
    """Figures of the stored simulations; None where none has them.

    Attributes
    ----------
    mass : without the motor; without the propellant only where `with_casing` [kg]
    with_casing : a file of OpenRocket 15.03 and before, which stored the propellant's mass alone
    centre_of_pressure : at the smallest angle of attack of the slow ascent [m]
    outdated : the design was changed after the last of its simulations
    """

    mass: float | None = None
    with_casing: bool = False
    centre_of_pressure: float | None = None
    outdated: bool = False


def stored(root: Element) -> Stored:
    """Mass and centre of pressure of the stored simulations, of the current ones if there are."""
    masses: dict[str, list[float]] = {}
    best = (LEVEL, math.nan)
    every = list(root.iter("simulation"))
    current = [run for run in every if run.get("status") not in STALE and _flown(run)]
    for branch in (b for run in current or every for b in run.iter("databranch")):
        for row in _rows(branch):
            for name in ("Motor mass", "Propellant mass"):
                masses.setdefault(name, []).append(
                    row.get("Mass", math.nan) - row.get(name, math.nan)
                )
            slow = SLOW[0] < row.get("Mach number", math.nan) < SLOW[1]
            rising = row.get("Vertical velocity", 0.0) > 0
            place, angle = row.get("CP location", math.nan), row.get("Angle of attack", math.nan)
            if slow and rising and math.isfinite(place) and angle < best[0]:
                best = angle, place
    # the mean over a burn is finer than the three digits that each value has
    means = {name: float(np.mean(v)) for name, v in masses.items() if np.isfinite(v).all()}
    casing = "Motor mass" not in means
    return Stored(
        mass=means.get("Motor mass", means.get("Propellant mass")),
        with_casing=casing and bool(means),
        centre_of_pressure=None if math.isnan(best[1]) else best[1],
        outdated=not current and any(_flown(run) for run in every),
    )


def _flown(simulation: Element) -> bool:
    return next(simulation.iter("datapoint"), None) is not None


def _rows(branch: Element) -> Iterator[Mapping[str, float]]:
    """Stored instants by column."""
    names = [name.strip() for name in branch.get("types", "").split(",")]
    for point in branch.iter("datapoint"):
        try:
            values = [float(word) for word in (point.text or "").split(",")]
        except ValueError:
            continue
        if len(values) == len(names):
            yield dict(zip(names, values, strict=True))
