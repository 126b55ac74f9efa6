"""The processor time that a flight reports."""

import time

from twin.config import Fly
from twin.experiments.flight import ticks
from twin.experiments.flight.fly import fly


def test_compiling_is_no_time_of_the_physics(monkeypatch):
    """The first call of a compiled function takes half a second more, as after an update."""
    compiled, took, calls = ticks._fly, 0.5, []

    def late(*arguments):
        if not calls:
            until = time.thread_time() + took
            while time.thread_time() < until:
                pass
        calls.append(1)
        return compiled(*arguments)

    fly(settings := Fly(duration_s=0.1), recorded=False)  # what else is loaded
    monkeypatch.setattr(ticks, "_fly", late)
    result = fly(settings, recorded=False)
    assert len(calls) > 1
    assert result.physics_steps > 20
    assert result.physics_s < 0.5 * took
    assert result.cpu_s > took
