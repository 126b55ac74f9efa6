"""Recordings in other formats: what was exported reads again equal, and other programs read it."""

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import export, recording, schema
from analysis.export import kml, scene, tables
from analysis.recording.series import Recording, TimeSeries
from analysis.schema import AnalysisError
from tests.twin import runs

NAMES = ("gimbal/command", "gimbal/measured", "vehicle/thrust", "vehicle/attitude")
FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)


@st.composite
def recordings(draw):
    series = {}
    for name in draw(st.sets(st.sampled_from(NAMES), min_size=1)):
        signal = schema.SIGNALS[name]
        time = sorted(draw(st.lists(st.integers(-(10**6), 10**13), min_size=1, max_size=6)))
        width = len(signal.components)
        rows = [draw(st.lists(FINITE, min_size=width, max_size=width)) for _ in time]
        values = np.array(rows)
        if signal.kind == "sampled" and width > 1 and draw(st.booleans()):
            values[0, 0] = math.nan
        series[name] = TimeSeries(
            name, np.array(time) / 1e9, values, signal.unit, signal.components
        )
    return Recording({"seed": 3}, series)


@settings(max_examples=15, deadline=None)
@given(recordings())
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_table_reads_again_equal_to_the_last_bit(tmp_path_factory, kind, run):
    path = tmp_path_factory.mktemp("export") / f"run.{kind}"
    {"csv": tables.write_csv, "parquet": tables.write_parquet}[kind](run, path)
    # the child process that reads binary tables is as for MATLAB files; here its reader alone
    back = export.read(path) if kind == "csv" else _parquet_in_process(path)
    _assert_equal(back, run)


def _parquet_in_process(path: Path):
    from analysis.recording import mat
    from analysis.recording.tables import Table

    return tables._from_table(Table(mat.columns(path.read_bytes()), path.name))


def _assert_equal(back, run):
    assert back.keys() == run.series.keys()
    for name, series in run.series.items():
        np.testing.assert_array_equal(back[name].time, series.time)
        np.testing.assert_array_equal(back[name].values, series.values)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "flight.rrd"
    runs.fly(path, 2.0)
    return path


@pytest.mark.parametrize("kind", ["csv", "mat"])  # parquet through the same child as mat
def test_a_recording_reads_again_equal(flight, tmp_path, kind):
    path = tmp_path / f"flight.{kind}"
    export.write(export.FORMATS[kind], flight, path, export.Origin())
    _assert_equal(export.read(path), recording.read(flight))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_units_are_in_the_metadata(flight, tmp_path):
    from pyarrow import parquet
    from scipy.io import loadmat

    run = recording.read(flight)
    tables.write_parquet(run, tmp_path / "run.parquet")
    form = parquet.read_schema(tmp_path / "run.parquet")
    assert form.field("gimbal/command.x [rad]").metadata == {b"unit": b"rad"}
    assert json.loads(form.metadata[b"properties"])["seed"] == 7
    tables.write_mat(run, tmp_path / "run.mat")
    struct = loadmat(tmp_path / "run.mat", squeeze_me=True)["vehicle_velocity"]
    assert struct["unit"].item() == "m/s"
    assert list(struct["components"].item()) == ["x", "y", "z"]
    tables.write_csv(run, tmp_path / "run.csv")
    assert "vehicle/velocity.z [m/s]" in (tmp_path / "run.csv").read_text().splitlines()[0]


def test_the_scene_as_gltf_is_read_by_another_library(flight, tmp_path):
    path = tmp_path / "flight.glb"
    export.write(export.FORMATS["glb"], flight, path, export.Origin())
    loaded = trimesh.load_scene(path)
    bodies = {b.name: b for b in scene.bodies(flight)}
    assert set(loaded.geometry) == set(bodies)
    np.testing.assert_allclose(
        loaded.geometry["vehicle"].bounds,
        [bodies["vehicle"].vertices.min(0), bodies["vehicle"].vertices.max(0)], atol=1e-6,
    )  # fmt: skip
    # up is y: the vehicle starts 0.3 m above the ground
    at = loaded.graph.get(loaded.graph.geometry_nodes["vehicle"][0])[0]
    np.testing.assert_allclose(at[:3, 3], [0.0, 0.3, 0.0], atol=1e-6)
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + length])
    (animation,) = document["animations"]
    moved = {document["nodes"][c["target"]["node"]]["name"] for c in animation["channels"]}
    assert moved == {"vehicle", "gimbal_ring", "gimbal_holder"}
    data = content[28 + length :]
    channel = next(
        c for c in animation["channels"]
        if document["nodes"][c["target"]["node"]]["name"] == "vehicle"
        and c["target"]["path"] == "translation"
    )  # fmt: skip
    sampler = animation["samplers"][channel["sampler"]]
    time, place = (_array(document, data, sampler[k]) for k in ("input", "output"))
    expected = np.stack([0.3 * time**2, 0.5 * time, 0.3 + 2.0 * time**2], axis=1)  # as `runs.fill`
    np.testing.assert_allclose(place, expected, atol=1e-5)


def _array(document, data, index):
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    values = np.frombuffer(data, "<f4", offset=view["byteOffset"], count=view["byteLength"] // 4)
    return values.reshape(accessor["count"], -1).squeeze()


def test_the_path_on_the_map_is_that_of_an_independent_conversion(flight, tmp_path):
    """Earth-centred coordinates of the written points are those of the launch site plus ENU."""
    origin = (47.37, 8.54, 400.0)
    enu = np.array([[0.0, 0.0, 0.0], [9000.0, -4000.0, 650.0], [-300.0, 20_000.0, 0.0]])
    places = kml.geographic(enu, origin)
    start, turn = _ecef(*origin), _enu_axes(*origin[:2])
    for (longitude, latitude, height), point in zip(places, enu, strict=True):
        np.testing.assert_allclose(
            _ecef(latitude, longitude, height), start + turn @ point, atol=1e-5
        )
    path = tmp_path / "flight.kml"
    export.write(export.FORMATS["kml"], flight, path, export.Origin(*origin))
    names = [e.text for e in ET.parse(path).iter(f"{{{kml.NAMESPACE}}}name")]
    assert names[:2] == ["flight", "path"]
    assert names[3].startswith("highest point, 2.0 s, 8 m")


def test_a_map_leaves_out_places_that_are_not_known(tmp_path):
    nan = math.nan
    for values, number in (([[nan] * 3, [0, 0, 1], [0, nan, 2], [5, 5, 9]], 2 + 3), ([], 0)):
        signal = schema.SIGNALS["vehicle/position"]
        series = TimeSeries(
            signal.name, np.arange(len(values)) * 1.0, np.reshape(values, (-1, 3)), signal.unit,
            signal.components,
        )  # fmt: skip
        run = Recording({}, {signal.name: series})
        if not number:
            with pytest.raises(AnalysisError, match=r"no flight: .* no values"):
                kml.write(run, tmp_path / "none.kml", (0.0, 0.0, 0.0))
            continue
        kml.write(run, tmp_path / "a.kml", (0.0, 0.0, 0.0))
        found = ET.parse(tmp_path / "a.kml").iter(f"{{{kml.NAMESPACE}}}coordinates")
        places = [place for e in found for place in e.text.split()]
        assert len(places) == number
        assert "nan" not in "".join(places)


def _ecef(latitude, longitude, height):
    a, f = 6378137.0, 1.0 / 298.257223563
    phi, lam = math.radians(latitude), math.radians(longitude)
    n = a / math.sqrt(1.0 - f * (2.0 - f) * math.sin(phi) ** 2)
    across, up = (n + height) * math.cos(phi), (n * (1.0 - f) ** 2 + height) * math.sin(phi)
    return np.array([across * math.cos(lam), across * math.sin(lam), up])


def _enu_axes(latitude, longitude):
    """Columns east, north, up: along the height, and across to it and the earth's axis."""
    up = _ecef(latitude, longitude, 1.0) - _ecef(latitude, longitude, 0.0)
    up /= np.linalg.norm(up)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up], axis=1)


def test_messages_of_mcap_have_the_values_and_units(flight, tmp_path):
    from mcap import reader

    path = tmp_path / "flight.mcap"
    export.write(export.FORMATS["mcap"], flight, path, export.Origin())
    series = recording.read(flight)["gimbal/simulated"]
    with path.open("rb") as file:
        found = list(reader.make_reader(file).iter_messages(topics=["/gimbal/simulated"]))
    assert json.loads(found[0][0].data)["properties"]["x"]["description"] == "rad"
    stamps = [m.log_time for _, _, m in found]
    np.testing.assert_array_equal(stamps, series.time_ns)
    values = [list(json.loads(m.data).values()) for _, _, m in found]
    np.testing.assert_array_equal(values, series.values)


def test_what_is_missing_is_said_in_one_line(tmp_path):
    from twin.recorder import Recorder

    path = tmp_path / "bench.rrd"
    with Recorder(path, signals=["gimbal/command"], properties={}) as recorder:
        recorder.row[:] = 0.0
        recorder.commit(0, 0)
    for kind, reason in (("kml", "no flight"), ("glb", "has no 3D scene")):
        with pytest.raises(AnalysisError, match=reason):
            export.write(export.FORMATS[kind], path, tmp_path / f"x.{kind}", export.Origin())
    assert [p.name for p in tmp_path.iterdir()] == ["bench.rrd"]
    table = tmp_path / "other.csv"
    table.write_text("time [s],speed\n0,1\n")
    with pytest.raises(AnalysisError, match="no signals of a recording"):
        export.read(table)


def test_the_verb_writes_beside_the_recording_and_refuses_what_it_cannot(flight, tmp_path):
    import twin

    copy = tmp_path / "run.rrd"
    copy.write_bytes(flight.read_bytes())
    result = twin.export(copy, to="kml", latitude_deg=47.0)
    assert result.file == tmp_path / "run.kml"
    (tmp_path / "latest-fly.rrd").symlink_to(copy.name)
    assert twin.export(tmp_path / "latest-fly.rrd", to="csv").file == tmp_path / "run.csv"
    for wrong, reason in (
        ({"to": "xlsx"}, "xlsx.*must be one of"),
        ({"to": "kml", "latitude_deg": 91.0}, "latitude-deg"),
        ({"to": "csv", "out": tmp_path / "run.txt"}, "csv"),
    ):
        with pytest.raises(twin.TwinError, match=reason):
            twin.export(copy, **wrong)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "latest-fly.rrd", "run.csv", "run.kml", "run.rrd",
    ]  # fmt: skip


def test_the_scene_as_usd_has_the_recorded_motion(flight, tmp_path):
    from pxr import Usd, UsdGeom

    from twin.config import Export
    from twin.evaluation.export import export as verb

    short = scene.bodies(flight)
    result = verb(Export(flight, to="usd", out=tmp_path / "flight.usd"))
    stage = Usd.Stage.Open(str(result.file))
    assert stage.GetTimeCodesPerSecond() == 50.0
    frames = round(stage.GetEndTimeCode())
    vehicle = next(b for b in short if b.name == "vehicle")
    places = [
        UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(frames).ExtractTranslation()
        for prim in stage.Traverse()
        if prim.IsA(UsdGeom.Xformable) and "vehicle" in prim.GetName()
    ]
    moved = np.array([list(p) for p in places])
    assert np.linalg.norm(moved - vehicle.position[-1], axis=1).min() < 1.0  # geom, not body centre
    assert [p.name for p in tmp_path.iterdir()] == ["flight.usd"]
