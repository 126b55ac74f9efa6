"""The parts as solids, posed as MuJoCo poses them: they clear each other and fit the tube."""

import itertools
from math import degrees, radians
from pathlib import Path

import manifold3d
import mujoco
import numpy as np
import pytest

from twin.physics.mechanism import Kinematics

MECHANISM = Path(__file__).resolve().parents[2] / "mjcf" / "mechanism.xml"
MILLIMETRE = 1000.0
STOP = radians(10)

# Two parts of one joint: a pin in its hole, a ball in its cup, a horn pressed on its spline.
JOINED = (
    ({"pin_x_left", "pin_x_right"}, {"ring"}),
    ({"pin_y_left", "pin_y_right"}, {"ring"}),
    ({"horn_x_ball", "horn_x_stud"}, {"rod_x_upper"}),
    ({"horn_y_ball", "horn_y_stud"}, {"rod_y_upper"}),
    ({"holder_x_ball", "holder_x_stud"}, {"rod_x_lower"}),
    ({"holder_y_ball", "holder_y_stud"}, {"rod_y_lower"}),
    ({"servo_x_spline"}, {"horn_x"}),
    ({"servo_y_spline"}, {"horn_y"}),
    *(  # sleeve and screw of the holder turn in the hole of a potentiometer
        ({f"potentiometer_y_{k}"}, {f"potentiometer_y_{k}_shaft", f"pin_y_{s}", f"pin_y_{s}_head"})
        for k, s in (("a", "right"), ("b", "left"))
    ),
)


def solid(model, geom):
    """Solid of a geom in its own frame; None where it has no volume."""
    kind, size = model.geom_type[geom], model.geom_size[geom] * MILLIMETRE
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return manifold3d.Manifold.cube(tuple(2 * size), True)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return manifold3d.Manifold.cylinder(2 * size[1], size[0], size[0], 48, True)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return manifold3d.Manifold.sphere(size[0], 24)
    return None


def _mesh(model, mesh):
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    points = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]] * np.float32(MILLIMETRE)
    faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
    body = manifold3d.Mesh(
        vert_properties=np.asarray(points, np.float32), tri_verts=np.asarray(faces, np.uint32)
    )
    body.merge()
    return manifold3d.Manifold(body)


def posed(shape, data, geom):
    """The solid where `data` puts the geom."""
    pose = np.hstack(
        [data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom].reshape(3, 1) * MILLIMETRE]
    )
    return shape.transform(pose)


def reach(shape, data, geom):
    """Vertices of the posed solid, (n, 3) [mm]."""
    mesh = posed(shape, data, geom).to_mesh()
    return np.asarray(mesh.vert_properties)[:, :3]


def pose(model, data, kinematics, x, y):
    """Place every body by the kinematic solution, rods turned the shortest way onto their balls."""
    mujoco.mj_resetData(model, data)
    servo = kinematics.servo_from_gimbal([x, y])
    data.joint("x").qpos, data.joint("y").qpos = x, y
    data.joint("servo_x").qpos, data.joint("servo_y").qpos = servo
    mujoco.mj_kinematics(model, data)
    for axis in "xy":
        turn = data.body(f"horn_{axis}").xmat.reshape(3, 3)
        ball = data.body(f"rod_{axis}").xpos
        now, want = (
            (data.site(name).xpos - ball) @ turn
            for name in (f"rod_{axis}_end", f"holder_{axis}_ball")
        )
        length = np.linalg.norm(now) * np.linalg.norm(want)
        quat = np.append(length + now @ want, np.cross(now, want))
        data.joint(f"rod_{axis}").qpos = quat / np.linalg.norm(quat)
    mujoco.mj_kinematics(model, data)
    assert kinematics.closure(data).max() < 1e-9  # m; round-off of a solved loop


def grid(n):
    return itertools.product(np.linspace(-STOP, STOP, n), repeat=2)


def loaded():
    """Model, data, kinematics, and the solid of every geom by its name."""
    model = mujoco.MjModel.from_xml_path(str(MECHANISM))
    data = mujoco.MjData(model)
    solids = {
        model.geom(g).name: (g, solid(model, g))
        for g in range(model.ngeom)
        if model.geom(g).name != "grain"  # inside the casing
    }
    return model, data, Kinematics(model), solids


@pytest.fixture(scope="module")
def mechanism():
    return loaded()


def link(model, geom):
    return int(model.body_weldid[model.geom_bodyid[geom]])


def may_touch(a, b):
    return any((a in p and b in q) or (b in p and a in q) for p, q in JOINED)


def least_gap(mechanism, near=0.3):
    """Smallest distance of two parts [mm], and where; what is further apart than `near` counts so.

    Distances by manifold3d.
    """
    model, data, kinematics, solids = mechanism
    least, where = near, ""
    pairs = [
        (a, b)
        for a, b in itertools.combinations(solids, 2)
        if link(model, solids[a][0]) != link(model, solids[b][0]) and not may_touch(a, b)
    ]
    for x, y in grid(5):
        pose(model, data, kinematics, x, y)
        now = {name: posed(shape, data, geom) for name, (geom, shape) in solids.items()}
        boxes = {name: np.array(body.bounding_box()) for name, body in now.items()}
        for a, b in pairs:
            apart = np.maximum(boxes[a][:3] - boxes[b][3:], boxes[b][:3] - boxes[a][3:]).max()
            if apart < near:
                gap = now[a].min_gap(now[b], 1.0)
                if gap < least:
                    least = gap
                    where = f"{a} and {b} at {degrees(x):.0f}°, {degrees(y):.0f}°"
    return least, where


@pytest.mark.thorough
def test_parts_clear_each_other_by_0_3_mm_at_every_angle(mechanism):
    gap, where = least_gap(mechanism)
    assert gap >= 0.3, where


def test_everything_ahead_of_the_tubes_aft_end_stays_inside_the_bore_at_every_angle(mechanism):
    model, data, kinematics, solids = mechanism
    bore, half, _ = model.site("tube").size * 1e3
    aft = model.site("tube").pos[2] * 1e3 - half
    forward = aft + 2 * half
    for x, y in grid(5):
        pose(model, data, kinematics, x, y)
        for name, (geom, shape) in solids.items():
            inside = posed(shape, data, geom).trim_by_plane((0, 0, 1), aft)
            points = np.asarray(inside.to_mesh().vert_properties)[:, :3]
            if len(points):
                assert np.hypot(points[:, 0], points[:, 1]).max() <= bore, name
                assert points[:, 2].max() <= forward, name


def test_the_motor_is_29_mm_wide_and_hangs_where_the_sites_say(mechanism):
    model, data, kinematics, solids = mechanism
    pose(model, data, kinematics, 0, 0)
    points = reach(solids["casing"][1], data, solids["casing"][0])
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(14.5, abs=1e-3)
    assert points[:, 2].max() == pytest.approx(1e3 * data.site("motor_forward").xpos[2], abs=1e-3)
    assert points[:, 2].min() == pytest.approx(1e3 * data.site("nozzle").xpos[2], abs=1e-3)


def test_printed_parts_weigh_their_volume(mechanism):
    """MuJoCo's mass of a body against volume times density of its parts, by another library."""
    model, _, _, solids = mechanism
    ring = solids["ring"][1].volume() * 1e-9 * 1270
    assert model.body("ring").mass[0] == pytest.approx(ring, rel=1e-4)  # float32 vertices
    assert model.body_subtreemass[model.body("holder").id] == pytest.approx(0.225, abs=0.012)
