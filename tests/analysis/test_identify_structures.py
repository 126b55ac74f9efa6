"""Servos against small Euler steps, what a shared structure keeps, and names with spaces."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.identify import Estimate, ServoBounds, Wish, identify
from analysis.identify.gimbal import _also
from analysis.identify.information import _expected
from tests.benchmarks import servo_structures as study


def simulated(kind, seed, duration=7.0, *, play=False):
    rng = np.random.default_rng(seed)
    truth = study.drawn(kind, rng, dead_band=False, play=play)
    return truth, study.recorded(kind, truth, rng, study.NOISE, duration)


@pytest.mark.thorough
@pytest.mark.parametrize("play", [False, True])
def test_a_set_point_servo_is_found_and_play_is_not_taken_for_a_dead_band(play):
    """Searched with both free from the start, it ended where a dead band stood for the slew."""
    truth, record = simulated("set-point", 1, play=play)
    model = identify([record], servo="set-point")
    for name, true in truth.items():
        e = model.estimate(name)
        assert abs(e.value - true) < 2.0 * 1.96 * e.std, name
    assert model.servo[0].dead_band.value < 2e-4
    assert play or model.servo[0].backlash.value == 0.0


@pytest.fixture(scope="module")
def linear():
    return identify([simulated("speed", 1, 3.0)[1]])


def test_names_of_axes_and_commands_may_have_spaces(linear):
    channel = linear.channels[0][0]
    named = [replace(e, name=e.name.replace("x/x", "yaw axis/yaw u")) for e in channel.estimates]
    renamed = replace(channel, estimates=tuple(named))
    wish = Wish("delay", 1e-3)
    assert wish.now(renamed) == wish.now(channel)
    has = SimpleNamespace(range=0.1, gain=1.0, sizes=9, turns=True)
    found = _expected(Estimate("yaw axis/yaw u gain", 2.0, 1e-3, "rad/rad"), has)
    assert found.half == pytest.approx(1.96e-3 / 2.0)


def _bounded(linear, structure, shift, losses):
    limits = [
        Estimate(f"x {what}", 1.0, 0.01, "") for what in ("rate limit", "dead band", "backlash")
    ]
    channel = linear.channels[0][0]
    moved = [replace(e, value=e.value + shift * e.std) for e in channel.estimates]
    channel = replace(channel, estimates=tuple(moved))
    servo = (ServoBounds(structure, losses, *limits),)
    return replace(linear, channels=((channel,),), servo=servo, warnings=())


@pytest.mark.parametrize(("shift", "said"), [(1.9, 0), (2.1, 1)])
def test_a_shared_structure_keeps_the_losses_and_warns_where_the_axis_has_other_figures(
    linear, shift, said
):
    losses = {"speed": 3000.0, "command": 3100.0}
    own = _bounded(linear, "speed", shift, losses)
    model = _also(_bounded(linear, "command", 0.0, {"command": 3100.0}), own)
    assert model.servo[0].structure == "command"
    assert model.servo[0].losses == losses
    assert sum("(--structure speed)" in w for w in model.warnings) == said
