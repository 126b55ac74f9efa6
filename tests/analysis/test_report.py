"""The report: numbers against closed forms, and the page as a real browser shows it."""

import base64
import io
import json
import math
import os
import re
import shutil
import time
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.flown import flown
from analysis.recording import (
    Event,
    Measurement,
    Recording,
    TimeSeries,
    measurement,
    measurement_of,
)
from analysis.recording.series import POSITION
from analysis.report import Line, Panel, Plot, Section, Table, render, report
from analysis.report.build import labelled, simulated
from analysis.report.figures import AxisFigures, axis_figures, kind_of, run_figures
from analysis.report.numbers import RunNumbers
from analysis.report.parts import thinned
from analysis.report.sections.key_figures import largest_figures
from analysis.report.spectrum import frequency_response
from analysis.report.words import number, value_text
from analysis.response import Figure, disagreements
from analysis.transfer_function import Channel, TransferFunctionModel

DT = 0.002
OMEGA, ZETA, DELAY = 40.0, 0.5, 0.012
HOSTILE = "&lt;b&gt;</script><img src=x onerror=alert(1)><script>alert(2)</script><!--{{title}}"


def recorded(
    commands: np.ndarray,
    angles: np.ndarray,
    *,
    motion: str = "simulated",
    late: float = 0.0,
    **configuration: object,
) -> Measurement:
    """A run of both axes (n, 2) [rad], a row every DT."""
    t = late + DT * np.arange(len(commands))
    series = {
        name: TimeSeries(name, t, values, "rad", ("x", "y"))
        for name, values in (("gimbal/command", commands), (f"gimbal/{motion}", angles))
    }
    return measurement_of(
        Recording({"command": "step", "configuration": configuration}, series), "run"
    )


def stepped(repeats: int = 3, hold: int = 300) -> np.ndarray:
    """Commands (n, 2): ±5° and back on x, then on y."""
    one = np.repeat(np.tile([0.1, 0.0, -0.1, 0.0], repeats), hold)
    rest = np.zeros(hold)
    axis = np.concatenate([rest, one, rest])
    none = np.zeros_like(axis)
    return np.stack([np.concatenate([axis, none]), np.concatenate([none, axis])], axis=1)


def answered(commands: np.ndarray, gain: float = 1.0) -> np.ndarray:
    model = TransferFunctionModel.second_order(OMEGA, ZETA, DELAY)
    return gain * model.simulate(commands, DT)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """Report of noisy hardware that starts late, its exact model, and a linkage of another gain.

    Its numbers and its page.
    """
    commands = stepped()
    angles = answered(commands)
    noise = np.random.default_rng(3).normal(0.0, 5e-4, angles.shape)
    recordings = [
        recorded(commands, angles + noise, motion="measured", late=0.7, gimbal="firmware"),
        recorded(commands, angles * 1.1, gimbal="linkage"),
    ]
    page = tmp_path_factory.mktemp("three") / "a.html"
    models = {"model": TransferFunctionModel.second_order(OMEGA, ZETA, DELAY)}
    return report(recordings, page, models=models), page


def test_figures_are_those_of_the_second_order_textbook():
    """Times interpolated between rows 2 ms apart."""
    commands = stepped()
    run = recorded(commands, answered(commands))
    told = {f.name: f for f in axis_figures(run.axes[0]).figures}
    overshoot = 100.0 * math.exp(-math.pi * ZETA / math.sqrt(1.0 - ZETA**2))
    assert told["overshoot up"].value == pytest.approx(overshoot, abs=0.2)
    peak = math.pi / (OMEGA * math.sqrt(1.0 - ZETA**2)) + DELAY
    assert told["peak_time down"].value == pytest.approx(peak, abs=DT)
    assert told["rise_time up"].n == 6
    assert told["gain"].value == pytest.approx(1.0, abs=1e-4)


def test_the_frequency_response_and_its_band_hold_the_true_one():
    """Noise of 1 % of the command; at 95 % a band around 40 lines may miss a few."""
    rng = np.random.default_rng(1)
    u = np.repeat(0.05 * rng.choice([-1.0, 1.0], 900), 22)
    commands = np.stack([u, np.zeros_like(u)], axis=1)
    angles = answered(commands) + rng.normal(0.0, 5e-4, commands.shape)
    found = frequency_response(recorded(commands, angles).axes[0])
    inside = found.frequency < 8.0
    s = 2j * math.pi * found.frequency[inside]
    true = OMEGA**2 / (s**2 + 2 * ZETA * OMEGA * s + OMEGA**2) * np.exp(-s * DELAY)
    seen = found.gain[inside] * np.exp(1j * found.phase[inside])
    assert np.median(np.abs(seen / true - 1.0)) < 0.02
    held = np.abs(found.gain[inside] / np.abs(true) - 1.0) <= found.error[inside]
    assert 0.8 <= held.mean() <= 1.0


def test_a_bandwidth_beyond_the_record_is_missing_with_the_band_that_the_record_has():
    """The gimbal has 4.6 Hz; a slow sweep excites 0.1 to 2 Hz."""
    t = np.arange(20_000) * DT
    u = 0.05 * np.sin(2 * math.pi * (0.1 * t + 0.5 * 1.9 / t[-1] * t**2))
    commands = np.stack([u, np.zeros_like(u)], axis=1)
    run = recorded(commands, answered(commands), signal="chirp").axes[0]
    (note,) = axis_figures(run).notes
    low, high = re.search(r"^bandwidth.* coherent, ([\d.]+) to ([\d.]+) Hz$", note).groups()
    found = frequency_response(run).frequency
    assert (float(low), float(high)) == pytest.approx((found[0], found[-1]), rel=0.05)
    assert 1.5 < float(high) < 4.0


def test_hysteresis_of_a_sweep_is_the_play_that_was_put_in():
    """Play of 0.02 rad, no lag, stroke 0.2: either way crosses it for a tenth of the stroke, where
    the gap is half, so the mean gap is 0.02·(1 − 0.1); 2 %: twenty stretches, one start."""
    t = np.arange(20_000) * DT
    u = 0.1 * np.interp(t / t[-1] * 2 % 1.0, [0, 0.25, 0.75, 1], [0, 1, -1, 0])
    y = np.zeros_like(u)
    for k in range(1, len(u)):
        y[k] = min(max(y[k - 1], u[k] - 0.01), u[k] + 0.01)
    run = recorded(np.stack([u, u * 0], 1), np.stack([y, u * 0], 1), signal="triangle")
    found = {f.name: f for f in axis_figures(run.axes[0]).figures}["hysteresis with lag"]
    assert abs(found.value) == pytest.approx(0.018, rel=0.02)


@pytest.mark.parametrize(
    ("wave", "kind"),
    [
        (lambda t: 0.1 * np.sign(np.sin(2 * math.pi * 0.5 * t)), "steps"),
        (lambda t: 0.1 * 0.8 ** np.floor(t) * (np.floor(2 * t) % 2), "staircase"),
        (lambda t: 0.1 * np.sin(2 * math.pi * 0.3 * t * t), "broadband"),
        (lambda t: 0.1 * np.interp(t % 8, [0, 2, 6, 8], [0, 1, -1, 0]), "ramps"),
        (lambda t: 0.0 * t, "still"),
    ],
)
def test_a_command_without_a_description_is_known_by_its_look(wave, kind):
    t = np.arange(8_000) * DT
    u = np.stack([wave(t), 0 * t], axis=1)
    run = recorded(u, u)
    assert kind_of(run.axes[0]) == kind


def test_runs_are_laid_over_each_other_by_their_commands_and_the_shift_is_told(three):
    numbers, page = three
    model = next(c for c in numbers.comparisons if (c.reference, c.other) == ("firmware", "model"))
    assert all(abs(a.delay) < 2e-4 for a in model.axes)  # a tenth of a row
    # noise of 5e-4 rad on motion of 0.05 rad rms
    assert model.fit > 98.0
    text = page.read_text(encoding="utf-8")
    assert "shifted by 700 ms" in text
    linkage = next(r for r in numbers.runs if r.label == "linkage")
    assert ("x", "gain", pytest.approx(0.1)) in linkage.disagree  # 1.1 is not 1
    exact = next(r for r in numbers.runs if r.label == "model")
    assert "gain" not in [name for _, name, _ in exact.disagree]


@pytest.mark.thorough
def test_steps_of_two_sizes_through_a_limited_speed_disagree_only_where_they_do(tmp_path):
    """The same gimbal twice, and one that is slower only where its speed is limited."""
    one = np.repeat(np.tile([0.03, 0.0, 0.12, 0.0, -0.03, 0.0, -0.12, 0.0], 6), 400)
    commands = np.stack([one, 0 * one], axis=1)

    def limited(limit, seed):
        angle, y = 0.0, np.zeros(len(one))
        for k, u in enumerate(one):
            y[k] = angle
            angle += DT * np.clip(25.0 * (u - angle), -limit, limit)
        noise = np.random.default_rng(seed).normal(0.0, 1e-4, (len(one), 2))
        return recorded(commands, np.stack([y, 0 * y], axis=1) + noise, motion="measured")

    runs = [limited(1.0, 1), limited(1.0, 2), limited(0.8, 3)]
    numbers = report(runs, tmp_path / "a.html", labels=["a", "same", "slower"])
    same, slower = (
        {(n, round(a, 2)) for _, n, a in r.disagree if n.startswith("rise")}
        for r in numbers.runs[1:]
    )
    assert len(same) <= 1  # of four intervals of 95 %
    assert {("rise_time up", 0.12), ("rise_time down", -0.12)} <= slower
    assert ("rise_time up", 0.03) not in slower
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert page[page.index('id="figures"') :].count("class=off") == sum(
        len(r.disagree) for r in numbers.runs
    )
    json.dumps(numbers.to_dict(), allow_nan=False)


def figures_of(run, axis):
    return {f.name: f for a in run.figures if a.axis == axis for f in a.figures}


def test_slew_rate_and_knee_stand_where_steps_of_several_sizes_were_recorded(tmp_path):
    """Speed limit of 1.5 rad/s behind 20/s: linear speed is 0.6/ln 4 · 20/s of the amplitude."""
    sizes = np.repeat(np.geomspace(0.02, 0.8, 9), 2)
    one = np.repeat(np.ravel(np.stack([sizes, 0 * sizes], 1)), 400)
    angle, y = 0.0, np.zeros(len(one))
    for k, u in enumerate(one):
        y[k] = angle
        angle += DT * np.clip(20.0 * (u - angle), -1.5, 1.5)
    commands = np.stack([one, 0 * one], axis=1)
    noise = np.random.default_rng(0).normal(0.0, 1e-4, commands.shape)
    hardware = recorded(commands, np.stack([y, 0 * y], 1) + noise, motion="measured")
    model = TransferFunctionModel.second_order(OMEGA, ZETA, DELAY)
    numbers = report([hardware], tmp_path / "a.html", models={"model": model}, labels=["rig"])
    told = figures_of(numbers.runs[0], "x")
    assert told["slew_rate"].value == pytest.approx(1.5, rel=0.03)
    assert told["slew_rate"].amplitude == pytest.approx(0.8)
    assert told["slew_rate"].n >= 8
    assert told["slew_knee"].value == pytest.approx(1.5 * math.log(4.0) / 12.0, rel=0.15)
    assert told["slew_knee"].interval[0] < told["slew_knee"].value < told["slew_knee"].interval[1]
    # a linear model only grows faster, and is marked for it
    assert "slew_rate" not in figures_of(numbers.runs[1], "x")
    assert any("model, x: slew rate: the speed grows" in n for n in numbers.notes)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    missing = sum(len(a.missing) for r in numbers.runs for a in r.figures)
    assert missing < len(numbers.notes)  # a linear model's speed without a limit misses nothing
    badge = re.search(r"<li class=fair>(\d+) figures? not determined", text)
    assert int(badge[1]) == missing if missing else badge is None
    assert 'id="slew"' in text
    assert "slew knee" in text


def test_places_reached_again_and_again_have_their_repeatability(tmp_path):
    """Approached from below 1 mrad short, from above 1 mrad long; each with 0.1 mrad of scatter."""
    commands = stepped(repeats=6)
    way = np.sign(np.diff(commands, axis=0, prepend=0.0))
    for k in range(1, len(way)):
        way[k] = np.where(way[k] == 0.0, way[k - 1], way[k])
    changes = np.cumsum(np.abs(np.diff(commands, axis=0, prepend=0.0)).sum(axis=1) > 0.0)
    scatter = np.random.default_rng(1).normal(0.0, 1e-4, changes[-1] + 1)[changes]
    angles = answered(commands) - 1e-3 * way + scatter[:, None]
    numbers = report([recorded(commands, angles, motion="measured")], tmp_path / "a.html")
    told = {
        (f.name, round(f.amplitude, 3)): f
        for a in numbers.runs[0].figures
        if a.axis == "x"
        for f in a.figures
    }
    for place, sides in ((0.1, ["below"]), (0.0, ["below", "above"]), (-0.1, ["above"])):
        for side in sides:
            ap = told[f"accuracy AP from {side}", place]
            assert ap.n >= 6
            assert ap.value == pytest.approx(-1e-3 if side == "below" else 1e-3, abs=1.5e-4)
            rp = told[f"repeatability RP from {side}", place]
            assert 5e-5 < rp.value < 6e-4
            assert rp.interval[0] < rp.value < rp.interval[1]
    assert told["variation vAP", 0.0].value == pytest.approx(2e-3, abs=2e-4)
    assert ("accuracy AP from above", 0.1) not in told


def test_a_models_own_figures_stand_in_its_column(three):
    """Bandwidth of a second order of ζ 0.5: ωn·√(½ + √(5/4)); the delay counts into the lag."""
    numbers, page = three
    own = figures_of(numbers.runs[2], "x")
    hertz = OMEGA * math.sqrt(0.5 + math.sqrt(1.25)) / (2 * math.pi)
    assert own["bandwidth"].value == pytest.approx(hertz, rel=1e-4)
    w = 2 * math.pi
    lag = math.atan2(2 * ZETA * OMEGA * w, OMEGA**2 - w * w) + DELAY * w
    assert own["equivalent delay"].value == pytest.approx(lag / w)
    assert {"-90° frequency", "phase lag at 1 Hz"} <= set(own)
    assert own["bandwidth"].n == 0
    assert figures_of(numbers.runs[2], "x/y")["coupling x→y"].value == 0.0
    assert not any("bandwidth" in figures_of(r, "x") for r in numbers.runs[:2])
    assert value_text(own["bandwidth"]) in page.read_text(encoding="utf-8")


def test_a_models_step_figures_stand_beside_a_measured_sweep(tmp_path):
    t = np.arange(10_000) * DT
    sweep = 0.05 * np.sin(2 * math.pi * 0.2 * t * t)
    commands = np.stack([sweep, 0 * sweep], axis=1)
    hardware = recorded(commands, answered(commands), motion="measured", signal="chirp")
    model = TransferFunctionModel.second_order(OMEGA, ZETA, DELAY)
    numbers = report([hardware], tmp_path / "a.html", models={"model": model})
    own = figures_of(numbers.runs[1], "x")
    assert own["overshoot"].value == pytest.approx(16.3, abs=0.1)
    assert "overshoot" not in figures_of(numbers.runs[0], "x")


def test_the_cosine_loss_is_that_of_the_angles_reached(three):
    numbers, _ = three
    for run, reached in zip(numbers.runs, (0.1, 0.11, 0.1), strict=True):
        loss = figures_of(run, "x")["cosine_loss"]
        assert loss.value == pytest.approx(100.0 * (1.0 - math.cos(reached)), rel=0.01)
        assert (loss.unit, loss.n, loss.amplitude) == ("%", 6, pytest.approx(0.1))


def test_axes_moved_together_tell_no_coupling(tmp_path):
    one = stepped()[:, :1]
    both = np.concatenate([one, one], axis=1)
    numbers = report([recorded(both, answered(both))], tmp_path / "a.html")
    assert [a.axis for a in numbers.runs[0].figures] == ["x", "y"]


def test_a_gimbal_that_never_moves_is_told_without_linearity(tmp_path):
    commands = stepped()
    numbers = report([recorded(commands, 0.0 * commands)], tmp_path / "a.html")
    told = figures_of(numbers.runs[0], "x")
    assert told["gain"].value == 0.0
    assert math.isnan(told["linearity"].value)


def test_motions_under_different_commands_are_not_compared(tmp_path):
    one, other = stepped(), 0.5 * stepped()
    numbers = report(
        [recorded(one, answered(one), gimbal="a"), recorded(other, answered(other), gimbal="b")],
        tmp_path / "a.html",
    )
    assert numbers.comparisons == ()
    assert any("commanded differently" in note for note in numbers.notes)


def test_the_page_and_the_json_hold_the_same_numbers(three):
    numbers, page = three
    text = page.read_text(encoding="utf-8")
    inside = re.search(r'<script type="application/json" id="numbers">(.*?)</script>', text, re.S)
    assert inside is not None
    assert json.loads(inside[1]) == json.loads(json.dumps(numbers.to_dict(), allow_nan=False))
    figure = next(f for f in numbers.runs[0].figures[0].figures if f.name == "rise_time up")
    assert value_text(figure) in text


def test_a_table_of_anybodys_rig_makes_the_same_figures():
    """A record with stamps and names of its own, commands only where they change."""
    commands = stepped()
    angles = answered(commands)
    rows = np.append(0, np.flatnonzero(np.diff(commands, axis=0).any(axis=1)) + 1)
    t = DT * np.arange(len(commands))
    names = ("pot1", "pot2")
    own = measurement(
        t, commands[rows], command_time=t[rows], angle=angles, inputs=names, outputs=names
    ).resampled()
    for a, b in zip(own.axes, recorded(commands, angles).axes, strict=True):
        assert a.component.startswith("pot")
        pairs = zip(axis_figures(a).figures, axis_figures(b).figures, strict=True)
        assert all(x.value == pytest.approx(y.value, rel=1e-9, abs=1e-12) for x, y in pairs)


def test_flights_are_shown_without_figures_their_commands_cannot_give(tmp_path):
    commands = stepped(1)
    runs = []
    for gain, late in ((1.0, 0.0), (0.9, 0.3)):
        base = recorded(commands, answered(commands), late=late, gimbal=f"g{gain}")
        t = base.command.time
        path = TimeSeries(
            "vehicle/position", t, gain * np.stack([t, t, t], 1), "m", ("x", "y", "z")
        )
        content = base.recording
        series = {**content.series, "vehicle/position": path}
        stored = {"notes": [f"payload <{gain}> and tube overlap"]}
        flown = Recording({**content.properties, "command": "fly"}, series, flight=stored)
        runs.append(replace(base, recording=flown))
    numbers = report(runs, tmp_path / "a.html")
    assert all(not a.figures for r in numbers.runs for a in r.figures)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert 'id="flight"' in text
    assert "was shifted by" not in text  # ignition is their common time
    assert "payload &lt;0.9&gt; and tube overlap" in text


def test_a_record_that_begins_with_its_command_has_the_figures_of_that_step(tmp_path):
    """Second order from rest at 0 to 0.1 rad, one axis, no row before the command."""
    commands = np.full((400, 1), 0.1)
    angles = answered(np.repeat(commands, 2, axis=1))[:, :1]
    run = measurement(DT * np.arange(400), commands, angle=angles, inputs=("x",), outputs=("x",))
    numbers = report([run], tmp_path / "a.html")
    told = figures_of(numbers.runs[0], "x")
    overshoot = 100.0 * math.exp(-math.pi * ZETA / math.sqrt(1.0 - ZETA**2))
    assert told["overshoot up"].value == pytest.approx(overshoot, abs=0.2)
    peak = math.pi / (OMEGA * math.sqrt(1.0 - ZETA**2)) + DELAY
    assert told["peak_time up"].value == pytest.approx(peak, abs=DT)
    assert any("begins with its command" in note for note in numbers.notes)
    still = measurement(
        DT * np.arange(400), 0 * commands, angle=0 * angles, inputs=("x",), outputs=("x",)
    )
    assert report([still], tmp_path / "b.html").runs[0].kind("x") == "still"


def test_the_page_leads_with_the_answer_and_at_most_twelve_figures(three):
    """The linkage's gain is 1.1: 10 % of a motion of ±0.1 rad is 0.57°, a fit of about 90 %."""
    text = three[1].read_text(encoding="utf-8")
    order = re.findall(r'<section id="([a-z-]+)">', text)
    assert order[:3] == ["summary", "histories", "key-figures"]
    head = text[text.index('id="summary"') : text.index('id="histories"')]
    assert "linkage matches firmware with visible differences: fit 90" in head
    assert "model matches firmware closely" in head
    assert "<li class=fair>linkage: fit 90" in head
    key = text[text.index('id="key-figures"') : text.index('id="overview"')]
    assert 5 <= key.count("<tr>") - 1 <= 12
    assert "<details><summary>Every figure" in text[text.index('id="figures"') :]
    assert "<th scope=col>fit, no offset" in text
    assert "dates commands by the pulse frames" in text
    assert "Repeats of a simulation differ" in text


def test_a_threshold_that_no_step_was_too_small_for_is_no_key_figure():
    bounded = Figure("threshold", 0.01, "rad", 0.14, 9, (0.005, 0.01))
    for figure, shown in ((bounded, True), (replace(bounded, interval=(0.0, 0.01)), False)):
        axis = AxisFigures("x", "staircase", (figure,))
        run = RunNumbers("rig", "measured", 1.0, 9, (axis,), {})
        assert bool(largest_figures(run, "x")) == shown


@pytest.mark.parametrize("share", [0.2, 0.1])  # of the motion: the fit is poor, and fair
def test_the_fit_without_the_sensors_offset_stands_beside_the_fit(tmp_path, share):
    """Readings off by a constant, but else the model's: all of the difference is the offset."""
    commands = stepped(2)
    answer = answered(commands)
    off = share * answer.std(axis=0).min()
    rig = recorded(commands, answer + off, motion="measured", gimbal="firmware")
    report([rig, recorded(commands, answer, gimbal="linkage")], tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "closely but for a constant offset: fit 100 % without it" in text
    assert f"fit {100 - 100 * share:.0f} %, 100 % without offset" in text


def test_a_report_of_a_rig_alone_says_nothing_of_simulations(tmp_path):
    commands = stepped(2)
    report([recorded(commands, answered(commands), motion="measured")], tmp_path / "a.html")
    assert "simulation" not in (tmp_path / "a.html").read_text(encoding="utf-8").split("<script")[0]


def test_differences_below_the_practical_tolerance_are_not_marked():
    """0.3 ms outside a narrow interval is nothing; 3 % of a gain is."""
    measured = (
        Figure("rise_time", 0.0300, "s", 0.1, 6, (0.02999, 0.03001)),
        Figure("gain", 1.0, "1", 0.1, 6, (0.999, 1.001)),
    )
    other = (Figure("rise_time", 0.0303, "s", 0.1, 6), Figure("gain", 1.03, "1", 0.1, 6))
    assert [m.name for m, _ in disagreements(measured, other)] == ["gain"]


def test_numbers_of_a_flight_are_those_of_a_parabola():
    """Thrown with 30 m/s up and 10 m/s to the side: v²/2g high after v/g, 2 v/g long."""
    g, t = 9.81, np.arange(0.0, 60.0 / 9.81, DT)
    base = recorded(np.zeros((len(t), 2)), np.zeros((len(t), 2)))
    place = np.stack([6.0 * t, 8.0 * t, 5.0 + 30.0 * t - g * t * t / 2], 1)
    speed = np.stack([6.0 + 0 * t, 8.0 + 0 * t, 30.0 - g * t], 1)
    series = {
        **base.recording.series,
        "vehicle/position": TimeSeries("vehicle/position", t, place, "m", ("x", "y", "z")),
        "vehicle/velocity": TimeSeries("vehicle/velocity", t, speed, "m/s", ("x", "y", "z")),
    }
    found = flown(Recording(base.recording.properties, series))
    assert found is not None
    assert found.numbers["apogee_m"] == pytest.approx(900.0 / (2 * g), abs=1e-4)
    assert found.numbers["apogee_s"] == pytest.approx(30.0 / g, abs=DT)
    assert found.numbers["max_ascent_speed_m_s"] == pytest.approx(math.hypot(30.0, 10.0))
    assert found.numbers["downrange_m"] == pytest.approx(10.0 * t[-1])
    assert found.numbers["end_north_m"] == pytest.approx(8.0 * t[-1])
    assert "burnout_s" not in found.numbers
    assert flown(base.recording) is None


def test_stored_figures_of_a_flight_that_are_no_numbers_are_left_out():
    t = np.arange(3.0)
    path = TimeSeries(POSITION, t, np.stack([t, t, t], 1), "m", ("x", "y", "z"))
    stored = {
        "max_mach": math.nan, "apogee_m": 10**400, "burnout_s": "2", "max_dynamic_pressure_pa": 9,
        "wind": "w" * 9000, "missed": [1, "late"], "target_m": [1.0, None, 3.0],
        "static_margin": [1.5, 2.0], "ended": {}, "notes": ["n" * 9000] * 99,
    }  # fmt: skip
    found = flown(Recording({}, {POSITION: path}, flight=stored))
    assert found is not None
    assert found.numbers == {
        "max_height_m": 2.0, "flight_time_s": 2.0, "downrange_m": math.hypot(2.0, 2.0),
        "end_east_m": 2.0, "end_north_m": 2.0, "max_dynamic_pressure_pa": 9.0,
        "margin_loaded": 1.5, "margin_empty": 2.0,
    }  # fmt: skip
    assert len(found.texts["wind"]) == 200
    assert found.texts["missed"] == "1; late"
    assert found.target is None
    assert [len(n) for n in found.notes] == [400] * 20
    assert "ended" not in found.texts


def test_thinning_keeps_every_peak():
    y = np.random.default_rng(0).normal(size=100_000)
    y[54_321] = 50.0
    t, thin = thinned(np.arange(len(y)), y, 1000)
    assert len(t) <= 1002
    assert (thin.max(), thin.min()) == (50.0, y.min())
    assert t[np.argmax(thin)] == 54_321


@pytest.mark.parametrize(
    ("figure", "says"),
    [
        (Figure("a", 0.0542, "s", n=6, interval=(0.0539, 0.0545)), "54.20 ± 0.30 ms"),
        (Figure("a", math.radians(5.0), "rad"), "5°"),
        (Figure("a", math.nan, "Hz"), "not measurable"),
        (Figure("a", 8.0, "Hz", interval=(7.9, 8.5)), "8.00 (7.90 to 8.50) Hz"),
    ],
)
def test_figures_read_in_units_people_use(figure, says):
    assert value_text(figure) == says


def test_numbers_have_no_exponent_where_people_would_write_none():
    assert number(11200.0, 3) == "11200"
    assert number(-0.00012345) == "−0.0001234"


# --- hostile content ---------------------------------------------------------------------------


class Tags(HTMLParser):
    """Start tags of a page, outside of script elements as a browser sees them."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


def hostile() -> Measurement:
    commands = stepped(1)
    base = recorded(commands, answered(commands), gimbal=HOSTILE, signal=HOSTILE)
    content = base.recording
    properties = {**content.properties, HOSTILE: {HOSTILE: HOSTILE}, "seed": HOSTILE}
    events = (Event(0.0, HOSTILE, HOSTILE),)
    return replace(base, recording=Recording(properties, content.series, events, events))


def test_text_from_a_recording_stays_text(tmp_path):
    report([hostile(), hostile()], tmp_path / "a.html", title=HOSTILE)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    tags = Tags()
    tags.feed(text)
    names = [t for t, _ in tags.found]
    assert "img" not in names
    assert names.count("script") == 4  # plots, numbers, library, own
    assert not [a for _, a in tags.found if any(k.startswith("on") for k in a)]
    assert not [a for t, a in tags.found if a.get("src")]
    data = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.S)
    assert len(data) == 2
    assert not any(c in content for content in data for c in "<>")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda p: report([], p / "a.html"), "no recording"),
        (lambda p: report([measurement_of(Recording({}, {}))], p / "a.html"), "no gimbal/command"),
        (lambda p: report([hostile()], p / "a.txt"), ".html"),
        (lambda p: report([hostile()], p / "file" / "a.html"), "cannot write"),
        (lambda p: labelled([hostile()], ["a", "b"]), "2 labels"),
    ],
)
def test_what_cannot_be_reported_is_one_line_and_leaves_no_file(tmp_path, make, says):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(match=re.escape(says)) as told:
        make(tmp_path)
    assert "\n" not in str(told.value)
    assert [p.name for p in tmp_path.rglob("*")] == ["file"]


# --- in a browser ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    """The DevTools driver of the viewer, or a skip that never happens where green means seen."""
    from tests import browser

    if not any(map(shutil.which, browser.NAMES)):
        message = "needs chromium (`bash .ci/test-tools` installs it)"
        pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)
    return browser


DRAWN = "document.documentElement?.dataset.drawn"
EMPTY = "p => !p.querySelector('.scatterlayer path[d]')"


class Watch:
    """One open page: what it asked for, what it complained about, what it shows."""

    def __init__(self, page) -> None:
        self.page, self.requests = page, []
        listen = page._listen

        def noted(message):
            parameters = message.get("params", {})
            if message.get("method") == "Network.requestWillBeSent":
                self.requests.append(parameters["request"]["url"])
            if message.get("method") == "Log.entryAdded":
                page.complaints.append(parameters["entry"]["text"])
            listen(message)

        page._listen = noted
        page.send("Network.enable")
        page.send("Log.enable")

    def value(self, expression: str):
        answer = self.page.send("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def drawn(self, file) -> int:
        self.page.send("Page.navigate", url=file.as_uri())
        until = time.monotonic() + 60.0
        while time.monotonic() < until:
            if count := self.value(f"location.href === {json.dumps(file.as_uri())} && {DRAWN}"):
                return int(count)
            time.sleep(0.1)
        raise AssertionError(f"nothing drawn; {self.page.complaints}")


@pytest.fixture(scope="module")
def watch(browser):
    with browser.opened("about:blank", (1200, 900)) as page:
        yield Watch(page)


def test_a_browser_draws_every_plot_asks_for_nothing_and_complains_about_nothing(three, watch):
    from PIL import Image

    _, file = three
    watch.requests.clear()
    watch.page.complaints.clear()
    plots = watch.drawn(file)
    assert plots == watch.value("document.querySelectorAll('.plot').length") >= 3
    empty = f"[...document.querySelectorAll('.plot')].filter({EMPTY}).length"
    assert watch.value(empty) == 0
    # hardware, linkage and model each have their colour, and their ink is on the page
    box = watch.value(
        "(() => { const r = document.getElementById('plot-steps').getBoundingClientRect();"
        " return [r.x, r.y + scrollY, r.width, r.height]; })()"
    )
    clip = dict(zip(("x", "y", "width", "height"), box, strict=True), scale=1)
    shot = watch.page.send("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB"), int)
    for colour in ((0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00), (0x00, 0x9E, 0x73)):
        assert (np.abs(pixels - colour).sum(axis=2) < 60).sum() > 150, colour
    assert watch.page.complaints == []
    assert watch.requests == [file.as_uri()]


def test_a_browser_runs_nothing_and_links_nothing_from_a_hostile_recording(tmp_path, watch):
    file = tmp_path / "a.html"
    report([hostile(), hostile()], file, title=HOSTILE)
    # one that slips past the escaping: the policy stops it
    text = file.read_text(encoding="utf-8").replace("</main>", "<script>alert(3)</script></main>")
    (tmp_path / "b.html").write_text(text, encoding="utf-8")
    watch.requests.clear()
    watch.page.complaints.clear()
    watch.drawn(file)
    assert watch.value("document.images.length") == 0
    assert watch.value("document.querySelectorAll('.plot a, .plot img, .plot image').length") == 0
    assert HOSTILE[:40] in watch.value("document.querySelector('.legend').textContent")
    assert watch.page.complaints == []
    assert watch.requests == [file.as_uri()]
    watch.drawn(tmp_path / "b.html")
    assert any("Content Security Policy" in c for c in watch.page.complaints)
    watch.page.complaints.clear()


def test_it_prints_on_light_paper_within_the_margins(three, watch):
    """Printed from a dark screen: ink is dark, and no plot is wider than the paper's text."""
    _, file = three
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    watch.page.send("Emulation.setEmulatedMedia", features=dark)
    watch.drawn(file)
    ground = "getComputedStyle(document.body).backgroundColor"
    assert watch.value(ground) == "rgb(20, 24, 30)"
    watch.value("dispatchEvent(new Event('beforeprint')), 0")
    widths = "[...document.querySelectorAll('.plot .main-svg')].map(s => s.width.baseVal.value)"
    assert max(watch.value(widths)) <= 690
    assert watch.value(ground) == "rgb(255, 255, 255)"
    watch.value("dispatchEvent(new Event('afterprint')), 0")
    assert max(watch.value(widths)) > 690
    printed = base64.b64decode(watch.page.send("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4
    watch.page.send("Emulation.setEmulatedMedia", features=[])


def test_a_page_can_be_made_of_other_sections(tmp_path):
    line = Line("a", np.arange(3.0), np.array([0.0, math.nan, 1.0]), "run0")
    plot = Plot("one", "caption", "x", (Panel("p", "y"),), (line,))
    render(
        [Section("s", "S", ("text",), (plot, Table(("h",), (("c",),))))], "t", tmp_path / "a.html"
    )
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert '"y":[0.0,null,1.0]' in text
    assert not list(tmp_path.glob("*.partial"))


@pytest.mark.thorough
def test_a_model_answers_commands_at_the_stamps_of_a_log_that_jitter():
    """A first order in closed form; on an even grid each command would come half a tick late."""
    rng = np.random.default_rng(4)
    time = 0.01 * np.arange(400) + rng.uniform(-0.004, 0.004, 400)
    level = np.radians(5.0) * np.where(np.arange(400) // 40 % 2, 1.0, -1.0)
    pole = 30.0
    series = TimeSeries("u", time, level[:, None], "rad", ("x",))
    angle = TimeSeries("gimbal/measured", time, 0.0 * level[:, None], "rad", ("x",))
    log = Measurement(series, angle, name="log", recording=Recording({}, {}))
    model = TransferFunctionModel(((Channel((pole,), (1.0, pole), 0.0),),), ("x",), ("x",))
    found = simulated(log, "model", model).angles
    true, at = np.zeros_like(found.time), np.searchsorted(time, found.time, side="right") - 1
    y = 0.0
    for k in range(len(time)):  # from one stamp to the next
        now = at == k
        decay = np.exp(-pole * (found.time[now] - time[k]))
        true[now] = level[k] + (y - level[k]) * decay
        if k + 1 < len(time):
            y = level[k] + (y - level[k]) * np.exp(-pole * (time[k + 1] - time[k]))
    error = found.values[:, 0] - true
    assert np.degrees(np.sqrt(np.mean(error**2))) < 0.05


@pytest.mark.parametrize("share", [0.0, 0.08])
def test_figures_at_rest_say_what_the_other_command_moves(share):
    """Two first-order axes, both commanded at once; y also follows x's command by `share`."""
    rng = np.random.default_rng(2)
    at = np.arange(0.0, 20.0, 0.01)
    command = np.repeat(np.radians(rng.choice([-6.0, -3.0, 3.0, 6.0], (40, 2))), 50, axis=0)
    answer = lfilter([0.2], [1.0, -0.8], command, axis=0)
    angle = answer + share * answer[:, [0, 0]] * [0.0, 1.0]
    angle += rng.normal(0.0, np.radians(0.02), angle.shape)
    x, y = run_figures(measurement(at, command, angle=angle, stamps="exact"))[:2]
    assert not [n for n in x.notes if "as well" in n]
    said = [re.search(r"command of x moves here as well, ([\d.]+) %", n) for n in y.notes]
    assert [float(m[1]) for m in said if m] == pytest.approx([8.0] if share else [], abs=0.5)
