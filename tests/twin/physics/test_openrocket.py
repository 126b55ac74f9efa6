"""OpenRocket designs: shapes, masses and places against closed forms; hostile archives."""

import gzip
import io
import math
import zipfile
from pathlib import Path

import pytest

from analysis.recording import Recording
from twin.config import Fly
from twin.config.vehicle import Vehicle as Settings
from twin.errors import TwinError
from twin.experiments.kept import files_of, restored
from twin.experiments.vehicle.vehicle import vehicle
from twin.physics import openrocket
from twin.physics.openrocket import container
from twin.physics.vehicle import described
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

FLIGHTS = MJCF / "examples" / "flights"
CONE = 0.3, 0.04  # length and base radius [m] of the nose, solid, 500 kg/m³
TUBE = 0.8, 0.04, 0.002  # length, outer radius, wall [m] of the tube, 1000 kg/m³
FIN = 0.1, 0.06, 0.08, 0.04, 0.003  # root, tip, span, sweep, thickness [m], 700 kg/m³
SIMULATION = """<simulations><simulation><conditions><launchrodlength>1.5</launchrodlength>
<launchrodangle>5</launchrodangle><launchroddirection>90</launchroddirection>
<launchaltitude>120</launchaltitude></conditions><flightdata><databranch types="Vertical velocity,
Angle of attack,Mach number,Mass,Motor mass,CP location">
<datapoint>0,1.5,0.0,3.1,0.1,NaN</datapoint><datapoint>9,0.01,0.1,3.06,0.06,0.5</datapoint>
<datapoint>9,0.001,0.1,3.05,0.05,0.75</datapoint></databranch></flightdata></simulation>
</simulations>"""


def design(
    inside: str = "", nose: str = "", tube: str = "", rocket: str = "", after: str = ""
) -> str:
    """A rocket of a solid cone and a tube with three fins; its other parts go into the tube."""
    return f"""<openrocket version="1.9"><rocket><name>Own &amp; "small"</name>{rocket}
<motorconfiguration configid="a" default="true"/><subcomponents><stage><name>S</name><subcomponents>
<nosecone><name>N</name><material density="500"/><length>{CONE[0]}</length>
<thickness>filled</thickness><shape>conical</shape><aftradius>auto</aftradius>{nose}</nosecone>
<bodytube><name>T</name><material density="1000"/><length>{TUBE[0]}</length>
<thickness>{TUBE[2]}</thickness><radius>{TUBE[1]}</radius>{tube}<subcomponents>
<trapezoidfinset><name>F</name><fincount>3</fincount><position type="bottom">-0.01</position>
<material density="700"/><rootchord>{FIN[0]}</rootchord><tipchord>{FIN[1]}</tipchord>
<height>{FIN[2]}</height><sweeplength>{FIN[3]}</sweeplength><thickness>{FIN[4]}</thickness>
<crosssection>square</crosssection></trapezoidfinset>{inside}</subcomponents></bodytube>
</subcomponents></stage></subcomponents></rocket>{SIMULATION}</openrocket>"""


def packed(path: Path, text: str | bytes, name: str = "rocket.ork") -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, text)
    return path


def read(tmp_path: Path, text: str) -> openrocket.Imported:
    return openrocket.imported(openrocket.document(packed(tmp_path / "r.ork", text)))


def inner(kind: str, place: str, rest: str) -> str:
    """A part of the tube at a position of some kind."""
    method, offset = place.split()
    return f'<{kind}><position type="{method}">{offset}</position>{rest}</{kind}>'


def free(*xy: float) -> str:
    """A free-form fin set."""
    points = "".join(f'<point x="{x}" y="{y}"/>' for x, y in zip(xy[::2], xy[1::2], strict=True))
    return (
        "<freeformfinset><name>X</name><fincount>3</fincount><thickness>0.003</thickness>"
        f"<finpoints>{points}</finpoints></freeformfinset>"
    )


def test_masses_and_centre_of_pressure_are_those_of_the_closed_forms(tmp_path: Path) -> None:
    found = read(tmp_path, design())
    (length, radius), (tube, _, wall), (root, tip, span, _, thick) = CONE, TUBE, FIN
    cone = 500 * math.pi * radius**2 * length / 3
    shell = 1000 * math.pi * (radius**2 - (radius - wall) ** 2) * tube
    fins = 3 * 700 * thick * span * (root + tip) / 2
    assert found.airframe.mass == pytest.approx(cone + shell + fins, rel=1e-5)
    # trapezoid with a swept leading edge: mean of the two triangles' centres
    x = (root**2 + tip**2 + root * tip + FIN[3] * (root + 2 * tip)) / (3 * (root + tip))
    moment = cone * 0.75 * length + shell * (length + tube / 2)
    moment += fins * (length + tube - root - 0.01 + x)
    assert found.airframe.station * found.airframe.mass == pytest.approx(moment, rel=1e-5)
    # Barrowman: cone 2 at 2/3; fins with interference at a quarter of their mean chord
    middle = math.hypot(span, FIN[3] + tip / 2 - root / 2)
    slope = 4 * 3 * (span / (2 * radius)) ** 2 / (1 + math.hypot(1, 2 * middle / (root + tip)))
    slope *= 1 + radius / (span + radius)
    place = length + tube - root - 0.01 + FIN[3] / 3 * (root + 2 * tip) / (root + tip)
    place += (root + tip - root * tip / (root + tip)) / 6
    expected = (2 * length * 2 / 3 + slope * place) / (2 + slope)
    assert found.centre_of_pressure == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("part", "mass", "station"),
    [
        (  # automatic radius: that of the tube's bore
            inner(
                "bulkhead",
                "top 0.1",
                '<material density="600"/><length>0.01</length><outerradius>auto</outerradius>',
            ),
            600 * math.pi * 0.038**2 * 0.01,
            0.3 + 0.1 + 0.005,
        ),
        (  # a ring around the inner tube, twice
            inner(
                "innertube",
                "bottom 0",
                "<length>0.3</length><outerradius>0.02</outerradius><thickness>0.001</thickness>",
            )
            + inner(
                "centeringring",
                "bottom -0.2",
                "<instancecount>2</instancecount><instanceseparation>0.2</instanceseparation>"
                '<material density="600"/><length>0.005</length>'
                "<outerradius>auto</outerradius><innerradius>auto</innerradius>",
            ),
            2 * 600 * math.pi * (0.038**2 - 0.02**2) * 0.005,
            1.1 - 0.2 - 0.0025 + 0.1,
        ),
        (
            inner(
                "parachute",
                "absolute 0.5",
                "<packedlength>0.1</packedlength><material density='0.067'/>"
                "<diameter>1.2</diameter><linecount>6</linecount><linelength>0.8</linelength>"
                "<linematerial density='0.002'/><deployevent>apogee</deployevent>",
            ),
            0.067 * math.pi / 4 * 1.44 + 6 * 0.8 * 0.002,
            0.55,
        ),
        (  # the designer's mass and centre in place of the computed ones
            inner(
                "masscomponent",
                "middle 0",
                "<mass>5</mass><packedlength>0.2</packedlength>"
                "<overridemass>0.7</overridemass><overridecg>0.05</overridecg>",
            ),
            0.7,
            0.3 + 0.4 - 0.1 + 0.05,
        ),
    ],
)
def test_inner_parts_have_their_mass_at_their_place(
    tmp_path: Path, part: str, mass: float, station: float
) -> None:
    bare, full = read(tmp_path, design()).airframe, read(tmp_path, design(part)).airframe
    assert full.mass - bare.mass == pytest.approx(mass, rel=1e-9)
    moment = full.mass * full.station - bare.mass * bare.station
    assert moment / mass == pytest.approx(station, rel=1e-6)


def test_an_override_of_the_whole_keeps_the_centre_and_one_of_a_part_its_parts(
    tmp_path: Path,
) -> None:
    bare = read(tmp_path, design()).airframe
    whole = read(tmp_path, design(rocket="<overridemass>4</overridemass>")).airframe
    assert (whole.mass, whole.station) == pytest.approx((4.0, bare.station), rel=1e-9)
    moved = read(tmp_path, design(rocket="<overridecg>0.56</overridecg>")).airframe
    assert (moved.mass, moved.station) == pytest.approx((bare.mass, 0.56), rel=1e-9)
    nose = read(tmp_path, design(nose="<overridemass>1</overridemass>")).airframe
    cone = 500 * math.pi * CONE[1] ** 2 * CONE[0] / 3
    assert nose.mass == pytest.approx(bare.mass - cone + 1, rel=1e-5)


def test_import_writes_a_description_that_flies_and_the_figures_beside_openrockets(
    tmp_path: Path,
) -> None:
    mount = (
        "<motormount><overhang>0.02</overhang><motor configid='a'><manufacturer>Own</manufacturer>"
        "<designation>K1</designation><diameter>0.054</diameter><length>0.4</length></motor>"
        "</motormount>"
    )
    lugs = (
        '<launchlug><name>L</name><position type="top">{}</position><length>0</length></launchlug>'
    )
    chute = (
        "<parachute><name>P</name><diameter>0.6</diameter><cd>auto</cd><deployaltitude>150"
        "</deployaltitude><deployevent>altitude</deployevent></parachute>"
        "<streamer><name>Late</name><deployevent>never</deployevent></streamer>"
    )
    ork = packed(
        tmp_path / "own.ork", design(lugs.format(0.2) + lugs.format(0.7) + chute, tube=mount)
    )
    (tmp_path / "k.eng").write_text("K1 54 400 P 0.52 1.1 own\n0.05 250\n3.95 250\n4.05 0\n")
    out = tmp_path / "own.toml"
    result = vehicle(Settings("import", ork, motor=tmp_path / "k.eng", out=out))
    assert (result.stored_mass, result.stored_centre_of_pressure) == pytest.approx((3.0, 0.75))
    assert result.motor == "Own K1, 54 mm x 400 mm"
    assert result.left_out == ("streamer 'Late': opens at 'never', not in this description",)
    read_back = described(out)
    assert read_back.rail_buttons == pytest.approx((0.5, 1.0))
    assert read_back.motor.overhang == pytest.approx(0.02)
    assert (read_back.launch.rail, read_back.launch.altitude) == (1.5, 120.0)
    assert (read_back.launch.elevation, read_back.launch.azimuth) == pytest.approx(
        (math.radians(85), 0.0)
    )
    assert read_back.parachutes[0].height == 150
    shown = vehicle(Settings("show", out))
    assert shown.states[-1].mass + 0.52 == pytest.approx(shown.states[0].mass)
    assert shown.states[0].mass == pytest.approx(result.mass + 1.1, rel=1e-6)


@pytest.mark.parametrize(
    ("motor", "bore", "says"),
    [
        (29.0, 29.0, ""),
        (29.2, 29.2, ""),  # less than 1 % wider
        (30.0, 30.0, "flown as if the bore fitted"),
        (54.0, 29.0, "54 mm wide, its bore 29 mm: no such motor goes in; give a --motor FILE.eng"),
    ],
)
def test_a_motor_wider_than_its_mount_is_a_warning_with_what_to_do(
    tmp_path: Path, motor: float, bore: float, says: str
) -> None:
    """A mount of 29 mm inside and 31 mm outside."""
    mount = (
        "<innertube><name>M</name><length>0.2</length><outerradius>0.0155</outerradius>"
        '<thickness>0.001</thickness><motormount><motor configid="a"><manufacturer>A</manufacturer>'
        f"<designation>X1</designation><diameter>{motor / 1e3}</diameter><length>0.1</length>"
        "</motor></motormount></innertube>"
    )
    found = read(tmp_path, design(mount))
    assert found.design.motor.diameter == pytest.approx(bore / 1e3)
    assert len(found.warnings) == bool(says)
    assert says in "".join(found.warnings)
    assert not any("bore" in text for text in found.left_out)
    if motor == 54.0:
        wide = FLIGHTS / "bella_lui.eng"
        with pytest.raises(TwinError, match="54 mm wide; its mount takes 29 mm: give a --motor"):
            load(ModelConfig(vehicle=tmp_path / "r.ork", motor=wide))


def test_a_design_flown_as_it_is_equals_its_written_description(tmp_path: Path) -> None:
    mount = "<motormount></motormount>"
    streamer = "<streamer><name>Late</name><deployevent>never</deployevent></streamer>"
    ork = packed(tmp_path / "own.ork", design(streamer, tube=mount))
    engine, out = tmp_path / "k.eng", tmp_path / "own.toml"
    engine.write_text("K1 54 400 P 0.52 1.1 own\n0.05 250\n3.95 250\n4.05 0\n")
    vehicle(Settings("import", ork, motor=engine, out=out))
    flown = load(ModelConfig(vehicle=ork, motor=engine))
    assert flown.sha256 == load(ModelConfig(vehicle=out)).sha256
    assert flown.notes[0] == "left out: streamer 'Late': opens at 'never', not in this description"
    with pytest.raises(TwinError, match=r"own\.ork: its motor \(none\).*--motor FILE\.eng"):
        load(ModelConfig(vehicle=ork))
    pods = packed(tmp_path / "pods.ork", design("<podset><name>Pods</name></podset>"))
    with pytest.raises(TwinError, match=r"pods\.ork: podset 'Pods'"):
        load(ModelConfig(vehicle=pods, motor=engine))
    run = Fly(vehicle=ork, motor=engine)
    with restored(Recording({"files": files_of(run)}, {}), run, ork, force=False) as again:
        assert again.vehicle is not None
        assert again.vehicle.read_bytes() == ork.read_bytes()


def test_a_rail_that_turns_into_the_wind_points_where_the_wind_comes_from(tmp_path: Path) -> None:
    text = design().replace(
        "<launchaltitude>",
        "<launchintowind>true</launchintowind><windaverage>3</windaverage>"
        "<winddirection>1.25</winddirection><launchaltitude>",
    )
    found = read(tmp_path, text)  # OpenRocket: from north over east [rad]
    assert found.design.launch.azimuth == pytest.approx(math.pi / 2 - 1.25)
    to = math.atan2(-math.cos(1.25), -math.sin(1.25))  # where it blows to, from east to north
    advice = f"--set wind_speed=3 --set wind_azimuth={to:.4g} adds it"
    assert found.left_out == (f"the wind of its simulations: {advice}",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (design("<podset><name>Pods</name></podset>"), "podset 'Pods': a part of kind podset"),
        (design("<tubefinset><name>R</name></tubefinset>"), "tubefinset 'R'"),
        (design().replace("</stage>", "</stage><stage><name>B</name></stage>"), "has 2 stages"),
        (design().replace("<fincount>3", "<fincount>2"), "trapezoidfinset 'F': 2 fins"),
        (design().replace(f"<length>{TUBE[0]}", "<length>1e999"), "bodytube 'T': length = '1e999'"),
        (design().replace(f"<length>{TUBE[0]}", "<length>-1"), "bodytube 'T': length = -1"),
        (design().replace("conical", "spiral"), "nosecone 'N': shape 'spiral' is not known"),
        (design(free(0, 0, 0, 0, 0, 0)), "freeformfinset 'X': its plan form has no area"),
        (design(free(0, 0, 0.1, 0, 0.1, 0)), "freeformfinset 'X': its plan form has no area"),
        (
            design().replace("trapezoid", "elliptical").replace(f"<height>{FIN[2]}", "<height>0"),
            "ellipticalfinset 'F': its plan form has no area",
        ),
        (design("<fin><name>X</name></fin>"), "fin 'X': a part of kind fin cannot be imported"),
        ("<openrocket/>", "not an OpenRocket design"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><openrocket><rocket/></openrocket>", "document type"),
        ("<openrocket><rocket>", "not well-formed"),
    ],
)
def test_what_cannot_be_imported_is_refused_by_its_name(
    tmp_path: Path, text: str, message: str
) -> None:
    ork = packed(tmp_path / "r.ork", text)
    with pytest.raises(TwinError) as refused:
        vehicle(Settings("import", ork, out=tmp_path / "r.toml"))
    assert message in str(refused.value)
    assert str(ork) in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "r.toml").exists()


def test_a_parachute_opens_as_the_default_configuration_says(tmp_path: Path) -> None:
    own = '<deploymentconfiguration configid="{}"><deployevent>{}</deployevent>{}'
    own += "</deploymentconfiguration>"
    chute = "<parachute><name>P</name><diameter>0.6</diameter><deployevent>never</deployevent>"
    chute += own.format("b", "apogee", "")
    chute += own.format("a", "altitude", "<deployaltitude>90</deployaltitude>") + "</parachute>"
    found = read(tmp_path, design(chute))
    assert [c.height for c in found.design.parachutes] == [90.0]
    assert found.left_out == ()


def test_stored_figures_of_zero_are_shown_without_a_share(tmp_path: Path) -> None:
    text = design()
    for stored, zero in ((",3.1,", ",0.1,"), (",3.06,", ",0.06,"), (",3.05,", ",0.05,")):
        text = text.replace(stored, zero)
    ork = packed(tmp_path / "r.ork", text.replace(",0.75<", ",0<"))
    rows = dict(vehicle(Settings("import", ork, out=tmp_path / "r.toml")).rows())
    assert rows["mass, no motor"].endswith("OpenRocket 0 kg")
    assert rows["centre of pressure"].endswith("OpenRocket 0 m")


def test_simulations_of_an_earlier_design_are_compared_only_where_no_current_one_is(
    tmp_path: Path,
) -> None:
    run = SIMULATION.split("<simulations>")[1].split("</simulations>")[0]
    old = run.replace("<simulation>", '<simulation status="outdated">')
    old = old.replace("3.05,0.05,0.75", "3.65,0.05,0.5")
    for runs, found, note in ((old + run, "3 kg", False), (old, "3.2 kg", True)):
        ork = packed(tmp_path / "r.ork", design().replace(run, runs))
        rows = dict(vehicle(Settings("import", ork, out=tmp_path / "r.toml", force=True)).rows())
        assert f"OpenRocket {found}: " in rows["mass, no motor"]
        assert rows["mass, no motor"].endswith("before the design's last change") is note


def test_an_archive_that_expands_without_end_is_read_up_to_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(container, "LARGEST_XML", 100_000)
    with pytest.raises(TwinError, match="larger than 100000 bytes"):
        openrocket.document(packed(tmp_path / "bomb.ork", b" " * 3_000_000))
    (tmp_path / "bomb.ork").write_bytes(gzip.compress(b" " * 3_000_000))
    with pytest.raises(TwinError, match="larger than 100000 bytes"):
        openrocket.document(tmp_path / "bomb.ork")


@pytest.mark.parametrize("kind", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_entry_that_zipfile_expands_without_bound_is_refused(tmp_path: Path, kind: int) -> None:
    ork = tmp_path / "bomb.ork"
    with zipfile.ZipFile(ork, "w", kind) as archive:
        archive.writestr("rocket.ork", design())
    with pytest.raises(TwinError, match=r"bomb\.ork: .* must be stored or deflated"):
        openrocket.document(ork)


def test_damaged_archives_and_plain_documents(tmp_path: Path) -> None:
    whole = packed(tmp_path / "r.ork", design()).read_bytes()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("image.png", b"x")
    for data in (whole[:300], b"PK\x03\x04", buffer.getvalue(), gzip.compress(b"x" * 999)[:20]):
        (tmp_path / "r.ork").write_bytes(data)
        with pytest.raises(TwinError, match=r"r\.ork: a damaged archive"):
            openrocket.document(tmp_path / "r.ork")
    for data in (design().encode(), gzip.compress(design().encode())):
        (tmp_path / "r.ork").write_bytes(data)
        assert openrocket.document(tmp_path / "r.ork").tag == "openrocket"
