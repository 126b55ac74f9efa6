"""Vehicles from descriptions: what is refused, what is built, and that it flies the same."""

import json
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.recording import read as read_recording
from twin.config import Fly
from twin.config.vehicle import Vehicle as Settings
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.vehicle.vehicle import vehicle
from twin.physics import native
from twin.physics.vehicle import Vehicle, VehicleError, parse, read
from twin.physics.vehicle.design import allowed
from twin.plant.authority import balance
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

EXAMPLES = MJCF / "examples"
ROCKET = """
body = [
  { part = "nose", length = "0.3 m", diameter = "100 mm", mass = "200 g" },
  { part = "tube", length = "1.2 m", mass = "0.9 kg" },
]
fins = [
  { count = 3, root = "150 mm", tip = "80 mm", span = "90 mm", thickness = "3 mm", mass = "90 g" },
]
masses = [{ name = "avionics", mass = "800 g", position = "0.6 m" }]
motor = { file = "motor.eng" }
"""
MOTOR = "K1 54 400 P 0.52 1.1 own\n0.05 250\n3.95 250\n4.05 0\n"


@pytest.fixture
def rocket(tmp_path: Path) -> Path:
    """A small rocket's description and its motor."""
    (tmp_path / "motor.eng").write_text(MOTOR)
    path = tmp_path / "rocket.toml"
    path.write_text(ROCKET)
    return path


def changed(path: Path, *pairs: tuple[str, str]) -> Path:
    text = path.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


# what of a flight must be the same, by the signal it is taken from
def figures(file: Path, gimbal: str, folder: Path) -> dict[str, float]:
    result = fly(Fly(vehicle=file, gimbal=gimbal, out=folder / "fly.rrd"))
    position = read_recording(Path(result.recording))["vehicle/position"].values
    assert result.powered_slant_range_m is not None
    return {
        "apogee": result.max_height_m,
        "speed": result.max_speed_m_s,
        "range at burnout": result.powered_slant_range_m,
        "landing": float(np.hypot(*(position[-1] - position[0])[:2])),
    }


@pytest.mark.parametrize(
    ("description", "written", "gimbal"),
    [
        ("reference.toml", "../vehicle.xml", "transfer-function"),
        pytest.param("reference.toml", "../vehicle.xml", "linkage", marks=pytest.mark.slow),
        ("large_rocket.toml", "large_rocket.xml", "linkage"),
    ],
)
def test_a_description_flies_like_the_mjcf_written_by_hand_within_5e_4(
    tmp_path: Path, description: str, written: str, gimbal: str
) -> None:
    ours = figures(EXAMPLES / description, gimbal, tmp_path)
    assert ours == pytest.approx(figures(EXAMPLES / written, gimbal, tmp_path), rel=5e-4)


@pytest.mark.parametrize("name", ["reference.toml", "large_rocket.toml"])
def test_the_shipped_descriptions_are_25_lines_at_most(name: str) -> None:
    assert len((EXAMPLES / name).read_text().splitlines()) <= 25


@pytest.mark.parametrize("name", ["reference.toml", "large_rocket.toml"])
def test_a_built_mjcf_is_the_vehicle_that_flies(tmp_path: Path, name: str) -> None:
    built = vehicle(Settings("build", EXAMPLES / name, out=tmp_path / "deep" / "built.xml"))
    named = [Path(each.get("file", "")) for each in ElementTree.parse(Path(built)).iter("model")]
    assert not any(file.is_absolute() for file in named)  # the mechanism, if it has one
    here, there = (
        load(ModelConfig(vehicle=Path(file))).mj for file in (EXAMPLES / name, Path(built))
    )
    for field in ("body_mass", "body_ipos", "body_inertia", "numeric_data", "qpos0", "site_pos"):
        np.testing.assert_array_equal(getattr(here, field), getattr(there, field), field)


def test_every_numeric_of_a_built_mjcf_has_its_source(tmp_path: Path) -> None:
    file = vehicle(Settings("build", EXAMPLES / "reference.toml", out=tmp_path / "built.xml"))
    lines = Path(file).read_text().splitlines()
    found = [k for k, line in enumerate(lines) if "<numeric name=" in line]
    bare = [lines[k].split('"')[1] for k in found if "<!--" not in lines[k - 1]]
    plain = {"propellant_mass", "loaded_mass", "length", "ignition", "grain_radius"}
    assert set(bare) == {"native_index"} | {f"motor_{name}" for name in plain}


def test_mass_properties_of_the_compiled_model_are_the_descriptions(rocket: Path) -> None:
    design = Vehicle.of(read(rocket))
    model = load(ModelConfig(vehicle=rocket)).mj
    mass, station, _, _ = balance(model)
    motor = design.motor
    centre = design.airframe.mass * design.airframe.station
    centre += motor.loaded_mass * (1.5 - motor.length / 2)
    assert mass == pytest.approx(design.airframe.mass + 1.1, rel=1e-9)
    assert design.origin - station == pytest.approx(centre / mass, rel=1e-6)
    own = model.body("vehicle")
    assert own.mass[0] == pytest.approx(0.2 + 0.9 + 0.09 + 0.8, rel=1e-9)
    assert own.inertia == pytest.approx(
        [design.airframe.transverse, design.airframe.transverse, design.airframe.axial], rel=1e-8
    )


def test_numbers_without_a_unit_are_in_si_units(rocket: Path) -> None:
    bare = changed(rocket, ('"100 mm"', "0.1"), ('"200 g"', "0.2"), ('"3 mm"', "0.003"))
    assert Vehicle.of(read(bare)).airframe == Vehicle.of(parsed(ROCKET)).airframe


def parsed(text: str):
    motor = read(EXAMPLES / "large_rocket.toml").motor_data
    return replace(parse(text), motor_data=motor)


@pytest.mark.usefixtures("callbacks")
def test_canted_fins_turn_at_the_rate_at_which_their_strips_meet_no_air(rocket: Path) -> None:
    """Strip theory: no moment at ω = v δ ∫c y dy / ∫c y² dy, by quadrature over the fin."""
    changed(rocket, ("count = 3,", 'count = 3, cant = "2°",'))
    model = load(ModelConfig(vehicle=rocket, overrides={"ramp_length": 0.0})).mj
    y = np.linspace(0.0, 0.09, 10_001)
    chord = 0.15 - 0.07 * y / 0.09
    rate = 50.0 * math.radians(2) * np.trapezoid(chord * (0.05 + y), y)
    rate /= np.trapezoid(chord * (0.05 + y) ** 2, y)
    moments = []
    for turning in (0.0, rate):
        data = mujoco.MjData(model)
        data.time = 100.0  # burnt out
        data.qpos[:7] = 0, 0, 100, 1, 0, 0, 0
        data.qvel[2], data.qvel[5] = 50.0, turning
        mujoco.mj_forward(model, data)
        moments.append(float(data.qfrc_passive[5]))
    assert moments[0] > 0.1  # N m, to the right seen from behind: about +z
    assert moments[1] == pytest.approx(0.0, abs=1e-5 * moments[0])


@pytest.fixture
def callbacks():
    with native.installed():
        yield


def test_another_motor_moves_the_nozzle_and_the_strips_with_it(tmp_path: Path) -> None:
    """The reference vehicle's motor is seen behind its tube; a shorter one is seen less."""
    short = tmp_path / "short.eng"
    short.write_text("S1 29 124 P 0.060 0.125 own\n0.1 20\n2 20\n2.1 0\n")
    model = load(ModelConfig(vehicle=EXAMPLES / "reference.toml", motor=short))
    own = load(ModelConfig(vehicle=EXAMPLES / "reference.toml"))
    seen, before = (m.mj.numeric("air_strip_area").data.sum() for m in (model, own))
    assert before - seen == pytest.approx((0.2134 - 0.124) * 0.029, rel=1e-3)
    assert model.mj.site("gimbal_nozzle").pos[2] == pytest.approx(0.036 - 0.124, abs=1e-9)
    motor = model.mj.body_mass[[model.mj.body(f"gimbal_{n}").id for n in ("motor", "propellant")]]
    assert motor == pytest.approx([0.065, 0.060], rel=1e-9)
    # and the same by exchanging the motor of the MJCF written by hand, whose strips stay
    hand = load(ModelConfig(motor=short)).mj
    np.testing.assert_allclose(hand.body_mass[3:], model.mj.body_mass[3:], rtol=1e-9)


def test_a_motor_that_the_description_names_takes_the_mechanisms_place(tmp_path: Path) -> None:
    (tmp_path / "thin.eng").write_text("T1 24 124 P 0.040 0.085 own\n0.1 15\n2 15\n2.1 0\n")
    text = (EXAMPLES / "reference.toml").read_text()
    text = text.replace("../motors/reference.eng", "thin.eng")
    (tmp_path / "own.toml").write_text(text)
    here = load(ModelConfig(vehicle=tmp_path / "own.toml"))
    file = vehicle(Settings("build", tmp_path / "own.toml", out=tmp_path / "own.xml"))
    built = load(ModelConfig(vehicle=Path(file)))
    for model in (here, built):
        assert model.mj.body("gimbal_motor").mass[0] == pytest.approx(0.045)
        assert model.mj.site("gimbal_nozzle").pos[2] == pytest.approx(0.036 - 0.124, abs=1e-9)
        assert model.notes == (
            "the motor is 24 mm wide, its mount 29 mm: flown with an adapter that weighs nothing",
        )
    np.testing.assert_array_equal(here.mj.numeric_data, built.mj.numeric_data)
    fits = load(ModelConfig(vehicle=Path(file), motor=MJCF / "motors" / "reference.eng"))
    assert fits.notes == ()
    assert fits.mj.site("gimbal_nozzle").pos[2] == pytest.approx(-0.1774, abs=1e-9)


def test_another_mechanism_carries_the_motor_where_it_has_its_place() -> None:
    direct = EXAMPLES / "direct_drive.xml"
    model = load(ModelConfig(vehicle=EXAMPLES / "reference.toml", mechanism=direct)).mj
    assert model.neq == 0
    assert model.site("gimbal_nozzle").pos[2] == pytest.approx(-0.1774, abs=1e-9)


def test_the_recording_keeps_the_description_and_its_motor(tmp_path: Path) -> None:
    file = EXAMPLES / "reference.toml"
    result = fly(Fly(vehicle=file, duration_s=0.1, out=tmp_path / "fly.rrd"))
    kept = read_recording(Path(result.recording)).properties["files"]
    assert kept["vehicle"]["text"] == file.read_text()
    assert kept["vehicle_motor"]["text"] == (MJCF / "motors" / "reference.eng").read_text()


def test_stale_strips_of_a_shortened_tube_are_reported(tmp_path: Path) -> None:
    text = (EXAMPLES / "large_rocket.xml").read_text()
    short = text.replace('size="0.049 0.75" pos="0 0 0.5"', 'size="0.049 0.5" pos="0 0 0.25"')
    short = short.replace('mesh="nose" pos="0 0 1.25"', 'mesh="nose" pos="0 0 0.75"')
    assert short.count("0.049 0.5") == 1
    (tmp_path / "short.xml").write_text(short)
    notes = load(ModelConfig(vehicle=tmp_path / "short.xml")).notes
    assert re.search(
        r"air_strip_z reaches from .* to 1\.6 m, the geometry from -0\.27 to 1\.1 m", notes[0]
    )
    assert "air_nose_z = 1.483 m lies off the geometry" in notes[1]
    thick = text.replace('size="0.049 0.75"', 'size="0.06 0.75"')
    (tmp_path / "thick.xml").write_text(thick)
    (note,) = load(ModelConfig(vehicle=tmp_path / "thick.xml")).notes
    assert "air_strip_area adds up to" in note
    assert load(ModelConfig(vehicle=EXAMPLES / "large_rocket.xml")).notes == ()


def test_the_static_margin_of_a_flight_is_that_of_its_centres(tmp_path: Path, rocket: Path) -> None:
    """In diameters of 100 mm, from the description's own figures."""
    result = fly(Fly(vehicle=rocket, duration_s=0.1, out=tmp_path / "fly.rrd"))
    design = Vehicle.of(read(rocket))
    assert result.static_margin is not None
    for margin, left in zip(result.static_margin, (0.52, 0.0), strict=True):
        mass = design.airframe.mass + 0.58 + left
        centre = design.airframe.mass * design.airframe.station + (0.58 + left) * 1.3
        expected = (design.centre_of_pressure - centre / mass) / 0.1
        assert margin == pytest.approx(expected, abs=5e-3)  # of an angle of 1e-4 rad, and 1 mg
    assert any(name == "static margin" for name, _ in result.rows())


def test_the_drawing_is_to_scale(tmp_path: Path) -> None:
    """The large example by its published lengths: 0.35 m of nose, 1.5 m of tube, motor behind."""
    file, out = MJCF / "examples" / "large_rocket.toml", tmp_path / "rocket.svg"
    shown = vehicle(Settings("show", file, out=out))
    root = ElementTree.parse(out).getroot()
    tag = "{http://www.w3.org/2000/svg}"
    shapes = [
        np.array([p.split(",") for p in s.get("points", "").split()], float)
        for s in root.iter(f"{tag}polygon")
    ]
    fins, (nose, tube, motor) = shapes[:2], shapes[2:]
    scale = np.ptp(tube[:, 0]) / 1.5
    assert np.ptp(nose[:, 0]) / scale == pytest.approx(0.35, abs=1e-3)
    assert np.ptp(tube[:, 1]) / scale == pytest.approx(0.098, abs=1e-3)
    assert fins[0][:, 1].min() - nose[:, 1].mean() == pytest.approx(
        nose[:, 1].mean() - fins[1][:, 1].max(), abs=0.2
    )
    assert motor[:, 0].max() > tube[:, 0].max()
    places = sorted(float(c.get("cx", "0")) for c in root.iter(f"{tag}circle"))
    stations = [shown.tip - shown.states[k].centre_of_mass for k in (-1, 0)]
    stations.append(shown.tip - shown.centre_of_pressure["0"])
    assert (np.array(places) - nose[:, 0].min()) / scale == pytest.approx(stations, abs=1e-3)
    with pytest.raises(TwinError, match=r"--out: draws descriptions"):
        Settings("show", MJCF / "vehicle.xml", out=out)


def test_show_prints_what_the_model_weighs_and_where_the_air_acts(rocket: Path) -> None:
    result = vehicle(Settings("show", rocket))
    text = result.text()
    design = Vehicle.of(read(rocket))
    assert f"0° of attack: {design.centre_of_pressure:.4f} m" in text
    assert f"mass                {design.mass:.4g} kg loaded" in text
    assert "from the shape: friction" in text
    assert "fins 1 (3 fins, together): 90 g at" in text
    assert sum(part.mass for part in result.parts) == pytest.approx(3.09)
    assert json.loads(json.dumps(result.as_dict()))["states"][0]["mass"] == pytest.approx(3.09)
    built = vehicle(Settings("build", rocket, out=rocket.with_suffix(".xml")))
    same = vehicle(Settings("show", Path(built)))
    assert same.states == result.states


@pytest.mark.parametrize("mechanism", ["mechanism", "examples/direct_drive"])
def test_the_parts_that_are_shown_balance_where_the_model_does(tmp_path, mechanism):
    text = (MJCF / "examples" / "reference.toml").read_text()
    text = text.replace("../motors", f"{MJCF}/motors")
    pivot = 'pivot = "822.6 mm"'
    assert pivot in text
    file = tmp_path / "rocket.toml"
    file.write_text(text.replace(pivot, f'{pivot}, mechanism = "{MJCF}/{mechanism}.xml"'))
    shown = vehicle(Settings("show", file))
    mass = np.array([part.mass for part in shown.parts])
    station = np.array([part.station for part in shown.parts])
    assert mass.sum() == pytest.approx(shown.states[0].mass, abs=1e-6)
    centre = shown.tip - shown.states[0].centre_of_mass
    assert mass @ station / mass.sum() == pytest.approx(centre, abs=1e-4)


# change of the description above, and what the message says
REFUSED = [
    (ROCKET, "not toml at all", "not valid TOML"),
    ("body = [", "bodies = [", "no key 'bodies'; did you mean body"),
    ("length =", "lenght =", r"body\[0\]: no key 'lenght'; did you mean length\? valid: p"),
    ("{ count", "{ number", r"fins\[0\]: no key 'number'"),
    ("masses", "mass", "no key 'mass'; did you mean masses"),
    ("motor = { file", "motor = { path", "motor: no key 'path'"),
    ('part = "nose"', 'part = "cone"', r"body\[0\].part = 'cone': must be nose or"),
    ('part = "nose"', 'part = "tube"', 'must begin with a part = "nose"'),
    ('{ part = "tube", length = "1.2 m"', '{ part = "nose", length = "1.2 m"', "only the first"),
    ('"0.3 m", diameter = "100 mm"', '"0.3 m"', r"body\[0\]: a nose needs diameter"),
    ('"0.3 m"', '"-0.3 m"', r"body\[0\].length = '-0.3 m': must be positive"),
    ('"0.3 m"', '"0.3 furlong"', r"must have one of the units m, mm"),
    ('"0.3 m"', '"0.3 kg"', r"must have one of the units m, mm"),
    ('"0.3 m"', "true", r"must be a number in m, or a text such as \"150 mm\""),
    ('"0.3 m"', "nan", "must be finite"),
    ('"0.3 m"', "1e999", "must be finite"),
    ('"200 g"', "200", "nose 1: 200 kg in a body of .* litres would be denser than steel"),
    (', mass = "200 g"', "", "body part 'nose 1' has no mass: give mass"),
    (', mass = "200 g"', ', wall = "-1 mm", density = 1200', "wall = '-1 mm': must be positive"),
    (', mass = "200 g"', ', wall = "60 mm", density = 1200', "wall = 0.06 m of a part"),
    (', mass = "200 g"', ', mass = "1 g", centre = 0.4', "centre = 0.4 m lies behind"),
    ('length = "1.2 m"', 'length = "1.2 m", shape = "cone"', "a tube has no shape"),
    ("count = 3", "count = 2", r"fins\[0\].count = 2: must be from 3 to 8"),
    ("count = 3", "count = 3.5", "count = 3.5 must be a whole number"),
    ('"150 mm", tip', '"1.3 m", tip', "the root reaches from 0.2 to 1.5 m .*, 0.3 to 1.5 m"),
    ('thickness = "3 mm"', 'thickness = "90 mm"', "thickness = 0.09 m of a root of 0.15 m"),
    (', tip = "80 mm"', "", r"fins\[0\]: a trapezoid needs tip"),
    ("count = 3,", 'count = 3, cant = "45°",', "must be from -30° to 30°"),
    ("count = 3,", 'count = 3, shape = "points", points = [[0, 0], [0.1, 0.1]],', "has 2 corners"),
    ("count = 3,", 'count = 3, position = "1.45 m",', "the root reaches from 1.45 to 1.6 m"),
    ('"0.6 m"', '"1.6 m"', r"masses\[0\] \(avionics\): reaches from 1.6 to 1.6 m behind"),
    ('"0.6 m"', '"0.6 m", diameter = "0.2 m"', r"diameter = 0.2 m; the body is 0.1 m wide"),
    ("motor = ", 'rail_buttons = ["1 m"]\nmotor = ', "must be two stations, not 1"),
    ("motor = ", 'rail_buttons = ["1 m", "9 m"]\nmotor = ', "9 m; must lie"),
    ('motor = { file = "motor.eng" }', "", "motor.file is missing"),
    ('"motor.eng"', '"none.eng"', "cannot read motor .*none.eng: No such file"),
    ('"motor.eng" }', '"motor.eng", diameter = "38 mm" }', "is 54 mm wide; its mount"),
    ('"motor.eng" }', '"motor.eng", diameter = "0.2 m" }', "the body is 0.1 m wide there"),
    ("motor = ", 'origin = 1\ngimbal = { pivot = 1 }\nmotor = ', "the pivot of"),
    ("motor = ", 'gimbal = { pivot = 2 }\nmotor = ', "gimbal.pivot = 2 m; must lie"),
    ('"1.2 m"', "1200", r'body\[1\].length = 1200: .* without a unit it is in m: write "1200 mm"'),
    ("motor = ", 'launch = { elevation = 85 }\nmotor = ', 'it is in rad: write "85°"'),
    ('"90 mm"', "90", r'span = 90 m; the body is 1.5 m long.* write "90 mm"'),
    ("motor = ", 'launch = { elevation = "95°" }\nmotor = ', "elevation = '95°': must be from"),
    ("motor = ", 'name = "<!-- x -->"\nmotor = ', "may have letters, digits, space"),
    ("motor = ", "drag = -1\nmotor = ", "drag = -1: must be from 0 to 10"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "says"), REFUSED)
def test_a_vehicle_that_cannot_be_is_refused_in_one_line_with_what_is_right(
    rocket: Path, old: str, new: str, says: str
) -> None:
    changed(rocket, (old, new))
    with pytest.raises(TwinError, match=says) as caught:
        load(ModelConfig(vehicle=rocket))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


PLACED = [
    ('"822.6 mm"', '"400 mm"', "reaches 177 mm aft .* at most 42 mm: put the pivot at 811"),
    ('"822.6 mm"', '"810 mm"', "reaches 43 mm aft of it"),
    ('mass = "216', 'wall = "27 mm", mass = "216', "the body is solid there: give a wider"),
    ('diameter = "54 mm"', 'diameter = "50 mm"', "bore of 52 mm and reaches 77 mm .* 50 mm wide"),
    ('diameter = "54 mm"', 'diameter = "51.96 mm"', "bore of 52 mm .* body is 51.96 mm wide"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "says"), PLACED)
def test_a_gimbal_that_the_body_does_not_take_is_refused(old: str, new: str, says: str) -> None:
    design = read(EXAMPLES / "reference.toml")
    text = (EXAMPLES / "reference.toml").read_text()
    assert old in text
    changed_design = replace(parse(text.replace(old, new)), motor_data=design.motor_data)
    with pytest.raises(VehicleError, match=says):
        Vehicle.of(changed_design)


def test_masses_in_each_others_place_are_told_and_the_shipped_ones_are_not() -> None:
    for file in (*EXAMPLES.glob("*.toml"), *EXAMPLES.glob("flights/*.toml")):
        assert Vehicle.of(read(file)).notes == ()
    design = read(EXAMPLES / "reference.toml")
    payload, parachute, avionics = design.masses
    moved = (payload, replace(parachute, position=0.72), replace(avionics, position=0.76))
    assert Vehicle.of(replace(design, masses=moved)).notes == (
        "parachute and avionics overlap by 40 mm, 740 to 780 mm behind the tip",
        "parachute and the gimbal overlap by 34 mm, 746 to 780 mm behind the tip",
        "avionics and the gimbal overlap by 34 mm, 746 to 780 mm behind the tip",
    )
    moved = (payload, replace(parachute, position=0.70), replace(avionics, position=0.75))
    assert Vehicle.of(replace(design, masses=moved)).notes[0] == (  # the largest overlap first
        "parachute and avionics overlap by 30 mm, 730 to 760 mm behind the tip"
    )
    ring = replace(avionics, position=0.3, length=0.01)  # on a longer, narrower tube
    tube = replace(parachute, diameter=0.035)
    assert Vehicle.of(replace(design, masses=(payload, tube, ring))).notes == ()
    solid = replace(design, masses=(tube, replace(ring, hollow=False)))
    assert "overlap by 10 mm" in Vehicle.of(solid).notes[0]
    inside = (payload, parachute, replace(parachute, diameter=0.03, length=0.1))
    assert Vehicle.of(replace(design, masses=inside)).notes == ()
    wide = replace(design, masses=(replace(payload, diameter=0.05),))
    assert Vehicle.of(wide).notes == ("payload is 50 mm wide; the body has 44.6 mm there",)


def test_the_pivot_that_a_vehicle_without_gimbal_is_offered_builds(tmp_path: Path) -> None:
    text = (EXAMPLES / "reference.toml").read_text()
    text = text.replace("../motors/", f"{EXAMPLES.parent / 'motors'}/")
    given = next(line for line in text.splitlines() if line.startswith("gimbal"))
    fixed = tmp_path / "fixed.toml"
    fixed.write_text(text.replace(given, ""))
    shown = vehicle(Settings("show", fixed))
    assert "elevation 50°, azimuth 0° (from east to north), rail 2 m" in shown.launch
    offered = shown.gimbal.split(";")[1].split(" puts")[0].strip()
    assert offered == 'gimbal = { pivot = "0.8226 m" }'  # that of the shipped description
    fixed.write_text(text.replace(given, offered))
    assert vehicle(Settings("show", fixed)).gimbal == "pivot at 0.8226 m"
    wide = vehicle(Settings("show", EXAMPLES / "large_rocket.toml")).gimbal
    assert wide.startswith("none; the shipped one does not fit: motor 'Large' is 54 mm wide")


def test_an_elevation_of_exactly_90_degrees_flies_straight_up(tmp_path: Path, rocket: Path) -> None:
    changed(rocket, ("motor = ", 'launch = { elevation = "90°" }\nmotor = '))
    result = fly(Fly(vehicle=rocket, out=tmp_path / "fly.rrd"))
    position = read_recording(Path(result.recording))["vehicle/position"].values
    ascent = position[: int(np.argmax(position[:, 2]))]
    assert result.max_height_m > 500
    assert np.hypot(ascent[:, 0], ascent[:, 1]).max() < 1e-3 * result.max_height_m
    assert load(ModelConfig(overrides={"ramp_elevation": 1.5708})).notes == ()


def test_files_that_are_no_descriptions_are_refused(tmp_path: Path) -> None:
    (tmp_path / "large.toml").write_bytes(b"#" * 300_000)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    deep = "a = " + "[" * 5000 + "]" * 5000
    (tmp_path / "deep.toml").write_text(deep)
    for name, says in (
        ("large", "larger than 200000 bytes"),
        ("binary", "not a text in UTF-8"),
        ("deep", "not valid TOML|no key"),
        ("missing", "cannot read vehicle .*: No such file"),
    ):
        with pytest.raises(VehicleError, match=says):
            read(tmp_path / f"{name}.toml")


LEAF = st.one_of(
    st.floats(), st.integers(-3, 3), st.booleans(), st.text(max_size=6),
    st.sampled_from(["nose", "tube", "10 mm", "1 kg", "-1 m", "90°", "haack", "points"]),
)  # fmt: skip
KEYS = st.sampled_from([k for c in parse.__globals__["LISTS"].values() for k in allowed(c)])
ITEM = st.dictionaries(KEYS, LEAF | st.lists(st.lists(LEAF, max_size=3), max_size=4), max_size=8)
DOCUMENT = st.dictionaries(
    st.sampled_from(["body", "fins", "masses", "motor", "gimbal", "launch", "drag", "name", "x"]),
    LEAF | ITEM | st.lists(ITEM, max_size=4),
    max_size=6,
)


def toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=True) if isinstance(value, str) else repr(value)


@settings(max_examples=40, deadline=None)
@given(DOCUMENT)
def test_any_document_is_a_vehicle_or_one_line_that_says_why(document: dict) -> None:
    text = "\n".join(f"{k} = {toml(v)}" for k, v in document.items())
    try:
        design = parsed(text)
        built = Vehicle.of(design)
    except VehicleError as error:
        message = str(error)
    else:
        message = ""
        assert built.airframe.mass > 0
        assert all(math.isfinite(v) for v in (built.drag.total, built.centre_of_pressure))
    assert "\n" not in message
    assert len(message) < 500


def test_a_description_is_toml_that_any_reader_takes() -> None:
    for name in ("reference.toml", "large_rocket.toml"):
        assert "body" in tomllib.loads((EXAMPLES / name).read_text())
