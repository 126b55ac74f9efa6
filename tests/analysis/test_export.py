"""Recordings in other formats: what was exported reads again equal, and other programs read it."""

import json
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import twin
from analysis import export, limited, recording, schema
from analysis.export import kml, scene, tables
from analysis.recording import exported, unpacking
from analysis.recording.series import Event, Recording, TimeSeries
from analysis.schema import AnalysisError
from tests.twin.recorder import runs

NAMES = ("gimbal/command", "gimbal/measured", "vehicle/thrust", "vehicle/attitude")
FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)


LINES = st.tuples(
    st.integers(0, 10**13),
    st.sampled_from(["INFO", "WARN", "ERROR"]),
    st.text(st.characters(codec="utf-8", exclude_categories=["C"], max_codepoint=0x2FFF)),
)


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
            values[draw(st.integers(0, len(time) - 1)), 0] = math.nan
        series[name] = TimeSeries(
            name, np.array(time) / 1e9, values, signal.unit, signal.components
        )
    events, health = (
        tuple(Event(at / 1e9, *line) for at, *line in sorted(draw(st.lists(LINES, max_size=3))))
        for _ in range(2)
    )
    about = {"seed": draw(st.integers(0, 2**60)), "note": draw(st.text(max_size=5))}
    return Recording(about, series, events, health, draw(st.sampled_from(["", '{"x": [1]}'])))


@settings(max_examples=15, deadline=None)
@given(recordings())
@pytest.mark.parametrize("kind", ["csv", "parquet", "mat"])
def test_an_exported_file_reads_again_equal_to_the_last_bit(tmp_path_factory, kind, run):
    path = tmp_path_factory.mktemp("export") / f"run.{kind}"
    getattr(tables, f"write_{kind}")(run, path)
    assert exported.is_exported(path)
    # without the process, which is tested below
    back = exported.unpacked(path, unpacking.packed(f".{kind}", path.read_bytes()))
    _assert_equal(back.series, run.series)
    assert back.logs == {"events": run.events, "health": run.health}
    if kind != "csv":
        assert json.loads(back.about["properties"]) == run.properties
        assert back.about["estimator"] == run.estimator


def _assert_equal(back, series):
    assert back.keys() == series.keys()
    for name, s in series.items():
        assert (back[name].unit, back[name].components) == (s.unit, s.components)
        assert back[name].time.tobytes() == s.time.tobytes()
        np.testing.assert_array_equal(back[name].time_ns, s.time_ns)
        np.testing.assert_array_equal(back[name].values, s.values)  # NaN where NaN
        assert (np.signbit(back[name].values) == np.signbit(s.values))[~np.isnan(s.values)].all()


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "flight.rrd"
    runs.fly(path, 2.0)
    return path


@pytest.mark.parametrize("kind", ["csv", "parquet", "mat"])
def test_the_front_door_reads_what_the_verb_exported(flight, tmp_path, kind):
    result = twin.export(flight, to=kind, out=tmp_path / f"flight.{kind}")
    back, run = twin.read(result), recording.read(flight)
    _assert_equal(back.series, run.series)
    assert back.events == run.events
    assert back.events[0].text == "ignition"
    assert back.properties == ({} if kind == "csv" else run.properties)
    assert [p.name for p in tmp_path.iterdir()] == [f"flight.{kind}"]
    # a recording for every verb: its columns need no names
    np.testing.assert_array_equal(
        recording.load(result.file).angles.values, recording.load(flight).angles.values
    )


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
    height = recording.read(flight)["vehicle/position"].values[:, 2]
    assert (
        names[3] == f"highest point, 2.0 s, {height.max() - height[0]:.0f} m above the launch point"
    )


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


COMMAND = "time [s],gimbal/command.x [rad],gimbal/command.y [rad]"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", "time [s],speed\n0,1\n", "has no signals of a recording"),
        ("a.csv", "", "has no signals of a recording"),
        ("a.csv", f"{COMMAND}\n0,1,2\n1,2\n", "not a readable csv file"),
        ("a.csv", f"{COMMAND}\n0,1,nan\n", "gimbal/command is not a finite number at 0 s"),
        ("a.csv", f"{COMMAND}\n0,1,inf\n", "is not a finite number"),
        ("a.csv", f"{COMMAND}\n1,1,1\n0,1,1\n", "time runs backwards"),
        ("a.csv", f"{COMMAND}\n,1,1\n", "time stamp is not a finite number"),
        ("a.csv", COMMAND.replace("rad", "deg") + "\n0,1,2\n", r"\[deg\]'; must be .*\[rad\]"),
        ("a.csv", "time [s],gimbal/command.x [rad]\n0,1\n", r"not 'gimbal/command.y \[rad\]'"),
        ("a.mat", "nonsense", "not a readable mat file"),
        ("a.parquet", "PAR1 nonsense", "not a readable parquet file"),
    ],
)
def test_a_table_that_is_not_an_export_is_refused_in_one_line(
    tmp_path, monkeypatch, name, content, said
):
    path = tmp_path / name
    path.write_text(content)

    def here(_module, request, **_limits):  # as the process does, which takes a second to start
        kind, _, data = request.partition(b"\n")
        monkeypatch.setattr(limited, "refuse", _refused)
        try:
            return unpacking.packed(kind.decode(), data)
        except Exception as error:
            unpacking.refuse(kind.decode(), error)

    monkeypatch.setattr(limited, "run", here)
    with pytest.raises(AnalysisError, match=said) as caught:
        twin.read(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def _refused(reason):
    raise limited.LimitError(reason)


def test_the_verb_writes_beside_the_recording_and_refuses_what_it_cannot(flight, tmp_path):
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
