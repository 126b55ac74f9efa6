"""`twin mechanism`: figures against closed forms, clearances against another mesh library."""

import json
import math

import mujoco
import numpy as np
import pytest
import trimesh

from twin.cli.main import main
from twin.config.mechanism import Mechanism
from twin.experiments.mechanism import mechanism
from twin.physics.mechanism import clearance as clearances
from twin.physics.mechanism.clearance import Clearance
from twin.physics.mechanism.torque import holding
from twin.plant.model.compose import MJCF

G = 9.80665
DIRECT = MJCF / "examples" / "direct_drive.xml"


@pytest.fixture(scope="module")
def parts():
    return Clearance(mujoco.MjModel.from_xml_path(str(MJCF / "mechanism.xml")))


@pytest.mark.parametrize(
    ("one", "other", "x", "y"),
    [
        ("rod_y", "servo_y_case", -10.0, 10.0),
        ("rod_x", "servo_x_ears", 10.0, -10.0),
        ("holder_x_ball", "rod_y", 10.0, 10.0),
        ("holder_y_stud", "rod_x", -10.0, 5.0),
    ],
)
def test_gaps_of_round_parts_are_those_of_the_exact_shapes_within_0_02_mm(
    parts, monkeypatch, one, other, x, y
):
    """MuJoCo's distance (GJK) of cylinders, spheres and boxes, which are exact there."""
    monkeypatch.setattr(clearances, "FAR", 100.0)
    gap = parts.gap(one, other, math.radians(x), math.radians(y)) * 1e3
    ids = [parts._model.geom(name).id for name in (one, other)]
    exact = mujoco.mj_geomDistance(parts._model, parts._data, *ids, 1.0, None) * 1e3
    assert gap == pytest.approx(exact, abs=0.02)


def test_the_gap_of_a_stud_in_its_cup_is_that_of_another_mesh_library_within_0_02_mm(parts):
    """Every vertex of the finely divided stud to the cup, and the reverse, by trimesh."""
    names = ("holder_x_stud", "rod_x_lower")
    gap = parts.gap(*names, math.radians(10.0), math.radians(-5.0)) * 1e3
    meshes = []
    for name in names:
        mesh = parts._posed()[name].to_mesh()
        vertices = np.asarray(mesh.vert_properties, float)[:, :3]
        meshes.append(trimesh.Trimesh(vertices, np.asarray(mesh.tri_verts), process=False))
    distances = []
    for a, b in (meshes, meshes[::-1]):
        fine, _ = trimesh.remesh.subdivide_to_size(a.vertices, a.faces, 0.5, max_iter=12)
        near = fine[((fine > b.bounds[0] - 1.0) & (fine < b.bounds[1] + 1.0)).all(axis=1)]
        rough = np.linalg.norm(near[:, None] - b.vertices[None], axis=2).min(axis=1)
        best = near[np.argsort(rough)[:200]]
        distances.append(trimesh.proximity.closest_point_naive(b, best)[1].min())
    assert gap == pytest.approx(min(distances), abs=0.02)


def test_parts_pushed_into_each_other_have_no_gap():
    spec = mujoco.MjSpec.from_file(str(DIRECT))
    spec.geom("arm_x").pos = [-0.0213, 0.0, 0.0]  # through the ring
    between, _ = Clearance(spec.compile()).smallest(1)
    assert between.distance == 0.0
    assert "arm_x" in between.parts


def test_the_torque_of_a_direct_drive_is_mass_times_distance_times_load():
    """Of all that turns about x, with the acceleration across; friction adds to it."""
    model = mujoco.MjModel.from_xml_path(str(DIRECT))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ring = model.body("ring").id
    com = data.subtree_com[ring]
    mass = model.body_subtreemass[ring]
    friction = float(model.dof_frictionloss[model.joint("x").dofadr[0]])
    got = holding(model, 2.0, n=21)
    wanted = mass * 2.0 * G * math.hypot(com[1], com[2]) + friction
    assert got.needed[0] == pytest.approx(wanted, rel=5e-3)
    assert got.stall == pytest.approx((0.36 * 4.8 / 8, 0.36 * 4.8 / 8))


def test_how_the_rings_own_frame_is_turned_does_not_change_the_torque():
    """A point mass m on an arm r below the pivot, ring drawn on its side: m g r."""
    turned = """
    <mujoco>
      <compiler angle="radian" autolimits="true"/>
      <worldbody>
        <body>
          <body quat="1 0 1 0">
            <joint name="x" axis="0 0 1" range="-1e-3 1e-3"/>
            <inertial pos="0 0 0" mass="0.1" diaginertia="1e-6 1e-6 1e-6"/>
            <body quat="1 0 -1 0">
              <joint name="y" axis="0 1 0" range="-1e-3 1e-3"/>
              <inertial pos="0 0 -0.05" mass="0.1" diaginertia="1e-6 1e-6 1e-6"/>
            </body>
          </body>
        </body>
      </worldbody>
      <actuator>
        <position name="servo_x" joint="x" forcerange="-0.3 0.2"/>
        <position name="servo_y" joint="y"/>
      </actuator>
    </mujoco>"""
    got = holding(mujoco.MjModel.from_xml_string(turned), 2.0, n=3)
    assert got.needed == pytest.approx((0.1 * 2.0 * G * 0.05,) * 2, rel=1e-5)
    assert got.stall == (0.2, math.inf)


def test_figures_of_a_direct_drive_are_trivial_and_its_check_passes():
    result = mechanism(Mechanism("check", DIRECT))
    assert result.gain == pytest.approx((1.0, 1.0))
    assert result.coupling == pytest.approx(0.0, abs=1e-9)
    assert result.step_deg == pytest.approx(1 / 10.3)
    assert result.passed


def test_resolution_of_the_reference_is_the_gain_times_the_step_of_the_shaft():
    result = mechanism(Mechanism("show"))
    assert result.clearance is None
    low, high = result.gain_range
    assert low < min(result.gain) < max(result.gain) < high
    assert result.step_deg == pytest.approx(high / 10.3)
    assert result.backlash_deg == pytest.approx(math.degrees(0.0087) * high)


def test_a_check_that_fails_ends_with_1_and_json_is_one_object(capsys):
    with pytest.raises(SystemExit) as end:
        main(["mechanism", "check", str(DIRECT), "--load-g", "5", "--json"])
    assert end.value.code == 1
    figures = json.loads(capsys.readouterr().out)
    assert figures["torque_reserve"] < 1.0
    assert figures["passed"] is False
