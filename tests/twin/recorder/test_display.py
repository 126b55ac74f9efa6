"""What a recording holds for the viewer: residual, bands, gaps, states, axes, plots that scale."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pyarrow as pa
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from analysis import recording
from tests.twin.recorder import runs
from twin.recorder import Recorder, checks
from twin.recorder.layout import blueprint, plots, profile, states, together
from twin.recorder.layout.look import Look
from twin.recorder.scene.ghost import Ghost
from twin.recorder.scene.poses import Poses
from twin.recorder.scene.scene import bodies

pytestmark = pytest.mark.looks
TICK_NS = 4_000_000
SIGNALS = ("gimbal/command", "gimbal/simulated", "gimbal/measured", "gimbal/sigma")


def rows_of(path: Path, entity: str, component: str) -> list[tuple[float, object]]:
    """Time [s] and content of the rows of one component."""
    found = []
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names and "time" in batch.schema.names:
            times = batch["time"].cast(pa.int64()).to_pylist()
            found += [
                (t * 1e-9, v) for t, v in zip(times, batch[component].to_pylist(), strict=True)
            ]
    return sorted(found, key=lambda row: row[0])


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """A run whose measured angle is the simulated one plus 0.5° and −0.2°, with a gap of 1 s."""
    path = tmp_path_factory.mktemp("display") / "run.rrd"
    offset = np.radians([0.5, -0.2])
    flags = ("sensors/flags", "link/connected")
    with Recorder(path, signals=(*SIGNALS, *flags), properties={}) as recorder:
        row, at = recorder.row, recorder.slices
        for tick in range(1000):
            time = tick * TICK_NS * 1e-9
            row[:] = np.nan
            row[at["gimbal/command"]] = 0.0
            row[at["gimbal/simulated"]] = simulated = runs.angle(time)
            if not 2.0 < time < 3.0:
                row[at["gimbal/measured"]] = simulated + offset
                row[at["gimbal/sigma"]] = np.radians(0.05)
            if tick in (0, 250, 500, 750):
                row[at["sensors/flags"]] = {0: 0, 250: 1, 500: 3, 750: 5}[tick]
            row[at["link/connected"]] = float(tick < 900)
            recorder.commit(tick * TICK_NS, tick * TICK_NS)
        recorder.health(0, "ok")
    return path


def test_the_residual_is_measured_minus_simulated_with_two_sigma_about_zero(beside):
    rows = rows_of(beside, plots.RESIDUAL, "Scalars:scalars")
    assert len(rows) == pytest.approx(300, abs=60)  # at most one in 10 ms, none in the gap
    np.testing.assert_allclose(
        [v for _, v in rows], np.tile([0.5, -0.2], (len(rows), 1)), atol=1e-9
    )
    entity = plots.band("residual", 0)
    assert {v[0] for _, v in rows_of(beside, entity, "Measurements:values")} == {0.0}
    variances = [v[0] for _, v in rows_of(beside, entity, "Measurements:variances")]
    np.testing.assert_allclose(np.sqrt(variances), 0.1, rtol=1e-9)


def test_a_gap_ends_the_line_and_nothing_else_does(beside):
    (gap,) = rows_of(beside, "/gimbal/measured", "Clear:is_recursive")
    assert gap[0] == pytest.approx(2.0, abs=TICK_NS * 1e-9)
    assert rows_of(beside, "/gimbal/simulated", "Clear:is_recursive") == []
    read = recording.read(beside)["gimbal/measured"]  # the reader does not see it
    assert np.isfinite(read.values).all()
    assert np.diff(read.time).max() == pytest.approx(1.0, abs=0.01)


def test_states_change_where_flags_and_link_do(beside):
    mode = rows_of(beside, f"{states.STATES}/mode", "StateChange:state")
    assert [(round(t, 3), v[0]) for t, v in mode] == [
        (0.0, "disarmed"), (1.0, "armed"), (2.0, "driving"), (3.0, "timed out"),
    ]  # fmt: skip
    link = rows_of(beside, f"{states.STATES}/link", "StateChange:state")
    assert [(round(t, 3), v[0]) for t, v in link] == [(0.0, "connected"), (3.6, "lost")]
    health = rows_of(beside, states.HEALTH, "StateChange:state")
    assert [v for _, v in health] == [["ok"]]


def test_the_ghost_has_the_commanded_attitude_and_the_axes_those_of_their_signals(tmp_path):
    path = tmp_path / "flight.rrd"
    runs.fly(path, 1.0)
    rows = rows_of(path, "/world/ghost", "Transform3D:quaternion")
    vehicle = dict(rows_of(path, "/world/vehicle", "Transform3D:quaternion"))
    for time, (xyzw,) in rows[::10]:
        x, y = runs.angle(time)
        wanted = Rotation.from_quat(vehicle[time][0]) * Rotation.from_euler("XY", [x, y])
        np.testing.assert_allclose(
            (wanted.inv() * Rotation.from_quat(xyzw)).magnitude(), 0, atol=1e-6
        )
    time, (line,) = rows_of(path, "/world/axis/simulated", "LineStrips3D:strips")[20]
    x, y = runs.angle(time - 0.05)
    turn = Rotation.from_quat(vehicle[time][0]) * Rotation.from_euler("XY", [x, y])
    along = np.subtract(line[1], line[0])
    np.testing.assert_allclose(along / np.linalg.norm(along), turn.apply([0, 0, -1]), atol=1e-5)


def test_phases_of_a_flight_and_commands_at_their_limit():
    judge = states.States(["gimbal/command", "vehicle/thrust", "vehicle/velocity"], limit=0.14)
    thrust = np.array([[0.0], [5.0], [5.0], [0.0], [0.0]])
    velocity = np.array([[0, 0, 0], [0, 0, 5], [0, 0, 9], [0, 0, 3], [0, 0, -1.0]])
    names = [states.PHASES[k] for k in judge._phase(thrust, velocity)]
    assert names == ["before ignition", "thrust", "thrust", "coast", "descent"]
    command = np.array([[0.14, 0.0], [0.14, 0.1], [-0.14, 0.14], [0.0, -0.14], [0.14, 0.14]])
    assert judge._limited(command, thrust).tolist() == [0, 1, 3, 0, 0]


def test_a_signal_without_a_row_has_no_plot(tmp_path):
    path = tmp_path / "some.rrd"
    names = ["gimbal/command", "gimbal/measured", "gimbal/simulated", "sensors/gyro"]
    with Recorder(path, signals=names, properties={}) as recorder:
        for tick in range(50):
            recorder.row[:] = np.nan
            recorder.row[recorder.slices["gimbal/command"]] = 0.1
            recorder.commit(tick * TICK_NS, tick)
        recorder.drain()
        content = recorder._file.look.final(recorder._file.stream)
    assert content.signals == ["gimbal/command"]
    assert content.residual is None


def test_a_mechanism_without_gimbal_joints_has_no_ghost():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    assert not Ghost(model, bodies(model)).active


def test_a_fixed_motor_has_no_views_of_a_gimbal():
    found = []
    for joint in ("gimbal_x", "motor_x"):
        model = mujoco.MjModel.from_xml_string(runs.SCENE.replace("gimbal_x", joint))
        look = Look(runs.SIGNALS, Poses(model, 20_000_000), model, live=False)
        names = _names(blueprint.build(look.content).root_container)
        assert {"Vehicle", "Position [m]", "Thrust [N]"} <= set(names)
        found.append({n for n in names if "Gimbal" in n or "Control error" in n})
    assert {"Gimbal", "Gimbal x [deg]", "Gimbal rate y [deg/s]"} < found[0]
    assert not found[1]


def _names(part: Any) -> list[str]:
    inner = part.contents if isinstance(part, rrb.Container) else ()
    return [str(part.name), *(name for one in inner for name in _names(one))]


@pytest.mark.parametrize(("extent", "step"), [(654.0, 200.0), (12.0, 5.0), (1339.0, 500.0)])
def test_the_grid_has_a_round_step(extent, step):
    assert profile.grid_step(extent) == step


def test_a_plot_shows_the_stops_where_the_motion_comes_near_them():
    stops = [(-10.0, 10.0)] * 2
    far = plots.Known({"/gimbal/command": [(-1.0, 1.0), (-5.0, 5.0)]}, stops)
    small, large = (plots.overlay("Gimbal", ["gimbal/command"], k, far) for k in (0, 1))
    assert plots.STOPS not in small.contents
    assert plots.STOPS in large.contents


@pytest.mark.parametrize(
    ("low", "high"),
    [(-0.9, 0.9), (-3.0, 88.0), (-80.0, 64.0), (8.2, 8.9), (-5.0, 1400.0), (0.46, 0.54)],
)
def test_an_axis_shows_its_values_in_most_of_its_height_with_two_labels_where_that_allows_it(
    low, high
):
    least, most = plots.readable(low, high)
    assert least <= low < high <= most
    assert high - low > 0.6 * (most - least)
    decade = 10.0 ** np.floor(np.log10(high - low))
    labels = [np.floor(most / s) - np.ceil(least / s) + 1 for s in (decade, 10.0 * decade)]
    assert max(labels) >= 2 or (least, most) == (low, high)


def test_a_recording_has_a_name_in_the_viewer(beside, tmp_path):
    fly = {"command": "fly", "configuration": {"gimbal": "emulator"}, "seed": 3}
    assert checks.title(fly) == "fly, emulator, seed 3"
    names = [
        row["RecordingInfo:name"]
        for chunk in RrdReader(beside).stream().filter(content="/__properties/**")
        for row in chunk.to_record_batch().to_pylist()
        if "RecordingInfo:name" in row
    ]
    assert names == [["recording"]]


def test_plots_begin_with_room_for_their_legends_after_the_end_of_the_run(beside):
    reader = RrdReader(beside)
    (shown,) = (
        row["TimeAxis:view_range"][0]
        for store in reader.blueprints()
        for chunk in reader.stream(store=store).filter(content=f"/{plots.SHARED}")
        for row in chunk.to_record_batch().to_pylist()
    )
    assert shown == {"start": 0, "end": pytest.approx(1.25 * 999 * TICK_NS, rel=1e-6)}


@pytest.mark.parametrize(
    ("ranges", "legend"),
    [({}, "residual x [deg]"), ({plots.RESIDUAL: [(-0.42, 0.1)] * 2}, "residual x, at most 0.42°")],
)
def test_the_legend_of_a_residual_has_its_largest_value_once_it_is_known(ranges, legend):
    look = plots.residual(plots.RESIDUAL, 0, plots.Known(ranges))
    lines = look.visualizer_overrides[plots.RESIDUAL].overrides
    texts = [b.as_arrow_array().to_pylist() for b in lines]
    assert [legend] * 2 in texts


def test_a_plot_leaves_out_what_the_run_does_not_have():
    ranges = {"/sensors/pulse": [(1400.0, 1600.0)] * 2 + [(1500.0, 1500.0)], "/link/lost": [(0, 0)]}
    known = plots.Known(ranges)
    assert not known.moved("/link/lost")
    assert known.moved("/sensors/pulse")
    view = plots.all_components("Pulse", ["sensors/pulse"], known)
    look = view.visualizer_overrides["/sensors/pulse"]
    shown = {b.component_descriptor().component: b.as_arrow_array().to_pylist()
             for b in look.overrides}  # fmt: skip
    assert shown["SeriesLines:widths"][2] == 0.0
    assert "pulse turntable" not in shown["SeriesLines:names"]


def test_recordings_in_one_view_keep_their_values_and_their_time_from_zero(beside, tmp_path):
    flown, out = tmp_path / "flown.rrd", tmp_path / "both.rrd"
    runs.fly(flown, 1.0)
    together.write([beside, flown, beside], out)
    for label, path in (("run\\ 1", beside), ("flown", flown), ("run\\ 3", beside)):
        shown = rows_of(out, f"/{label}/gimbal/simulated", "Scalars:scalars")
        series = recording.read(path)["gimbal/simulated"]
        np.testing.assert_allclose([t for t, _ in shown], series.time, atol=1e-9)
        np.testing.assert_allclose([v for _, v in shown], np.degrees(series.values), rtol=1e-12)
