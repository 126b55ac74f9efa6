"""The mission of the thesis's table 1, and that a run can be trusted and repeated."""

import json
import math
import subprocess
import sysconfig
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.export import scene
from analysis.recording import reader as recording
from analysis.transfer_function import TransferFunctionModel
from twin.config import Fly, Step
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.step import step
from twin.plant.model.compose import MJCF
from twin.plant.model.model import REFERENCE_GIMBAL

RERUN = Path(sysconfig.get_path("scripts")) / "rerun"
CONE = [
    *((0, 0), (30, 0), (-30, 0), (0, 30), (0, -30)),
    *(pytest.param(p, marks=pytest.mark.slow) for p in ((15, 0), (-15, 0), (0, 15), (0, -15))),
]
H13ST = Path("motors") / "AeroTech_H13ST.eng"


@pytest.mark.parametrize("off_axis", CONE, ids=str)
def test_the_vehicle_passes_within_5_m_of_a_point_500_m_away_anywhere_in_the_cone(
    tmp_path, off_axis
):
    result = fly(Fly(programme="point", off_axis_deg=off_axis, out=tmp_path / "fly.rrd"))
    assert result.closest_approach_m < 5.0  # the figure
    assert result.warnings == {}


@pytest.mark.parametrize("source", ["reference", "published curve"])
def test_mass_range_and_speed_are_those_of_the_thesis(tmp_path, request, source):
    motor = None
    if source == "published curve":
        motor = request.getfixturevalue("shared_data") / H13ST
    result = fly(Fly(motor=motor, out=tmp_path / "fly.rrd"))
    assert 0.9 <= result.mass_kg <= 1.1
    assert 50 <= result.max_speed_m_s <= 100
    assert result.powered_slant_range_m >= 500
    assert result.loop_closure_max_um < 50  # through the whole flight
    assert result.warnings == {}


@pytest.mark.thorough
def test_the_identified_model_flies_like_the_linkage_it_stands_for(tmp_path):
    linkage = fly(Fly(out=tmp_path / "linkage.rrd"))
    model = fly(Fly(gimbal="transfer-function", out=tmp_path / "model.rrd"))
    # a calibrated servo gimbal is far faster than the attitude loop, so its kind matters little
    assert model.powered_slant_range_m == pytest.approx(linkage.powered_slant_range_m, rel=0.02)


def compared(a: Path, b: Path) -> int:
    command = [RERUN, "rrd", "compare", "--unordered", "--ignore-timeline", "wall_time", a, b]
    return subprocess.run(command, capture_output=True, check=False).returncode


def test_two_runs_of_one_seed_record_the_same_and_another_seed_does_not(tmp_path):
    gusts = ("wind_speed=8", "wind_turbulence=0.2")
    paths = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        paths.append(tmp_path / f"{name}.rrd")
        fly(Fly(set=gusts, seed=seed, duration_s=1.0, out=paths[-1]))
    assert compared(paths[0], paths[1]) == 0
    assert compared(paths[0], paths[2]) != 0


def test_the_recording_says_how_to_run_it_again(tmp_path):
    fly(Fly(duration_s=0.2, seed=4, out=tmp_path / "fly.rrd"))
    run = recording.read(tmp_path / "fly.rrd").properties
    assert run["configuration"]["duration_s"] == 0.2
    assert run["seed"] == 4
    assert set(run["versions"]) >= {"mujoco", "tvc-twin", "rerun-sdk"}
    assert len(run["model_sha256"]) == 64
    assert run["method"] == {"integrator": "rk4", "step_s": 0.004}


PASSIVE = MJCF / "examples" / "flights" / "valetudo.toml"


@pytest.mark.parametrize(
    "config",
    [Fly(vehicle=PASSIVE, control_hz=50.0), Fly(programme="point", duration_s=2.5)],
    ids=["passive, to the ground", "linkage, guided"],
)
def test_compiled_ticks_record_what_the_loop_in_python_records(tmp_path, monkeypatch, config):
    made = []
    for name in ("compiled", "loop"):
        made.append(fly(replace(config, out=tmp_path / f"{name}.rrd")))
        monkeypatch.setattr("twin.experiments.flight.fly.compiled_ticks", lambda *_: None)
    one, other = (recording.read(tmp_path / f"{name}.rrd") for name in ("compiled", "loop"))
    assert one.properties == other.properties
    assert one.events == other.events
    assert set(one.series) == set(other.series)
    for name, series in one.series.items():
        assert np.array_equal(series.time_ns, other[name].time_ns), name
        assert np.array_equal(series.values, other[name].values, equal_nan=True), name
    for a, b in zip(*(scene.bodies(Path(r.recording)) for r in made), strict=True):
        assert np.array_equal(a.position, b.position), a.name
        assert np.array_equal(a.attitude, b.attitude), a.name


def test_the_recording_keeps_overrides_and_files_whole(tmp_path):
    override = tmp_path / "set.json"
    override.write_text('{"wind_speed": 3}')
    model = Path(__file__).resolve().parents[3] / "mjcf" / "gimbal.json"
    given = Fly(
        set_from=override, set=("gravity[2]=-9.7",), gimbal="transfer-function", model=model,
        duration_s=0.1, out=tmp_path / "fly.rrd",
    )  # fmt: skip
    fly(given)
    run = recording.read(tmp_path / "fly.rrd").properties
    assert run["configuration"]["set"] == ["wind_speed=3.0", "gravity[2]=-9.7"]
    assert run["files"]["model"]["text"] == model.read_text()


def end(out: Path, integrator: str) -> np.ndarray:
    fly(Fly(gimbal="transfer-function", integrator=integrator, duration_s=2.0, out=out))  # type: ignore[arg-type]
    return recording.read(out).series["vehicle/position"].values[-1]


@pytest.fixture(scope="module")
def implicit_end(tmp_path_factory):
    return end(tmp_path_factory.mktemp("implicit") / "fly.rrd", "implicitfast")


@pytest.mark.parametrize("integrator", ["euler", "rk4", "ab1", "ab2", "ab3", "ab4"])
def test_every_integrator_flies_the_same_path(tmp_path, integrator, implicit_end):
    # first-order schemes err by about dt/2 of the acceleration's change; 27 m flown by then
    np.testing.assert_allclose(end(tmp_path / "fly.rrd", integrator), implicit_end, atol=0.15)


@pytest.mark.parametrize("gimbal", ["linkage", "transfer-function"])
def test_a_step_ends_at_the_command(tmp_path, gimbal):
    out = tmp_path / "step.rrd"
    step(Step(gimbal=gimbal, repeats=1, amplitude_deg=5, out=out))
    series = recording.read(out).series
    command = series["gimbal/command"].values
    reached = series["gimbal/simulated"].values
    last = np.flatnonzero(np.diff(command, axis=0).any(axis=1))  # end of every hold
    gain = np.ones(2)
    if gimbal == "transfer-function":  # identified on a bench: the motor's weight pushes outwards
        model = TransferFunctionModel.read(REFERENCE_GIMBAL)
        own = [model.channel(a, a) for a in "xy"]
        gain = np.array([c.num[-1] / c.den[-1] for c in own])
    error = np.abs(reached[last] - gain * command[last]).max()
    # at the shaft: half the backlash 0.25°, dead band 0.25°, friction and weight over the servo's
    # stiffness (0.006 + 0.007 N m)/1.8 N m/rad = 0.4°; the horn of 8 mm on an arm of 20.5 mm makes
    # 0.35° of them at the gimbal. The identified model has none of these.
    assert error < math.radians(0.35 if gimbal == "linkage" else 0.01)


def test_a_vehicle_that_waits_on_the_pad_has_not_passed_its_point(tmp_path):
    late = Fly(target=(300, 0, 300), set=("motor_ignition=3",), out=tmp_path / "fly.rrd")
    result = fly(late)
    assert result.ended == "passed the point"
    assert result.closest_approach_m < 5.0


def numbers(name: str, values: list[float], size: int = 64) -> tuple[str, ...]:
    """`--set` of a whole numeric; its last value fills it up."""
    padded = [*values, *[values[-1]] * (size - len(values))]
    return tuple(f"{name}[{k}]={v!r}" for k, v in enumerate(padded))


UNLIT = (*numbers("motor_thrust", [0.0]), "motor_impulse=0")


def test_a_vehicle_without_thrust_falls_when_dropped(tmp_path):
    dropped = (*UNLIT, "ramp_length=0", "ramp_position[2]=20")
    result = fly(Fly(set=dropped, out=tmp_path / "fly.rrd"))
    assert result.ended == "reached the ground"
    assert result.flight_time_s == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "weak",
    [
        UNLIT,
        (  # 49 N under 4.15 kg for half a second: 2 m in a vacuum without friction, 3 m of rail
            *numbers("motor_time", [0.0, 0.05, 0.5, 0.55]),
            *numbers("motor_thrust", [0.0, 49.0, 49.0, 0.0]),
            "motor_impulse=24.5",
        ),
    ],
    ids=["unlit", "weak"],
)
def test_a_motor_too_weak_for_its_ramp_is_refused(tmp_path, weak):
    rocket = MJCF / "examples" / "large_rocket.xml"
    with pytest.raises(TwinError, match="cannot leave its ramp"):
        fly(Fly(vehicle=rocket, set=weak, out=tmp_path / "fly.rrd"))
    assert not list(tmp_path.iterdir())


def test_a_vehicle_that_drag_keeps_on_its_ramp_ends_there(tmp_path):
    """In a vacuum it would leave; with a drag coefficient of 3000 it comes to rest on the rail."""
    hop = (
        *numbers("motor_time", [0.0, 0.05, 0.8, 0.85]),
        *numbers("motor_thrust", [0.0, 70.0, 70.0, 0.0]),
        "motor_impulse=56", "air_axial_drag=3000",
    )  # fmt: skip
    rocket = MJCF / "examples" / "large_rocket.xml"
    result = fly(Fly(vehicle=rocket, set=hop, out=tmp_path / "fly.rrd"))
    assert result.max_speed_m_s > 1.0  # it did move
    assert result.ended == "never left the ramp"
    assert result.flight_time_s < 10.0


def test_a_vehicle_that_falls_back_onto_its_ramp_has_landed(tmp_path):
    """Straight up in a vacuum: it comes back with the speed it left the rail with."""
    hop = (
        *numbers("motor_time", [0.0, 0.05, 0.2, 0.25]),  # out before the rail ends
        *numbers("motor_thrust", [0.0, 300.0, 300.0, 0.0]),
        "motor_impulse=60", "air_enabled=0", "ramp_elevation=1.5707963",
    )  # fmt: skip
    rocket = MJCF / "examples" / "large_rocket.xml"
    result = fly(Fly(vehicle=rocket, set=hop, out=tmp_path / "fly.rrd"))
    assert result.ended == "reached the ground"
    assert result.flight_time_s < 5.0
    figures = result.figures
    ticks = 2 * 9.81 * 0.004
    assert figures.impact_speed_m_s == pytest.approx(figures.rail_exit_speed_m_s, abs=ticks)


def test_a_missed_point_names_its_reason_and_fails_where_a_distance_was_asked_for(tmp_path):
    far = {"programme": "point", "gimbal": "transfer-function", "target_range_m": 3000.0}
    result = fly(Fly(**far, within=5.0, duration_s=17.0, out=tmp_path / "far.rrd"))
    assert not result.passed
    assert result.closest_approach_m > 2000.0
    assert "burned out" in result.missed[0]
    assert "ended before it passed the point: time" in result.missed[-1]
    assert "MISSED" in result.text()


def test_a_reached_point_passes(tmp_path):
    result = fly(
        Fly(programme="point", within=1.0, gimbal="transfer-function", out=tmp_path / "f.rrd")
    )
    assert result.passed
    assert result.missed == ()


def test_a_distance_without_a_point_is_refused():
    with pytest.raises(TwinError, match="--within 5: needs --programme point or --target"):
        Fly(within=5.0)


@pytest.mark.parametrize(
    "asked", [{"target": (0.0, 0.0, 300.0)}, {"programme": "point"}, {"programme": "step"}], ids=str
)
def test_a_vehicle_whose_motor_is_fixed_is_not_told_to_steer(tmp_path, asked):
    rocket = MJCF / "examples" / "large_rocket.xml"
    with pytest.raises(TwinError, match="motor is fixed"):
        fly(Fly(vehicle=rocket, out=tmp_path / "fly.rrd", **asked))
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("gimbal", "integrator", "dt", "largest"),
    [
        ("transfer-function", "ab1", 0.004, "0.0035"),
        ("transfer-function", "ab3", 0.004, "0.0025"),
        ("transfer-function", "ab4", 0.002, "0.0015"),
        ("linkage", "ab2", 0.005, "0.004"),
        ("linkage", "ab3", 0.002, "0.0015"),
        ("linkage", "ab4", 0.002, "0.0005"),
    ],
)
def test_a_step_that_the_integrator_cannot_take_is_refused_and_the_largest_flies(
    tmp_path, gimbal, integrator, dt, largest
):
    ramp = (("ramp_stiffness", 15000.0), ("ramp_damping", 60.0))  # elastic, of the table
    asked = Fly(
        gimbal=gimbal, integrator=integrator, dt=dt, control_hz=1 / dt, duration_s=2.0, set=ramp
    )
    with pytest.raises(TwinError, match=f"--dt {dt:g}.*{integrator}.* {largest} s"):
        fly(replace(asked, out=tmp_path / "fly.rrd"))

    def end(**changes) -> np.ndarray:
        out = tmp_path / "fly.rrd"
        fly(replace(asked, out=out, **changes))
        return recording.read(out).series["vehicle/position"].values[-1]

    limit = float(largest)
    flown = end(dt=limit, control_hz=1 / limit)
    right = end(dt=limit / 4, control_hz=1 / limit, integrator="rk4")
    np.testing.assert_allclose(flown, right, atol=0.3)  # of 27 m


def test_a_step_past_the_stops_is_refused():
    with pytest.raises(TwinError, match="stops"):
        step(Step(amplitude_deg=12))


@pytest.mark.parametrize(
    ("factors", "says"),
    [((-1.0, 1.0), "axis x by -1"), ((1.0, 57.3), r"axis y by [56].*stable for 0.057° to 2.3°")],
)
def test_a_model_of_the_wrong_sign_or_size_is_flown_with_consent_only(tmp_path, factors, says):
    settings = {"gimbal": "transfer-function", "model": scaled(tmp_path, factors)}
    settings["duration_s"] = 0.02
    with pytest.raises(TwinError, match=says):
        fly(Fly(**settings), recorded=False)
    assert fly(Fly(**settings, any_gain=True), recorded=False).flight_time_s > 0.0


def scaled(folder, factors):
    """The shipped identified model with other gains."""
    content = json.loads((MJCF / "gimbal.json").read_text())
    for k, factor in enumerate(factors):
        channel = content["channels"][k][k]
        channel["num"] = [factor * n for n in channel["num"]]
    file = folder / "model.json"
    file.write_text(json.dumps(content))
    return file


class Still:
    def update(self, time, gimbal, vehicle):
        return 0.0, 0.0


@pytest.mark.parametrize(("factor", "refused"), [(5.0, False), (-1.0, True), (57.3, True)])
def test_an_own_controller_is_not_judged_by_the_margins_of_the_attitude_loop(
    tmp_path, factor, refused
):
    model = scaled(tmp_path, (factor, factor))
    config = Fly(gimbal="transfer-function", model=model, duration_s=0.02)
    with pytest.raises(TwinError, match="axis x"):
        fly(config, recorded=False)
    if not refused:
        assert fly(config, controller=Still(), recorded=False).flight_time_s > 0.0
        return
    with pytest.raises(TwinError) as error:
        fly(config, controller=Still(), recorded=False)
    assert "attitude loop" not in str(error.value)


@pytest.mark.parametrize("ticks", ["compiled", "loop"])
def test_an_impact_within_a_long_tick_is_a_landing(monkeypatch, ticks):
    """Steps of 4 ms go on to the end of the tick of 20 ms, and bend the stops meanwhile."""
    if ticks == "loop":
        monkeypatch.setattr("twin.experiments.flight.fly.compiled_ticks", lambda *_: None)
    flown = fly(Fly(control_hz=50, integrator="implicitfast", dt=0.004), recorded=False)
    assert flown.ended == "reached the ground"
