"""Motor files of three formats: what is read alike, what is refused, and who chooses."""

import codecs
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.errors import TwinError
from twin.physics.motor import MotorError, apply_motor, load, split_name
from twin.physics.motor.files import entries
from twin.plant.model.model import ModelConfig
from twin.plant.model.model import load as load_model

MJCF = Path(__file__).resolve().parents[3] / "mjcf"
POINTS = ((0.05, 18.0), (0.4, 24.0), (1.2, 21.0), (1.9, 12.0), (2.2, 0.0))
IMPULSE = 39.15  # N s, of these points by hand: 0.45 + 7.35 + 18 + 11.55 + 1.8
HEADER = "Q20 29 124 P 0.060 0.125 Home\n"
CURVE = "".join(f"{t} {f}\n" for t, f in POINTS)
ENG = HEADER + CURVE
DATA = "".join(f'<eng-data t="{t}" f="{f}" m="1" cg="62"/>' for t, f in POINTS)
ENGINE = (
    '<engine mfg="Home" code="{}" dia="29" len="124" initWt="125" propWt="60">'
    "<data>{}</data></engine>"
)


def rse(*engines: str) -> str:
    return f"<engine-database><engine-list>{''.join(engines)}</engine-list></engine-database>"


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


SAME = {
    "plain.eng": ENG,
    "mark.eng": codecs.BOM_UTF8 + b"; stand 2\r\n" + ENG.replace("\n", "\r\n").encode(),
    "mark_first.eng": codecs.BOM_UTF8 + ENG.encode(),
    "wide.eng": codecs.BOM_UTF16_LE + ENG.encode("utf-16-le"),
    "unmarked.eng": ENG.encode("utf-16-le"),
    "carriage.eng": ENG.replace("\n", "\r"),
    "comments.eng": ENG.replace("\n", " ; a comment\n\n;\n"),
    "zeros.eng": ENG + "2.3 0\n2.4 0.0\n\n; end\n2.5 0\n",
    "start.eng": HEADER + "0 0\n" + CURVE,
    "no_line_end.eng": ENG.rstrip(),
    "hash.eng": "# stand 2\n// cold\n" + ENG,
    "decimal_commas.eng": ENG.replace(".", ","),
    "twice.eng": HEADER + "0 0\n0 0\n" + "".join(f"{t} {f}\n{t} {f}\n" for t, f in POINTS),
    "commas.eng": HEADER + CURVE.replace(" ", ", "),
    "old_end.eng": ENG + "\x1a\0\0",
    "rock_in.eng": '<?xml version="1.0"?>\n' + rse(ENGINE.format("Q20", DATA)),
    "rock.rse": rse(ENGINE.format("Q20", DATA)),
    "rock_commas.rse": rse(ENGINE.format("Q20", DATA).replace(".", ",")),
    "rock.xml": '<?xml version="1.0"?>\n' + rse(ENGINE.format("Q20", DATA)),
}


@pytest.mark.parametrize("name", SAME)
def test_one_motor_in_any_dress_is_the_same_motor(tmp_path: Path, name: str) -> None:
    motor = load(written(tmp_path, name, SAME[name]))
    assert motor.name == "Q20"
    np.testing.assert_array_equal(motor.time, [0, *(t for t, _ in POINTS)])
    np.testing.assert_array_equal(motor.thrust, [0, *(f for _, f in POINTS)])
    assert motor.impulse == pytest.approx(IMPULSE, rel=1e-12)
    figures = (motor.propellant_mass, motor.loaded_mass, motor.diameter, motor.length)
    assert figures == pytest.approx((0.060, 0.125, 0.029, 0.124), rel=1e-12)


LIKE = {"propellant_mass": 0.06, "loaded_mass": 0.125, "diameter": 0.029, "length": 0.124}
TABLES = {
    "plain.csv": "0.05,18\n0.4,24\n1.2,21\n1.9,12\n2.2,0\n",
    "heading.csv": "time [s],thrust [N]\n0.05, 18\n0.4, 24\n1.2, 21\n1.9, 12\n2.2, 0\n2.3, 0\n",
    "semicolon.csv": "t;F\r\n0.05;18\r\n0.4;24\r\n1.2;21\r\n1.9;12\r\n2.2;0\r\n",
    "decimal_commas.csv": "t;F\n0,05;18,0\n0,4;24\n1,2;21\n1,9;12\n2,2;0\n",
    "units.csv": "t,F\n[s],[N]\n0.05,18\n0.4,24\n1.2,21\n1.9,12\n2.2,0\n",
    "own_units.csv": "t,F\n0.05 s,18 N\n0.4 s,24 N\n1.2s,21N\n1.9 s,12 N\n2.2 s,0 N\n",
    "quoted.csv": '"t","F"\n"0.05","18"\n"0.4","24"\n"1.2","21"\n"1.9","12"\n"2.2","0"\n',
    "quoted_commas.csv": '"t","F"\n"0,05","18"\n"0,4","24"\n"1,2","21"\n"1,9","12"\n"2,2","0"\n',
    "tab.tsv": "0.05\t18\n0.4\t24\n1.2\t21\n1.9\t12\n2.2\t0\n",
    "blank.txt": "# stand 2\n" + CURVE,
}


@pytest.mark.parametrize("name", TABLES)
def test_a_thrust_table_takes_its_other_figures_from_the_motor_it_replaces(
    tmp_path: Path, name: str
) -> None:
    motor = load(written(tmp_path, name, TABLES[name]), like=LIKE)
    assert motor.impulse == pytest.approx(IMPULSE, rel=1e-12)
    assert motor.figures == LIKE


def test_comment_lines_of_a_thrust_table_give_its_other_figures(tmp_path: Path) -> None:
    head = "# propellant_mass = 50 g\n# loaded_mass: 0.1 kg\n# diameter=1.1 in\n# length = 0.12\n"
    motor = load(written(tmp_path, "own.csv", head + TABLES["plain.csv"]))
    figures = (motor.propellant_mass, motor.loaded_mass, motor.diameter, motor.length)
    assert figures == pytest.approx((0.05, 0.1, 0.02794, 0.12), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (CURVE, "no propellant_mass, loaded_mass, diameter, length; give each as a comment line"),
        ("# length = 12 parsec\n" + CURVE, r"length = '12 parsec' must have one of the units m, "),
        ("# diameter = wide\n" + CURVE, "diameter = 'wide' must be a number in m, or a text"),
    ],
)
def test_a_thrust_table_without_a_figure_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(MotorError, match=says):
        load(written(tmp_path, "bare.csv", text))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0.05,18,3\n", "line 1: has 3 columns; a thrust table has two"),
        ("0.05,18\n0.4,x\n", "line 2: 'x' is not a finite number"),
        ("0.05,18\n0.4,inf\n", "line 2: 'inf' is not a finite number"),
        ("time,thrust\nt,F\n", "line 2: 't' is not"),
        ("t,thrust_lbf\n0.05,18\n", "column 'thrust_lbf' is in lbf; a thrust table has"),
        ("t [ms],F [N]\n50,18\n", r"column '\[ms\]' is in ms"),
        ("", "holds no points"),
        ("0.05,18\n0.4,24\n", "never ends"),
        ("50,18\n400,24\n1200,21\n2200,0\n", r"burns 2200 s.*\(times must be in seconds\)"),
    ],
)
def test_a_table_that_is_no_thrust_curve_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(MotorError, match=says):
        load(written(tmp_path, "bad.csv", text), like=LIKE)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (ENG.encode().replace(b"0.4", b"0\0004"), "holds zero bytes; not a text file"),
        (ENG.replace("29", "29mm", 1), "line 1: '29mm' is not a number; a header reads name diam"),
        (ENG.replace("Q20", "Q 20", 1), "not a number; a header reads .* names without blanks"),
        (HEADER + "0.05s 18N\n" + CURVE, "line 2: '0.05s' is not a number; time is in s and thrus"),
        ("<!DOCTYPE html><html>404</html>", "is a web page; download the file itself"),
        (b"PK\3\4" + bytes(40), "is a ZIP archive"),
        (HEADER + "-0.01 0\n" + CURVE, "curve starts at -0.01 s; times increase from 0"),
    ],
)
def test_a_file_says_what_is_wrong_with_it(tmp_path: Path, text: str | bytes, says: str) -> None:
    with pytest.raises(MotorError, match=says):
        load(written(tmp_path, "bad.eng", text))


BAD_MOTORS = {
    "two points": "B9 38 700 0 0.07 0.84 Home\n0 1917\n0.45 0\n",
    "never ends": HEADER.replace("Q20", "B9") + "0.1 10\n0.5 9\n",
    "no curve": HEADER.replace("Q20", "B9"),
    "short header": "B9 29 124\n0.1 10\n1 0\n",
    "words in the header": "B9 wide long P some more Home\n0.1 10\n1 0\n",
    "words in the curve": HEADER.replace("Q20", "B9") + "0.1 ten\n0.5 0\n",
    "columns in the curve": HEADER.replace("Q20", "B9") + "0.1 10 3\n0.5 0\n",
    "grams": HEADER.replace("Q20", "B9").replace("0.060 0.125", "60 125") + CURVE,
}


@pytest.mark.parametrize("bad", BAD_MOTORS)
@pytest.mark.parametrize("first", [True, False])
def test_one_bad_motor_of_a_file_spoils_no_other(tmp_path: Path, bad: str, first: bool) -> None:
    text = BAD_MOTORS[bad] + ENG if first else ENG + BAD_MOTORS[bad]
    path = written(tmp_path, "several.eng", text)
    assert load(f"{path}:Q20").impulse == pytest.approx(IMPULSE, rel=1e-12)
    with pytest.raises(MotorError, match=r"several.eng(, line \d+)?: ") as caught:
        load(f"{path}:B9")
    assert "\n" not in str(caught.value)
    with pytest.raises(MotorError, match=r"2 motors: .*B9 \(not usable\).*as .*several.eng:Q20"):
        load(path)


def test_one_bad_engine_of_a_rocksim_file_spoils_no_other(tmp_path: Path) -> None:
    bad = ENGINE.format("B9", '<eng-data t="0.05" f="18."/>')
    path = written(tmp_path, "two.rse", rse(bad, ENGINE.format("Q20", DATA)))
    assert load(f"{path}:Q20").impulse == pytest.approx(IMPULSE, rel=1e-12)
    with pytest.raises(MotorError, match="'B9': the thrust curve has 2 points; it needs 3"):
        load(f"{path}:B9")
    with pytest.raises(MotorError, match=r"2 motors: B9 \(not usable\), Q20; give one by its name"):
        load(path)


def test_motors_of_one_name_are_told_apart_by_their_makers(tmp_path: Path) -> None:
    path = written(
        tmp_path, "makers.eng", ENG + ENG.replace("Home", "Away Works").replace("18", "20")
    )
    assert load(f"{path}:Away Works Q20").thrust[1] == 20
    with pytest.raises(MotorError, match="2 motors called 'Q20': Home Q20, Away Works Q20"):
        load(f"{path}:Q20")


def test_a_colon_in_a_file_name_is_part_of_the_name(tmp_path: Path) -> None:
    path = written(tmp_path, "odd:name.eng", ENG)
    assert load(path).name == "Q20"
    assert split_name(path) == (path, None)
    assert split_name(f"{path}:Q20") == (path, "Q20")
    with pytest.raises(MotorError, match=r"cannot read motor .*missing.eng:Q20: No such file"):
        load(tmp_path / "missing.eng:Q20")


LAUGHS = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<engine-database/>", "holds no motor; a RockSim file has elements <engine>"),
        ("<engine-database>", "not well-formed XML"),
        (f'<!DOCTYPE x [<!ENTITY a0 "x">{LAUGHS}]><x>&a11;</x>', "document type or entities"),
        ('<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>', "document type or entities"),
        ("<x>" * 70 + "</x>" * 70, "nested more than 64 deep"),
        ("<x>&undefined;</x>", "not well-formed"),
        ('<?xml version="1.0" encoding="no-such"?><x/>', "not well-formed"),
        (rse(ENGINE.format("Q20", "")), "has 0 <eng-data> elements"),
        (rse(ENGINE.format("Q20", DATA).replace(' dia="29"', "")), "has no attribute 'dia'"),
        (rse(ENGINE.format("Q20", DATA).replace('"29"', '"wide"')), "dia='wide' is not a number"),
        (rse(ENGINE.format("Q20", DATA).replace('"29"', '"' + "x" * 41 + '"')),
         f"dia='{'x' * 37}[.][.][.]' is not"),
        (rse(ENGINE.format("Q20", DATA.replace('"24.0"', '"nan"'))), "f=nan is not finite"),
        (rse(ENGINE.format("Q20", DATA).replace('"125"', '".125"').replace('"60"', '".06"')),
         "kilograms"),
    ],
)  # fmt: skip
def test_a_hostile_rocksim_file_is_refused_in_one_line(
    tmp_path: Path, text: str, says: str
) -> None:
    with pytest.raises(MotorError, match=says) as caught:
        load(written(tmp_path, "bad.rse", text))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(tmp_path))
    assert isinstance(caught.value, TwinError)


SOUP = st.sampled_from(["<engine", " code='A'", ">", "</engine>", "<eng-data t='1' f='2'/>", "&a;"])
LINES = st.sampled_from([HEADER, *CURVE.splitlines(True), "1 0\n", "; c\n", "x\n", "1e999 -1\n"])
CONTENT = st.one_of(
    st.binary(max_size=120),
    st.lists(SOUP | st.text(max_size=5), max_size=15).map(lambda s: "".join(s).encode()),
    st.lists(LINES, max_size=25).map(lambda s: "".join(s).encode()),
)


@settings(max_examples=30, deadline=None)
@given(content=CONTENT, ending=st.sampled_from(["eng", "rse", "csv"]))
def test_any_bytes_are_motors_that_can_fly_or_one_line_that_says_why(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, ending: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"any.{ending}"
    path.write_bytes(content)
    try:
        found = entries(path, LIKE)
    except MotorError as error:
        found, message = [], str(error)
    else:
        message = "".join(entry.fault for entry in found)
    assert "\n" not in message
    for entry in found:
        assert (entry.motor is None) == bool(entry.fault)
        if entry.motor is not None:
            assert entry.motor.thrust[-1] == 0
            assert 0 < entry.motor.impulse < np.inf
            assert (np.diff(entry.motor.time) > 0).all()


curves = st.lists(
    st.tuples(st.floats(1e-3, 1.0), st.floats(1.0, 300.0)), min_size=2, max_size=30
).map(lambda points: [(sum(s for s, _ in points[: k + 1]), f) for k, (_, f) in enumerate(points)])


@settings(max_examples=25, deadline=None)
@given(curves, st.floats(20.0, 400.0))
def test_a_curve_is_the_same_in_every_format(
    tmp_path_factory: pytest.TempPathFactory, points: list[tuple[float, float]], isp: float
) -> None:
    points = [*points, (points[-1][0] + 0.1, 0.0)]
    t, f = (np.array([0.0, *column]) for column in zip(*points, strict=True))
    propellant = float(np.trapezoid(f, t)) / (isp * 9.80665)
    # a casing half full of propellant of 1500 kg/m³, 100 mm wide
    length = 2 * propellant / 1500 / (np.pi / 4 * 0.1**2)
    loaded = 2 * propellant
    folder = tmp_path_factory.getbasetemp()
    lines = "".join(f"{x!r} {y!r}\n" for x, y in points)
    eng = f"N 100 {length * 1e3!r} P {propellant!r} {loaded!r} M\n{lines}"
    data = "".join(f'<eng-data t="{x!r}" f="{y!r}"/>' for x, y in points)
    head = (
        f'dia="100" len="{length * 1e3!r}" initWt="{loaded * 1e3!r}" propWt="{propellant * 1e3!r}"'
    )
    rock = rse(f'<engine code="N" {head}><data>{data}</data></engine>')
    table = f"# length = {length!r}\n# propellant_mass = {propellant!r}\n" + lines
    table += f"# diameter = 100 mm\n# loaded_mass = {loaded!r}\n"
    motors = [
        load(written(folder, name, text))
        for name, text in (("a.eng", eng), ("a.rse", rock), ("a.csv", table))
    ]
    for motor in motors:
        np.testing.assert_array_equal(motor.time, t)
        np.testing.assert_array_equal(motor.thrust, f)
        assert motor.figures == pytest.approx(
            {
                "propellant_mass": propellant,
                "loaded_mass": loaded,
                "diameter": 0.1,
                "length": length,
            },
            rel=1e-12,
        )


def test_a_narrower_motor_flies_with_a_word_about_its_adapter(tmp_path: Path) -> None:
    path = written(tmp_path, "thin.eng", ENG.replace(" 29 ", " 24 "))
    model = load_model(ModelConfig(motor=path))
    assert model.notes == (
        "the motor is 24 mm wide, its mount 29 mm: flown with an adapter that weighs nothing",
    )
    assert load_model(ModelConfig(motor=written(tmp_path, "fits.eng", ENG))).notes == ()


def test_a_thrust_table_given_to_a_vehicle_replaces_only_the_curve(tmp_path: Path) -> None:
    table = "0,0\n0.1,20\n10,20\n10.1,0\n"
    model = load_model(ModelConfig(motor=written(tmp_path, "stand.csv", table))).mj
    own = mujoco.MjModel.from_xml_path(str(MJCF / "flight.xml"))
    for name in ("propellant_mass", "loaded_mass", "length", "diameter"):
        assert model.numeric(f"motor_{name}").data[0] == own.numeric(f"motor_{name}").data[0]
    assert model.numeric("motor_impulse").data[0] == pytest.approx(200.0)
    with pytest.raises(MotorError, match=r"specific impulse of \d\.\d s"):
        apply_motor(own, load(written(tmp_path, "weak.csv", "0,0\n1,2\n2,0\n"), like=LIKE))
