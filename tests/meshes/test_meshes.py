"""The printed parts: closed, the same on every drawing, printable."""

import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import MeshError, check, check_model
from meshes.generate import PARTS, generate
from meshes.stl import read
from twin.physics.mechanism.clearance import solid

MESHES = Path(__file__).resolve().parents[2] / "meshes"
COMMITTED = sorted(MESHES.glob("*.stl"))


def test_every_part_is_committed_and_every_committed_mesh_is_drawn():
    assert {p.stem for p in COMMITTED} >= set(PARTS)


def test_drawing_again_gives_the_committed_bytes(tmp_path):
    for name, path in generate(tmp_path).items():
        assert path.read_bytes() == (MESHES / f"{name}.stl").read_bytes(), name


@pytest.mark.parametrize("name", sorted(PARTS))
def test_a_part_is_closed_in_the_eyes_of_another_library(name):
    body = trimesh.load(MESHES / f"{name}.stl")
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume > 0
    assert len(body.split()) == 1  # one piece to print
    assert len(body.faces) <= 5000


@pytest.mark.parametrize("name", sorted(PARTS))
def test_a_part_is_in_millimetres_and_fits_a_printer(name):
    size = np.ptp(read(MESHES / f"{name}.stl").reshape(-1, 3), axis=0)
    assert size.min() > 2
    assert size.max() < 150


def write_raw(path, corners):
    record = np.zeros(len(corners), np.dtype([("v", "<f4", (4, 3)), ("a", "<u2")]))
    record["v"][:, 1:] = corners
    path.write_bytes(bytes(80) + struct.pack("<I", len(record)) + record.tobytes())


def test_a_mesh_with_a_hole_is_refused_and_the_hole_counted(tmp_path):
    corners = np.array(read(MESHES / "ring.stl"))
    write_raw(tmp_path / "open.stl", corners[1:])
    with pytest.raises(MeshError, match="not watertight: 3 of its edges"):
        check(tmp_path / "open.stl")


def test_a_model_that_takes_mass_from_an_open_mesh_is_refused_by_the_meshs_name(tmp_path):
    corners = np.array(read(MESHES / "ring.stl"))
    write_raw(tmp_path / "open.stl", corners[1:])
    text = (
        '<mujoco><asset><mesh name="part" file="open.stl" inertia="shell"/></asset>'
        '<worldbody><geom type="mesh" mesh="part"/></worldbody></mujoco>'
    )
    (tmp_path / "m.xml").write_text(text)
    with pytest.raises(MeshError, match="mesh 'part' is not watertight: 3 of its edges"):
        check_model(mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml")))


def test_the_shipped_mechanism_takes_mass_from_closed_meshes_only():
    check_model(mujoco.MjModel.from_xml_path(str(MESHES.parent / "mjcf" / "mechanism.xml")))


def test_a_mesh_turned_inside_out_is_refused(tmp_path):
    write_raw(tmp_path / "inverted.stl", np.array(read(MESHES / "ring.stl"))[:, ::-1])
    with pytest.raises(MeshError, match="inside out"):
        check(tmp_path / "inverted.stl")


def test_a_mesh_with_a_number_that_is_none_is_refused(tmp_path):
    corners = np.array(read(MESHES / "ring.stl"))
    corners[5, 1, 2] = np.nan
    write_raw(tmp_path / "nan.stl", corners)
    with pytest.raises(MeshError, match="not a finite number"):
        check(tmp_path / "nan.stl")


def test_a_missing_mesh_is_named(tmp_path):
    with pytest.raises(MeshError, match=r"none\.stl.*No such file"):
        check(tmp_path / "none.stl")


@settings(max_examples=30, deadline=None)
@given(content=st.binary(max_size=400))
def test_bytes_that_are_no_mesh_are_refused_in_one_line(content, tmp_path_factory):
    path = tmp_path_factory.mktemp("hostile") / "m.stl"
    path.write_bytes(content)
    with pytest.raises(MeshError) as refusal:
        check(path)
    assert "\n" not in str(refusal.value)


BENCH = MESHES.parent / "mjcf" / "bench.xml"


@pytest.fixture(scope="module")
def bench():
    return mujoco.MjModel.from_xml_path(str(BENCH))


def test_potentiometers_and_what_carries_them_would_add_less_than_a_thousandth_to_the_inertia(
    bench,
):
    # by trimesh's volumes, PETG of 1.27 g/cm3 and the 0.4 g of a sensor
    printed = sum(
        trimesh.load(MESHES / f"potentiometer_{part}.stl").volume * 1.27e-6
        for part in ("y", "shaft")
    )
    mass, radius = 2 * (0.4e-3 + printed), bench.geom("gimbal_potentiometer_y_a").pos[1]
    assert 1.2e-3 < mass < 1.4e-3
    data = mujoco.MjData(bench)
    mujoco.mj_forward(bench, data)
    inertia = np.zeros((bench.nv, bench.nv))
    mujoco.mj_fullM(bench, data, inertia)
    about_x = bench.joint("gimbal_x").dofadr[0]
    assert mass * radius**2 < 1e-3 * inertia[about_x, about_x]
    sensed = [g for g in range(bench.ngeom) if "potentiometer" in bench.geom(g).name]
    assert len(sensed) == 14


def test_the_potentiometers_of_x_touch_neither_the_tube_nor_the_calibration_rig(bench):
    data = mujoco.MjData(bench)
    mujoco.mj_kinematics(bench, data)

    def placed(name):
        geom = bench.geom(name).id
        turn = np.hstack([data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom, :, None] * 1e3])
        return solid(bench, geom).transform(turn)

    frame = placed("calibration_rig")
    for end in "ab":
        saddle, shaft = (placed(f"potentiometer_x_{end}_{part}") for part in ("saddle", "shaft"))
        assert saddle.min_gap(frame, 5.0) > 0.5
        assert (saddle ^ placed("tube")).volume() == 0
        assert saddle.min_gap(shaft, 5.0) > 0.3  # it turns
        # the seat takes the sensor with its play, the hole of the sensor the shaft
        assert (saddle ^ placed(f"potentiometer_x_{end}")).volume() == 0


def test_a_potentiometers_shaft_fits_the_hole_of_the_sensor_and_turns_with_it():
    # hole of 4 mm with a flat 1 mm from its centre: Murata SV01, catalogue R51E
    corners = read(MESHES / "potentiometer_shaft.stl").reshape(-1, 3)
    assert 1.9 < np.hypot(corners[:, 0], corners[:, 2]).max() < 2.0
    assert -1.0 < corners[:, 2].min() < -0.9


@pytest.mark.parametrize("spacing", [15.2, 15.5])  # mm, of the boards that are sold
def test_the_pillars_of_the_holder_take_the_holes_of_a_gy_521(spacing):
    """An M2 screw has 0.5 mm of room each way in a hole of 3 mm; measured on the STL."""
    vertices = trimesh.load(MESHES / "holder.stl").vertices
    top = vertices[np.isclose(vertices[:, 2], vertices[:, 2].max(), atol=0.01)]
    sides = (top[top[:, 0] < 0.0], top[top[:, 0] > 0.0])
    centres = [(side.min(axis=0) + side.max(axis=0)) / 2 for side in sides]
    apart = abs(centres[1][0] - centres[0][0])
    assert abs(apart - spacing) < 2 * 0.5
    assert centres[0][1] == pytest.approx(centres[1][1], abs=0.01)
