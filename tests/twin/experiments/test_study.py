"""The convergence study on the twin's own flights: orders, jitter, real time, page and mistakes."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.convergence import richardson, study
from twin.config import Converge
from twin.errors import TwinError
from twin.experiments.convergence import converge
from twin.experiments.convergence.budget import budget
from twin.experiments.convergence.flights import JITTERED, baseline, closed_loop, jittered, load_for
from twin.experiments.convergence.page import shade
from twin.physics import native

SHORT = Converge(duration_s=0.8)
STEPS = (0.01, 0.005, 0.0025)


@pytest.fixture(autouse=True, scope="module")
def compiled():
    with native.installed():
        yield


@pytest.fixture(scope="module")
def smooth():
    fly = baseline(SHORT)
    return fly, richardson(fly, "rk4", 0.0025)


@pytest.mark.parametrize(
    ("name", "order"),
    [("ab1", 1), ("ab2", 2), ("ab3", 3), ("ab4", 4), ("implicitfast", 1), ("rk4", 4)],
)
def test_the_free_flight_shows_every_methods_order(smooth, name, order):
    fly, reference = smooth
    found = study(fly, (name,), STEPS, reference).of(name)
    # steps of 10 ms are a tenth of the roll's time constant: the next order still shows
    for quantity in ("position", "attitude"):
        assert found.order[quantity] == pytest.approx(order, abs=0.3)


def test_the_reference_of_the_free_flight_is_finer_than_any_error_it_measures(smooth):
    fly, reference = smooth
    assert reference.uncertainty.position < 1e-9
    # its own steps differ by 1e-12 m, a few units of the last place of some hundred metres, where
    # an order is chance; twice the step is clear of that
    assert richardson(fly, "rk4", 0.005).order == pytest.approx(4.0, abs=0.5)


def test_jittered_steps_keep_second_order_by_variable_coefficients_and_fall_to_first_without():
    fly = jittered(SHORT)
    found = study(fly, tuple(JITTERED), STEPS, richardson(fly, "rk4", 0.0025))
    kept, lost = (found.of(name) for name in JITTERED)
    # jitter is random, so errors scatter by some ten percent
    assert kept.order["attitude"] == pytest.approx(2.0, abs=0.35)
    assert lost.order["attitude"] == pytest.approx(1.0, abs=0.6)
    assert lost.errors[-1].position > 5 * kept.errors[-1].position


def test_the_steered_flight_converges_too_with_its_jumps_at_the_ticks():
    fly = closed_loop(replace(SHORT, duration_s=0.6, flight="closed-loop"))
    reference = richardson(fly, "rk4", 0.0005)
    found = study(fly, ("ab2", "implicitfast"), (0.004, 0.002, 0.001), reference)
    for series in found.series:
        errors = [e.position for e in series.errors]
        assert errors[-1] < 0.6 * errors[0]
        assert errors[-1] < 0.1


def test_the_real_time_step_is_one_whose_ticks_end_in_time():
    found = budget(load_for(SHORT), "implicitfast", SHORT)
    assert found.tick_cost <= 0.004
    ticks = 0.004 / found.step
    assert ticks == pytest.approx(round(ticks))  # a whole number of steps to a tick
    assert ticks * found.step_cost < 0.004


@pytest.mark.thorough
def test_the_study_writes_a_page_with_the_figure_from_blue_to_green_and_red(tmp_path):
    out = tmp_path / "study.html"
    config = replace(SHORT, integrators=("ab2", "rk4"), dt_ms=(10.0, 5.0), out=out, duration_s=0.4)
    result = converge(config)
    page = out.read_text()
    assert shade(0.0) in page
    assert shade(1.0) in page
    assert "#d62728" in page
    assert result.as_dict()["converged"] == (result.chosen.error <= 0.1)
    assert "order" in result.text()
    assert result.integrator == "rk4"  # that of `twin fly`, not the first
    used = result.as_dict()["in_use"]
    assert (used["integrator"], used["dt_s"], used["converged"]) == ("rk4", 0.004, True)
    assert "converged with rk4 at 4 ms" in result.text()
    assert "converged with rk4 at 4 ms" in page


def test_shades_go_from_blue_to_green():
    red, green, blue = (int(shade(0.0)[k : k + 2], 16) for k in (1, 3, 5))
    assert blue > 2 * green > 4 * red * 0.5
    red, green, blue = (int(shade(1.0)[k : k + 2], 16) for k in (1, 3, 5))
    assert green > 2 * blue


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"dt_ms": (10.0,)}, "1 different steps"),
        ({"dt_ms": (7.0, 3.5)}, "whole multiple"),
        ({"duration_s": 0.1}, "straight piece"),
        ({"duration_s": 100.0}, "duration-s"),
        ({"gimbal": "linkage", "model": "m.json"}, "--model m.json: has no effect with --gimbal"),
        ({"control_hz": 333.0, "flight": "closed-loop"}, "control-hz"),
    ],
)
def test_what_makes_no_study_is_refused_in_one_line(changes, told, tmp_path):
    with pytest.raises((TwinError, ValueError), match=told) as caught:
        converge(replace(SHORT, out=tmp_path / "x.html", **changes))
    assert "\n" not in str(caught.value)


def test_flights_of_a_study_repeat_themselves(smooth):
    fly, _ = smooth
    a, b = fly("ab3", 0.01), fly("ab3", 0.01)
    np.testing.assert_array_equal(a.position, b.position)
