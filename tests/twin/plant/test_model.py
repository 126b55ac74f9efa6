"""Loading: the parts of a scene can be exchanged, and nothing unfit gets past it."""

import re
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.errors import TwinError
from twin.plant.model import overrides
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

DIRECT = MJCF / "examples" / "direct_drive.xml"
TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
CORNERS = ((0, 0, 0), (0.01, 0, 0), (0, 0.01, 0), (0, 0, 0.01))


def write_stl(path: Path, faces: tuple[tuple[int, int, int], ...]) -> None:
    """Binary STL of some faces of a tetrahedron."""
    triangles = [struct.pack("<12f", 0, 0, 1, *sum((CORNERS[c] for c in f), ())) for f in faces]
    body = b"".join(t + b"\0\0" for t in triangles)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(faces)) + body)


def with_mesh(folder: Path, faces: tuple[tuple[int, int, int], ...]) -> Path:
    """The direct-drive mechanism with one more mesh, lying beside its file."""
    write_stl(folder / "part.stl", faces)
    text = DIRECT.read_text()
    asset = '<asset><mesh name="part" file="part.stl" inertia="shell"/></asset><worldbody>'
    text = text.replace("<worldbody>", asset, 1)
    text = text.replace('<joint name="y"', '<geom type="mesh" mesh="part"/><joint name="y"', 1)
    path = folder / "mechanism.xml"
    path.write_text(text)
    return path


def test_a_mechanism_finds_its_meshes_beside_its_own_file_from_any_folder(tmp_path, monkeypatch):
    path = with_mesh(tmp_path, TETRAHEDRON)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    model = load(ModelConfig(mechanism=path)).mj
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, "gimbal_part") >= 0
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, "gimbal_ring") < 0


def test_a_vehicle_finds_its_meshes_beside_its_own_file_from_any_folder(tmp_path, monkeypatch):
    folder = tmp_path / "own"
    folder.mkdir()
    write_stl(folder / "part.stl", TETRAHEDRON)
    text = (MJCF / "examples" / "large_rocket.xml").read_text()
    assert "meshdir" not in text
    mesh = '<asset><mesh name="part" file="part.stl"/></asset><worldbody>'
    (folder / "vehicle.xml").write_text(text.replace("<worldbody>", mesh, 1))
    monkeypatch.chdir(tmp_path)
    model = load(ModelConfig(vehicle=folder / "vehicle.xml")).mj
    assert mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, "part") >= 0


def test_includes_are_found_at_every_level_beside_their_file_or_beside_the_vehicles(
    tmp_path, monkeypatch
):
    text = (MJCF / "examples" / "large_rocket.xml").read_text()
    head, site, tail = text.partition('<site name="vehicle_imu" pos="0 0 0.8"/>')
    assert site
    inside = '<include file="parts/imu.xml"/>'
    files = {
        "vehicle.xml": head + inside + tail,
        "parts/imu.xml": f'<part>{site}<include file="more.xml"/><include file="last.xml"/></part>',
        "parts/more.xml": '<part><site name="more"/></part>',
        "last.xml": '<part><site name="last"/></part>',
    }
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    monkeypatch.chdir("/")
    model = load(ModelConfig(vehicle=tmp_path / "vehicle.xml")).mj
    sites = [model.site(k).name for k in range(model.nsite)]
    assert {"vehicle_imu", "more", "last"} <= set(sites)
    own = load(ModelConfig(vehicle=MJCF / "examples" / "large_rocket.xml")).mj
    np.testing.assert_array_equal(model.body_mass, own.body_mass)


def test_an_include_that_includes_itself_is_refused(tmp_path):
    path = tmp_path / "vehicle.xml"
    path.write_text(
        '<mujoco><worldbody><body name="vehicle"><include file="vehicle.xml"/></body></worldbody>'
        "</mujoco>"
    )
    with pytest.raises(TwinError, match="refers to itself"):
        load(ModelConfig(vehicle=path))


def test_a_mesh_with_a_hole_is_refused_by_name(tmp_path):
    with pytest.raises(TwinError, match=r"part.*not watertight: 3 of its edges"):
        load(ModelConfig(mechanism=with_mesh(tmp_path, TETRAHEDRON[:3])))


def test_a_vehicle_given_as_a_file_is_the_scenes_own_when_it_is_the_same_file():
    own, given = load(ModelConfig()), load(ModelConfig(vehicle=MJCF / "vehicle.xml"))
    np.testing.assert_array_equal(own.mj.body_mass, given.mj.body_mass)
    np.testing.assert_array_equal(own.mj.body_ipos, given.mj.body_ipos)
    np.testing.assert_array_equal(own.mj.mesh_vert, given.mj.mesh_vert)


def test_all_missing_names_are_reported_at_once(tmp_path):
    path = tmp_path / "vehicle.xml"
    path.write_text('<mujoco><worldbody><body name="vehicle"/></worldbody></mujoco>')
    with pytest.raises(TwinError, match="joint 'vehicle', site 'gimbal_nozzle'"):
        load(ModelConfig(vehicle=path))


def test_the_identified_seat_has_no_rods_servos_or_loops_and_keeps_the_joints():
    model = load(ModelConfig(gimbal="transfer-function")).mj
    assert model.neq == 0
    joints = [model.joint(k).name for k in range(model.njnt)]
    assert joints == ["vehicle", "gimbal_x", "gimbal_y"]
    assert [model.actuator(k).name for k in range(model.nu)] == ["gimbal_x", "gimbal_y"]


def test_the_digest_follows_the_physics():
    one, same = load(ModelConfig()), load(ModelConfig())
    other = load(ModelConfig(overrides={"gimbal_holder.mass": 0.03}))
    assert one.sha256 == same.sha256
    assert one.sha256 != other.sha256


def test_the_digest_does_not_depend_on_the_folder_of_the_files(tmp_path):
    digests = set()
    for name in ("a", "another_folder"):
        (tmp_path / name).mkdir()
        path = with_mesh(tmp_path / name, TETRAHEDRON)
        digests.add(load(ModelConfig(mechanism=path)).sha256)
    assert len(digests) == 1


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("gimbal_propellant.mass", "motor_propellant_mass"),
        ("gimbal_propellant.inertia[0]", "motor_propellant_mass"),
        ("motor_loaded_mass", r"gimbal_motor\.mass"),
        ("motor_length", "--motor"),
        ("motor_diameter", "--motor"),
        ("vehicle.pos[2]", "ramp_position"),
        ("wind_modes[3]", "wind_seed"),
    ],
)
def test_a_parameter_without_effect_is_refused_with_the_one_to_set(name, instead):
    own = load(ModelConfig()).mj
    with pytest.raises(TwinError, match=f"has no effect.*{instead}"):
        load(ModelConfig(overrides={name: overrides.value(own, name) + 1e-3}))


def test_on_a_bench_nothing_burns_and_the_propellants_mass_can_be_set():
    model = load(ModelConfig(scene="bench", overrides={"gimbal_propellant.mass": 0.05})).mj
    assert model.body("gimbal_propellant").mass[0] == 0.05


def play(model: mujoco.MjModel) -> list[float]:
    """Width of the play of each axis, zero where it has no joint."""
    names = [model.joint(k).name for k in range(model.njnt)]
    pairs = [f"gimbal_play_{a}" for a in "xy"]
    return [float(np.ptp(model.joint(n).range)) if n in names else 0.0 for n in pairs]


def with_backlash(folder: Path, data: str, of: Path = MJCF / "mechanism.xml") -> Path:
    """A mechanism whose numeric `backlash` reads `data`."""
    text = re.sub(r'<numeric name="backlash" data="[^"]*"/>', "", of.read_text())
    text = text.replace("<custom>", f'<custom><numeric name="backlash" data="{data}"/>', 1)
    text = text.replace('meshdir="../meshes"', f'meshdir="{MJCF.parent / "meshes"}"')
    path = folder / "mechanism.xml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["gimbal_backlash", "gimbal_backlash[0]"])
def test_backlash_is_set_with_or_without_an_index(name):
    assert play(load(ModelConfig(overrides={name: 0.05})).mj) == pytest.approx([0.05, 0.05])
    assert play(load(ModelConfig(overrides={name: 0.0})).mj) == [0.0, 0.0]


@pytest.mark.parametrize(
    ("data", "widths"), [("0 0.05", [0, 0.05]), ("0.05 0", [0.05, 0]), ("0.02 0.03", [0.02, 0.03])]
)
def test_two_values_of_backlash_are_one_for_each_axis(tmp_path, data, widths):
    model = load(ModelConfig(mechanism=with_backlash(tmp_path, data))).mj
    assert play(model) == pytest.approx(widths)
    second = {"gimbal_backlash[1]": 0.04}
    model = load(ModelConfig(mechanism=with_backlash(tmp_path, data), overrides=second)).mj
    assert play(model) == pytest.approx([widths[0], 0.04])


def test_backlash_of_servos_on_the_axes_themselves_is_refused(tmp_path):
    with pytest.raises(TwinError, match="a servo on the gimbal axis must have 0"):
        load(ModelConfig(mechanism=with_backlash(tmp_path, "0.01", DIRECT)))
    assert play(load(ModelConfig(mechanism=with_backlash(tmp_path, "0", DIRECT))).mj) == [0, 0]


def test_a_force_range_holds_a_servo(tmp_path):
    weak = {"gimbal_servo_x.forcerange[0]": -1e-4, "gimbal_servo_x.forcerange[1]": 1e-4}
    model = load(ModelConfig(overrides=weak)).mj
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.3
    mujoco.mj_forward(model, data)
    x, y = np.abs(data.actuator_force)
    assert x == pytest.approx(1e-4)
    assert y > 0.01


@pytest.mark.parametrize("scene", ["flight", "bench"])
@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('axis="1 0 0"', 'axis="-1 0 0"', r"'gimbal_x' turns about \(-1, 0, 0\).*\(1, 0, 0\)"),
        ('axis="0 1 0"', 'axis="0 -1 0"', r"'gimbal_y' turns about \(0, -1, 0\)"),
        ('axis="0 1 0"', 'axis="0 1 0" pos="0 0 0.005"', "'gimbal_y' passes 5 mm"),
        ('axis="0 1 0"', 'axis="0 1 0" pos="0 0.1 0"', None),  # the same axis
        ('name="nozzle"', 'name="nozzle" euler="3.1416 0 0"', r"nozzle'.*\(0, 0, -1\)"),
    ],
)
def test_a_gimbal_that_would_be_steered_the_wrong_way_is_refused(tmp_path, scene, old, new, says):
    path = tmp_path / "mechanism.xml"
    path.write_text(DIRECT.read_text().replace(old, new, 1))
    asked = ModelConfig(scene=scene, mechanism=path)
    if says is None:
        load(asked)
        return
    with pytest.raises(TwinError, match=says):
        load(asked)


def test_a_gimbal_mounted_askew_in_its_vehicle_is_refused(tmp_path):
    text = (MJCF / "parts" / "airframe.xml").read_text()
    assert '<frame name="gimbal">' in text
    text = text.replace('<frame name="gimbal">', '<frame name="gimbal" euler="0 0 1.5708">')
    asset = '<asset><model name="mechanism" file="mechanism.xml"/></asset>'
    text = text.replace("<worldbody>", asset + "<worldbody>", 1)
    path = tmp_path / "vehicle.xml"
    path.write_text(text)
    with pytest.raises(TwinError, match=r"\(0, 1, 0\) of body 'vehicle'"):
        load(ModelConfig(vehicle=path, mechanism=MJCF / "mechanism.xml"))


def test_an_overridden_step_reaches_the_model():
    assert load(ModelConfig(dt=5e-4)).mj.opt.timestep == 5e-4


def test_a_bomb_of_xml_entities_is_refused(tmp_path):
    entities = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))
    path = tmp_path / "bomb.xml"
    path.write_text(f'<!DOCTYPE m [<!ENTITY a0 "x">{entities}]><mujoco>&a11;</mujoco>')
    with pytest.raises(TwinError, match="document type"):
        load(ModelConfig(vehicle=path))
