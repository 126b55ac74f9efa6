"""Mechanisms from their dimensions, printable parts of any mechanism, and the search for one."""

import itertools
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from twin.config import Fly
from twin.config.mechanism import Mechanism as Settings
from twin.config.mechanism import Meshes
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.mechanism import mechanism
from twin.experiments.mechanism import search as searching
from twin.experiments.mechanism.build import draw, write
from twin.physics.mechanism.build import mjcf
from twin.physics.mechanism.clearance import Clearance
from twin.physics.mechanism.dimensions import Dimensions, read
from twin.physics.mechanism.servo import apply_servo
from twin.physics.mechanism.torque import holding
from twin.plant.authority import control_config
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

MESHES = MJCF.parent / "meshes"
LARGE = """bore = "73.4 mm"
motor = "38 mm"
forward = "35 mm"
lever = "27 mm"
height = "15.6 mm"
horn = "10 mm"
servo_x = "57 mm"
servo_y = "73 mm"
stops = "11°"
"""


ROCKET = """body = [
  { part = "nose", length = "200 mm", diameter = "75 mm", mass = "120 g" },
  { part = "tube", length = "900 mm", mass = "450 g" },
]
fins = [
  { count = 4, root = "80 mm", tip = "40 mm", span = "45 mm", thickness = "3 mm", mass = "40 g" },
]
masses = [{ name = "payload", mass = "700 g", position = "250 mm" }]
motor = { file = "motor.eng" }
gimbal = { pivot = "1060 mm", mechanism = "large.xml" }
launch = { elevation = "80°" }
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A gimbal for 38 mm motors, written."""
    folder = tmp_path_factory.mktemp("built")
    (folder / "large.toml").write_text(LARGE)
    return Path(mechanism(Settings("build", folder / "large.toml", out=folder / "large.xml")).file)


def test_the_default_dimensions_are_the_reference_mechanism_written_by_hand(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text(mjcf(Dimensions(), str(MESHES)))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    hand = mujoco.MjModel.from_xml_path(str(MJCF / "mechanism.xml"))
    names = "body_pos geom_pos geom_size site_pos body_inertia jnt_range actuator_ctrlrange"
    for name in (*names.split(), "actuator_gainprm", "dof_damping", "numeric_data"):
        assert getattr(model, name) == pytest.approx(getattr(hand, name), abs=1e-6), name


@pytest.mark.thorough
def test_a_vehicle_commands_the_stroke_of_its_mechanism(tmp_path: Path) -> None:
    """Also a vehicle that is described, and 0.8 of the stops of a mechanism that states none."""
    text = mjcf(Dimensions(stroke=math.radians(5), stops=math.radians(7)), str(MESHES))
    stated, unstated = tmp_path / "five.xml", tmp_path / "none.xml"
    stated.write_text(text)
    unstated.write_text(re.sub(r'<numeric name="stroke".*?/>', "", text))
    for vehicle in (None, MJCF / "examples" / "reference.toml"):
        for file, degrees in ((stated, 5.0), (unstated, 5.6), (None, 8.0)):
            model = load(ModelConfig(vehicle=vehicle, mechanism=file)).mj
            assert control_config(model).limit == pytest.approx(math.radians(degrees), rel=1e-6)
    settings = ModelConfig(mechanism=stated, overrides={"control_limit": 0.05})
    assert control_config(load(settings).mj).limit == pytest.approx(0.05)
    with pytest.raises(TwinError, match="control limit is 0; must be finite and > 0"):
        control_config(load(ModelConfig(overrides={"control_limit": 0.0})).mj)


def test_a_built_mechanism_has_its_dimensions_and_its_rods_close(built: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(built))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for axis, height in (("x", 0.057), ("y", 0.073)):
        end, ball = (data.site(f"{n}").xpos for n in (f"rod_{axis}_end", f"holder_{axis}_ball"))
        assert np.linalg.norm(end - ball) < 1e-9
        assert math.hypot(*ball[:2]) == pytest.approx(0.027)
        assert ball[2] == pytest.approx(0.0156)
        horn = data.site(f"horn_{axis}_ball").xpos
        assert np.linalg.norm(horn - data.body(f"horn_{axis}").xpos) == pytest.approx(
            math.hypot(0.010, 0.0028)
        )
        rod = np.linalg.norm(horn - ball)
        assert rod == pytest.approx(math.hypot(height - 0.0156, 0.0028))
    assert np.degrees(model.joint("x").range) == pytest.approx([-11, 11])
    assert 2 * model.geom("casing").size[0] == pytest.approx(0.038)


def test_printed_parts_of_a_built_mechanism_are_closed_and_fit_its_tube(built: Path) -> None:
    parts = sorted(built.with_suffix("").glob("*.stl"))
    assert len(parts) == 6
    for part in parts:
        body = trimesh.load(part)
        assert body.is_watertight, part.name
        assert body.volume > 0
    bulkhead = trimesh.load(built.with_suffix("") / "bulkhead.stl")
    assert bulkhead.bounds[1, 0] == pytest.approx(73.4 / 2 - 0.1, abs=0.05)


def test_the_wires_of_the_rods_end_where_the_bores_of_their_ends_do(tmp_path: Path) -> None:
    """The floor of a bore, by its vertices: the only ones as far aside as the wire is thick."""
    (tmp_path / "g.toml").write_text(LARGE)
    made = mechanism(Settings("build", tmp_path / "g.toml", out=tmp_path / "g.xml"))
    vertices = trimesh.load(tmp_path / "g" / "rod_end.stl").vertices
    aside = np.hypot(vertices[:, 0], vertices[:, 1])
    floor = vertices[np.isclose(aside, 0.75, atol=0.01) & (vertices[:, 2] > -8.9)][:, 2]
    assert np.ptp(floor) < 0.01
    for rod, wire in zip(made.rods_mm, made.wires_mm, strict=True):
        assert wire == pytest.approx(rod + 2 * floor.mean(), abs=0.02)
    assert any(f"wires {made.wires_mm[0]:.1f} mm (x)" in text for _, text in made.rows())


def test_meshes_writes_the_parts_of_any_mechanism_anywhere(built: Path, tmp_path: Path) -> None:
    drawn = draw(Meshes(mechanism=built, out=tmp_path / "parts"))
    for part in map(Path, drawn.parts):
        assert part.read_bytes() == (built.with_suffix("") / part.name).read_bytes()
    with pytest.raises(TwinError, match=r"direct_drive\.xml: cannot draw part bulkhead"):
        draw(Meshes(mechanism=MJCF / "examples" / "direct_drive.xml", out=tmp_path / "no"))


def test_meshes_without_a_mechanism_writes_every_part_of_the_bench(tmp_path: Path) -> None:
    drawn = draw(Meshes(out=tmp_path / "parts"))
    assert {Path(part).name for part in drawn.parts} == {p.name for p in MESHES.glob("*.stl")}


def test_an_own_part_takes_the_place_of_the_drawn_one_by_one_line(tmp_path: Path) -> None:
    own = MESHES / "horn.stl"
    (tmp_path / "own.stl").write_bytes((MESHES / "ring.stl").read_bytes())
    (tmp_path / "m.toml").write_text('stl = { horn = "own.stl" }')
    result = mechanism(Settings("build", tmp_path / "m.toml", out=tmp_path / "m.xml"))
    horn = Path(next(p for p in result.parts if p.endswith("horn.stl")))
    assert horn.read_bytes() == (MESHES / "ring.stl").read_bytes() != own.read_bytes()
    (tmp_path / "own.stl").write_bytes(b"solid")
    with pytest.raises(TwinError, match=r"own\.stl is no binary STL"):
        mechanism(Settings("build", tmp_path / "m.toml", out=tmp_path / "n.xml"))
    assert not (tmp_path / "n.xml").exists()


def test_a_part_in_the_output_folder_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reference(folder: Path, _: Path) -> dict[str, Path]:
        files = {name: MESHES / f"{name}.stl" for name in ("bulkhead", "ring", "horn")}
        return {name: Path(shutil.copy(file, folder)) for name, file in files.items()}

    monkeypatch.setattr("meshes.generate.generate", reference)
    own, ring = tmp_path / "mine" / "horn.stl", (MESHES / "ring.stl").read_bytes()
    own.parent.mkdir()
    own.write_bytes(ring)
    (tmp_path / "m.toml").write_text('stl = { horn = "mine/horn.stl" }')
    (tmp_path / "n.toml").write_text('bore = "50 mm"')
    for verb, message in (
        (Settings("build", tmp_path / "m.toml", out=tmp_path / "mine.xml", force=True), "own part"),
        (Settings("build", tmp_path / "n.toml", out=tmp_path / "mine.xml"), "--force"),
    ):
        with pytest.raises(TwinError, match=message):
            mechanism(verb)
    with pytest.raises(TwinError, match="--force"):
        draw(Meshes(out=own.parent))
    (tmp_path / "file").write_text("kept")
    with pytest.raises(TwinError, match="file"):
        mechanism(Settings("build", tmp_path / "n.toml", out=tmp_path / "file.xml"))
    assert own.read_bytes() == ring
    assert [p.name for p in own.parent.iterdir()] == ["horn.stl"]
    assert not (tmp_path / "mine.xml").exists()


def test_a_servo_of_twice_the_torque_has_twice_the_reserve(tmp_path: Path) -> None:
    reserves = []
    for factor in (1.0, 2.0):
        size = Dimensions()
        size = replace(size, servo=replace(size.servo, torque=factor * size.servo.torque))
        (tmp_path / "m.xml").write_text(mjcf(size, str(MESHES)))
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
        reserves.append(min(holding(model, 1.0).stall))
    assert reserves[1] == pytest.approx(2 * reserves[0], rel=1e-6)


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("applied", [False, True])
def test_a_servo_of_another_torque_has_the_same_no_load_speed(factor: float, applied: bool) -> None:
    servo = Dimensions().servo
    size = replace(Dimensions(), servo=replace(servo, torque=factor * servo.torque))
    model = mujoco.MjModel.from_xml_string(mjcf(size, str(MESHES)))
    if applied:
        apply_servo(model)
    data, dof = mujoco.MjData(model), int(model.joint("servo_x").dofadr[0])
    data.qpos[model.joint("servo_x").qposadr[0]] = -5.0  # its voltage is at the limit
    torque = []
    for data.qvel[dof] in (0.0, 1.0):
        mujoco.mj_forward(model, data)
        rubbing = data.qvel[dof] * model.dof_damping[dof] + model.dof_frictionloss[dof]
        torque.append(data.actuator("servo_x").force[0] - rubbing)
    # of the reference: constant 0.38 V s, winding 10 Ω, 4.8 V, and the friction of its shaft
    reference = mujoco.MjModel.from_xml_path(str(MJCF / "mechanism.xml"))
    damping, dry = reference.dof_damping[dof], reference.dof_frictionloss[dof]
    speed = (0.38 * 4.8 / 10 - dry) / (0.38**2 / 10 + damping)
    assert torque[0] / (torque[0] - torque[1]) == pytest.approx(speed, rel=1e-6)
    assert torque[0] + model.dof_frictionloss[dof] == pytest.approx(factor * 0.1824, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('bore = "40 mm"', "bore = 0.04 m: must be 0.044 m or more around a motor of 0.029 m"),
        ('stroke = "12°"', "stops: must be larger than stroke"),
        ('horns = "8 mm"', "no key 'horns'; did you mean horn?"),
        ('lever = "30 mm"', "lever = 0.03 m: must lie between the motor and the bore"),
        ('servo_x = "40 mm"', "servo_x = 0.04 m: the servo would sit in the motor"),
        ('stl = { cup = "a.stl" }', "stl: no part 'cup'; valid: bulkhead"),
        ("servo = { torque = 0 }", "servo.torque = 0: must be from 0.001 to 10"),
        ("horn = [", "is not valid TOML"),
        ("# nothing", "is empty; must have at least one dimension"),
    ],
)
def test_dimensions_that_cannot_be_are_refused_in_one_line(
    tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(TwinError) as refused:
        read(tmp_path / "m.toml")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_built_mechanism_flies_and_holds_its_attitude(built: Path) -> None:
    (built.parent / "motor.eng").write_text("G40 38 213 P 0.2 0.35 own\n0.05 45\n8 45\n8.2 0\n")
    (built.parent / "rocket.toml").write_text(ROCKET)
    out = built.parent / "flight.rrd"
    flight = fly(Fly(vehicle=built.parent / "rocket.toml", duration_s=3.0, out=out))
    assert flight.figures.rail_exit_s is not None
    assert np.abs(flight.figures.gimbal_saturation) < 0.2
    assert flight.figures.max_angle_of_attack_deg < 10


@pytest.mark.parametrize(
    ("tube", "motor"), [(75.0, 38.0), pytest.param(41.0, 24.0, marks=pytest.mark.slow)]
)
def test_a_mechanism_is_found_whose_own_check_passes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tube: float, motor: float
) -> None:
    monkeypatch.setattr(searching, "WANTED", 1)
    out = tmp_path / "found.toml"
    found = mechanism(Settings("search", tube_mm=tube, motor_mm=motor, out=out)).found[0]
    assert read(out).bore == pytest.approx((tube - 1.6) * 1e-3)
    assert found.figures.clearance.distance >= 0.3e-3
    assert found.figures.torque.reserve > 1
    assert np.degrees(read(out).stops) == pytest.approx(10.0)
    for name in ("lever", "height", "horn", "offset", "servo_x", "servo_y", "forward", "aft"):
        assert getattr(read(out), name) == pytest.approx(getattr(found.size, name)), name


def test_a_search_takes_size_and_masses_of_a_motor_file(tmp_path: Path) -> None:
    file = tmp_path / "motor.eng"
    file.write_text("G40 38 250 P 0.2 0.35 own\n0.05 45\n8 45\n8.2 0\n")
    motor = searching._motor(Settings("search", tube_mm=75, motor=file))
    size = next(searching._candidates(0.0734, motor, math.radians(8.0)))
    assert (size.motor, size.size, size.loaded, size.burning) == (0.038, 0.25, 0.35, 0.2)
    with pytest.raises(TwinError, match="one of --motor and --motor-mm"):
        mechanism(Settings("search", tube_mm=75, motor_mm=38, motor=file))


def test_a_description_in_place_of_a_model_names_the_command_that_builds_it(built: Path) -> None:
    with pytest.raises(TwinError, match=r"run `twin mechanism build .*large.toml`"):
        load(ModelConfig(mechanism=built.with_suffix(".toml")))
    (built.parent / "own.toml").write_text(ROCKET.replace("large.xml", "large.toml"))
    (built.parent / "motor.eng").write_text("G40 38 213 P 0.2 0.35 own\n0.05 45\n8 45\n8.2 0\n")
    with pytest.raises(TwinError, match=r"run `twin mechanism build .*large.toml`"):
        load(ModelConfig(vehicle=built.parent / "own.toml"))


def test_a_tube_that_is_too_narrow_is_refused_with_what_is_needed(tmp_path: Path) -> None:
    with pytest.raises(TwinError, match=r"--tube-mm 60 .* must be 71 mm or more with a wall of"):
        mechanism(Settings("search", tube_mm=60, motor_mm=54, out=tmp_path / "m.toml"))
    motor, stroke = searching._Motor(0.054), math.radians(8.0)
    for tube, fits in ((71.0, True), (70.0, False)):
        assert any(searching._candidates((tube - 1.6) * 1e-3, motor, stroke)) is fits
    with pytest.raises(TwinError, match="needs --tube-mm and one of --motor and"):
        mechanism(Settings("search", tube_mm=30))


def test_a_hostile_model_is_not_compiled_for_its_parts(tmp_path: Path) -> None:
    file = tmp_path / "many.xml"
    bodies = '<replicate count="1000000"><geom size="1"/></replicate>'
    file.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    with pytest.raises(TwinError, match="expands to more than"):
        draw(Meshes(mechanism=file, out=tmp_path / "parts"))
    assert not (tmp_path / "parts").exists()


@pytest.mark.thorough
def test_a_search_without_a_result_says_which_limit_most_candidates_miss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(searching, "CHECKED", 1)
    out = tmp_path / "m.toml"
    with pytest.raises(TwinError, match=r"the servos stall at 18\d N mm, 90 g takes \d+ N mm"):
        mechanism(Settings("search", tube_mm=80, motor_mm=38, load_g=90, out=out))
    assert not out.exists()
    texts = [
        "0.1 mm between a and b at 3°",
        "0.2 mm between a and c",
        "0.0 mm between a and b at 8°",
    ]
    assert searching._commonest(texts) == texts[0]


@pytest.mark.thorough
def test_a_long_arm_and_its_rod_clear_the_bracket_of_a_wide_tube(tmp_path: Path) -> None:
    """A motor of 54 mm: levers of 33 to 37 mm, arms of 8 to 12 mm that turn by up to 46°."""
    for bore, kept in ((0.0784, 6), (0.0984, 0)):
        candidates = searching._candidates(bore, searching._Motor(0.054), math.radians(8.0))
        size = next(itertools.islice(candidates, kept, None))
        file = tmp_path / f"{kept}.xml"
        write(size, file)
        solids = Clearance(load(ModelConfig(scene="bench", mechanism=file)).mj)
        for part in ("horn_x", "rod_x_upper", "horn_y", "rod_y_upper"):
            assert solids.gap("bracket", part, *2 * (-math.radians(10.0),)) >= 0.3e-3
