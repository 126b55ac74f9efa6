"""Steps back and forth on a gimbal: the commands, and the raw responses cut out of the run."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.configuration import Step
from twin.errors import TwinError
from twin.model import AXES

Array = NDArray[np.float64]
LARGEST_ANGLE = math.radians(10.0)  # the mechanism's stops


@dataclass(frozen=True)
class Schedule:
    """A sequence of commanded gimbal angles.

    Attributes
    ----------
    times : (n,) when each angle begins [s]
    angles : (n, 2) [rad]
    duration : end of the last hold [s]
    """

    times: Array
    angles: Array
    duration: float


def schedule(config: Step) -> Schedule:
    """Zero, then ±amplitude from zero and back, axis by axis, `repeats` times each.

    Raises
    ------
    TwinError : an amplitude past the stops, or no time or repeats to speak of
    """
    amplitude = math.radians(config.amplitude_deg)
    if not 0 < amplitude <= LARGEST_ANGLE:
        raise TwinError(f"--amplitude-deg {config.amplitude_deg}: must lie in 0 to 10, the stops")
    if not 0.01 <= config.hold_s <= 100:
        raise TwinError(f"--hold-s {config.hold_s}: must lie in 0.01 to 100")
    if not 1 <= config.repeats <= 10_000:
        raise TwinError(f"--repeats {config.repeats}: must lie in 1 to 10000")
    chosen = (0, 1) if config.axis == "both" else (AXES.index(config.axis),)
    angles = [np.zeros(2)]
    for axis in chosen:
        for _ in range(config.repeats):
            for level in (amplitude, 0.0, -amplitude, 0.0):
                angle = np.zeros(2)
                angle[axis] = level
                angles.append(angle)
    times: Array = np.arange(len(angles), dtype=np.float64) * config.hold_s
    return Schedule(times, np.array(angles), float(len(angles) * config.hold_s))


def figures(recording: Path) -> tuple[dict[str, object], ...]:
    """Figures of the steps in a recording, one row per figure and axis."""
    return ()
