"""Hardware in the loop: flights of rigs, their determinism, and how far their models lie off."""

import math
from dataclasses import replace

import numpy as np
import pytest

import twin
from analysis.comparison.flights import flight_path, path_difference
from analysis.recording import read
from hardware.simavr.nano import missing
from tests.twin.cli.test_cli import run as command
from tests.twin.experiments.test_fly import compared
from tests.twin.plant.test_reference_gimbal import agree
from twin.config import Fly
from twin.experiments.flight.fly import fly

needs_avr = pytest.mark.skipif(bool(missing()), reason=f"without {', '.join(missing())}")
RIGS = ["emulator", pytest.param("firmware", marks=needs_avr)]


@pytest.mark.thorough
@pytest.mark.parametrize("gimbal", RIGS)
def test_flights_of_one_seed_are_equal_recordings_and_another_seed_is_not(tmp_path, gimbal):
    paths = [tmp_path / f"{k}.rrd" for k in range(3)]
    for path, seed in zip(paths, (6, 6, 7), strict=True):
        fly(Fly(gimbal=gimbal, unit=2, seed=seed, duration_s=0.1, out=path))
    assert compared(paths[0], paths[1]) == 0
    assert compared(paths[0], paths[2]) != 0


@pytest.fixture(
    scope="module",
    params=[
        *(pytest.param((p, 16.0), marks=pytest.mark.slow) for p in ("hold", "step", "doublet")),
        ("doublet", 8.0),  # seconds; the motor burns for 15
    ],
    ids=lambda p: f"{p[0]}-{p[1]:g}",
)
def pair(request, tmp_path_factory):
    """The same flight with the emulated rig and with the shipped identified model."""
    programme, seconds = request.param
    folder = tmp_path_factory.mktemp(programme)
    files = []
    for gimbal in ("emulator", "transfer-function"):
        out = folder / f"{gimbal}.rrd"
        fly(Fly(gimbal=gimbal, programme=programme, duration_s=seconds, out=out))
        files.append(out)
    return files


@pytest.mark.thorough
def test_rig_and_identified_model_fly_alike(pair):
    rig, model = (read(p) for p in pair)
    apart = path_difference(flight_path(rig), flight_path(model))
    assert apart.time > min(rig["gimbal/measured"].time[-1] - 0.1, 15.0)
    assert math.degrees(apart.attitude_rms) < 1.5  # issue's figures
    assert apart.share < 0.02
    agree([rig, model])


def test_the_vehicles_joints_go_where_the_rig_was_measured(pair):
    run = read(pair[0])
    seen, shown = run["gimbal/measured"], run["gimbal/followed"]
    at = np.arange(1.0, shown.time[-1] - 1.0, 0.01)
    # a reading is 2 to 4 ms old when its tick comes; from then on the joints move at its rate
    late = [
        np.abs(
            np.interp(at, shown.time, shown.values[:, k])
            - np.interp(at - 3e-3, seen.time, seen.values[:, k])
        )
        for k in range(2)
    ]
    # 3 ms of a servo's fastest 200 °/s are 0.6°; the median knows only the slow ones
    assert np.degrees(np.median(late)) < 0.05


def test_angle_and_rate_that_are_followed_are_true_to_each_other(pair):
    run = read(pair[0])
    angle, rate = run["gimbal/followed"], run["gimbal/rate/followed"]
    quotient = np.diff(angle.values, axis=0) / np.diff(angle.time)[:, None]
    # within a tick the rate is constant, but for the step in which it changes
    off = np.degrees(abs(quotient - rate.values[1:]))
    assert np.degrees(abs(rate.values)).max() > 50.0
    assert np.sqrt(np.mean(off**2)) < 1.0


def test_compare_says_how_far_they_part(capsys, tmp_path, pair):
    apart = path_difference(*(flight_path(read(p)) for p in pair))
    out = str(tmp_path / "c.rrd")
    code, text, _ = command(capsys, "compare", *map(str, pair), "--out", out)
    assert code == 0
    told = next(line for line in text.splitlines() if line.startswith("flights, under power"))
    assert f"{math.degrees(apart.attitude_rms):.2f}° rms" in told
    assert f"{apart.path_worst:.2f} m at most" in told
    names = [line.split("  ")[0] for line in text.splitlines()]
    assert names.index("flights, under power") == 2
    assert names.index("ends apart") < names.index("delay")


def test_compare_grades_no_axis_of_a_flight_that_hardly_moved(tmp_path, pair):
    """As if differences below a turn did not matter."""
    found = twin.compare(*pair, out=tmp_path / "c.rrd")
    assert all(a.tolerance == math.radians(0.05) for a in found.comparison.axes)
    axes = tuple(replace(a, tolerance=2 * math.pi) for a in found.comparison.axes)
    rows = replace(found, comparison=replace(found.comparison, axes=axes)).rows()
    assert dict(rows)["fit"].split() == 2 * ["hardly", "moved"]
    assert dict(rows)["delay"].split() == ["-", "-"]
    said = [text.split(",")[0] for name, text in rows if name == "fit not counted"]
    assert said == ["x: hardly moved", "y: hardly moved"]


def test_overrides_of_servos_reach_the_rig_that_has_them(capsys, tmp_path):
    """A servo in honey: 0.18 N·m turn 50 N·m·s/rad by 0.06° in 0.3 s."""
    line = "step --gimbal emulator --repeats 1 --axis x --hold-s 0.3 --on-fault ignore"
    out = tmp_path / "a.rrd"
    more = f"--set gimbal_servo_x.damping=50 --out {out}"
    assert command(capsys, *line.split(), *more.split())[0] == 0
    assert abs(np.degrees(read(out)["gimbal/measured"].values[:, 0])).max() < 0.5
    wrong = f"--set gimbal_servo_z.damping=50 --out {tmp_path / 'b.rrd'}"
    code, _, err = command(capsys, *line.split(), *wrong.split())
    assert (code, err.count("\n")) == (2, 1)
    assert "gimbal_servo_z" in err
