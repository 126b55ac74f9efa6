"""Which order a coupled gimbal has, against scipy's step responses."""

import numpy as np
import pytest
from scipy import signal

from analysis.identify import select_order
from analysis.recording import measurement


@pytest.mark.thorough
@pytest.mark.parametrize("lead", [0.0, 0.03])
def test_the_zero_of_a_coupling_is_seen_with_all_commands(lead):
    """y follows its own command and 15 % of x's, through (1 + lead·s); x has no part of it."""
    time = np.arange(0.0, 16.0, 0.005)
    rng = np.random.default_rng(3)
    begun = np.sort(rng.uniform(0.5, 15.0, 24))
    sizes = np.radians(rng.choice([-8.0, -5.0, 5.0, 8.0], (24, 2)))
    steps = np.diff(sizes, axis=0, prepend=0.0)
    since = np.arange(0.0, 2.0, 1e-4)

    def moved(column: int, gain: float, omega: float, damping: float, delay: float, lead: float):
        num = [gain * omega**2 * lead, gain * omega**2] if lead else [gain * omega**2]
        plant = signal.TransferFunction(num, [1.0, 2.0 * damping * omega, omega**2])
        _, response = signal.step(plant, T=since)
        return sum(
            size * np.interp(time - at - delay, since, response, left=0.0)
            for at, size in zip(begun, steps[:, column], strict=True)
        )

    x = moved(0, 1.0, 48.0, 0.6, 0.018, 0.0)
    y = moved(1, 0.95, 62.0, 0.8, 0.009, 0.0) + moved(0, 0.15, 55.0, 0.7, 0.012, lead)
    angle = np.stack([x, y], axis=1) + rng.normal(0.0, np.radians(0.02), (len(time), 2))
    command = sizes[np.searchsorted(begun, time, side="right") - 1]
    command[time < begun[0]] = 0.0
    run = measurement(time, command, angle=angle, stamps="exact")
    (poles, zeros), _ = select_order([run], [(2, 0), (2, 1)], axis=1)
    assert (poles, zeros) == (2, int(lead > 0.0))
