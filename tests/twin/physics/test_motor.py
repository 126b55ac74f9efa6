"""Motor files, hostile ones too, and the propellant that burns away."""

import re
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from tests.data.generate import BURN, FOLDER, IMPULSE, PEAK
from twin.errors import TwinError
from twin.physics.motor import Depletion, Motor, MotorError, apply_motor, load, parse, read
from twin.physics.motor.curve import impulse_at
from twin.physics.motor.grain import Grain

MJCF = Path(__file__).resolve().parents[3] / "mjcf"
HEADER = "X1 29 124 4-6 0.06 0.12 Acme\n"
GOOD = "; a comment\n" + HEADER + " 0.1 10 ; a bend\n 1.0 10\n 1.1 0\n"


@pytest.fixture
def flight() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MJCF / "flight.xml"))


def test_a_small_file_reads_as_it_says() -> None:
    (motor,) = parse(GOOD)
    np.testing.assert_array_equal(motor.time, [0, 0.1, 1.0, 1.1])
    np.testing.assert_array_equal(motor.thrust, [0, 10, 10, 0])
    assert motor.impulse == pytest.approx(0.5 + 9 + 0.5)
    figures = motor.diameter, motor.length, motor.propellant_mass, motor.loaded_mass
    assert figures == pytest.approx((0.029, 0.124, 0.06, 0.12))


def test_a_measured_curve_has_the_impulse_of_its_half_sine() -> None:
    motor = load(FOLDER / "sine.eng")
    # 32 chords of half a period lie below it by (π/32)²/12
    assert motor.impulse == pytest.approx(IMPULSE * (1 - (np.pi / 32) ** 2 / 12), rel=1e-4)
    assert (motor.time[-1], motor.thrust.max()) == pytest.approx((BURN, PEAK))


def test_several_motors_in_a_file_are_chosen_by_name(tmp_path: Path) -> None:
    file = tmp_path / "two.eng"
    file.write_text(GOOD + GOOD.replace("X1", "Y2"))
    assert [motor.name for motor in read(file)] == ["X1", "Y2"]
    assert load(file, "Y2").name == "Y2"
    for name, says in (
        (None, "2 motors: X1, Y2; give one by its name as .*two.eng:X1, or a file with one"),
        ("Z", "no motor 'Z'; the file holds X1, Y2"),
    ):
        with pytest.raises(MotorError, match=says):
            load(file, name)


@pytest.mark.parametrize(
    ("name", "says"), [(None, "2 motors: X1, X1"), ("X1", "2 motors called 'X1'")]
)
def test_two_motors_of_one_name_are_refused(tmp_path: Path, name: str | None, says: str) -> None:
    file = tmp_path / "two.eng"
    file.write_text(GOOD + GOOD.replace(" 10", " 20"))
    with pytest.raises(MotorError, match=f"{says}.*a file with one"):
        load(file, name)


@pytest.mark.parametrize(
    ("time", "thrust", "says"),
    [
        ([0, 1, 2], [0, 5, 5], "never ends"),
        ([0, 1], [5, 0], "needs 3"),
        ([0, 1, 2], [5, 0], "needs 3"),
        ([0, 1, 2], [0, 0, 0], "no thrust"),
        ([0, 1, np.nan], [0, 5, 0], "not finite"),
        ([1, 2, 3], [0, 5, 0], "increase"),
    ],
)
def test_a_motor_made_in_code_is_checked_like_a_file(
    time: list[float], thrust: list[float], says: str
) -> None:
    with pytest.raises(MotorError, match=says):
        Motor("mine", np.array(time), np.array(thrust), 0.1, 0.2, 0.029, 0.1)


def test_curves_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        parse(GOOD)[0].thrust[0] = 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no motor"),
        ("; only a comment\n", "no motor"),
        ("X1 29 124\n", "header line has 7 words"),
        ("<html><body>not found</body></html> a b c d e f\n", "not a number"),
        (HEADER, "never ends"),
        (HEADER + "0.1 10\n1.0 10\n", "never ends.*10 N at 1 s"),
        (HEADER + "0.1 10\n0.5 -3\n1 0\n", "-3 N is negative"),
        (HEADER + "0.5 10\n0.4 9\n1 0\n", "time 0.4 s follows 0.5 s"),
        (HEADER + "0.5 10\n0.5 9\n1 0\n", "time 0.5 s follows 0.5 s"),
        (HEADER + "-0.5 10\n0.5 9\n1 0\n", "curve starts at -0.5 s"),
        (HEADER + "0.1 nan\n1 0\n", "line 2: nan is not finite"),
        (HEADER + "0.1 1e999\n1 0\n", "not finite"),
        (HEADER + "0.1 10 3\n1 0\n", "found 3 words"),
        (HEADER + "0.1 ten\n1 0\n", "'ten' is not a number"),
        (HEADER + "0.1 1e9\n1 0\n", "at most 100000 N"),
        (HEADER + "0.1 10\n1e6 0\n", "is no motor"),
        (HEADER.replace("0.06", "0.2") + "0.1 10\n1 0\n", "loaded mass includes"),
        (HEADER.replace("0.06", "-1") + "0.1 10\n1 0\n", "must be positive"),
        (HEADER.replace(" 29 ", " 0 ") + "0.1 10\n1 0\n", "diameter 0 m"),
        (HEADER + "0.1 10\n" + "".join(f"{k} 5\n" for k in range(1, 20_002)), "more than 20000"),
        (GOOD + "1.2 5\n", "never ends.*5 N at 1.2 s"),
        (GOOD + "Y2 29 124\n", "line 6: a header line has 7 words"),
        (GOOD.replace("0.06 0.12", "60 120"), "specific impulse of 0.017 s.*grams"),
        (GOOD.replace("0.06 0.12", "6e-5 1.2e-4"), r"impulse of 1.7e\+04 s.*kilograms"),
        (GOOD.replace("0.12 ", "120 "), "8.* to 8000 kg/m³"),
        (GOOD.replace("29 124", "0.029 0.124"), "kg/m³; at most 2500"),
        (GOOD.replace("29 124", "290 1240"), "50 to 8000 kg/m³"),
        ("\x00\x01\x02 junk", "zero bytes"),
    ],
)
def test_a_hostile_file_is_refused_in_one_line_that_says_why(text: str, says: str) -> None:
    with pytest.raises(MotorError, match=says) as caught:
        parse(text, "bad.eng")
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 300
    assert "bad.eng" in message
    assert isinstance(caught.value, TwinError)


def test_unreadable_and_oversized_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MotorError, match="cannot read motor"):
        read(tmp_path / "none.eng")
    with pytest.raises(MotorError, match="cannot read motor"):
        read(tmp_path)
    huge = tmp_path / "huge.eng"
    with huge.open("wb") as file:
        file.truncate(5_000_000)
    with pytest.raises(MotorError, match="larger than"):
        read(huge)


@settings(max_examples=25, deadline=None)
@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda b: b.decode("latin-1")))
def test_no_text_gets_past_the_parser_but_as_a_motor_or_an_error(text: str) -> None:
    for candidate in (text, HEADER + text, HEADER + "0.1 10\n" + text):
        try:
            motors = parse(candidate)
        except MotorError:
            continue
        for motor in motors:
            assert motor.thrust[-1] == 0
            assert 0 < motor.impulse < np.inf


# The header's figure is the maker's; the curve is somebody's reading of a plot. The two differ by
# 5 % for the G25W, whose tail (4.4 to 5.3 s) the file leaves out, and by 2 % at most for the rest.
@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("AeroTech_G12ST", 0.02),
        ("AeroTech_G25W", 0.05),
        ("AeroTech_H13ST", 0.02),
        ("Estes_F15", 0.001),
    ],
)
def test_impulse_of_a_real_curve_is_that_of_its_header(
    shared_data: Path, name: str, tolerance: float
) -> None:
    file = shared_data / "motors" / f"{name}.eng"
    stated = re.search(r"total impulse ([\d.]+)", file.read_text())
    assert stated
    assert load(file).impulse == pytest.approx(float(stated[1]), rel=tolerance)


def test_reference_motor_is_the_one_in_the_vehicle(flight: mujoco.MjModel) -> None:
    motor = load(MJCF / "motors" / "reference.eng")
    before = flight.numeric_data.copy()
    masses, inertias = flight.body_mass.copy(), flight.body_inertia.copy()
    apply_motor(flight, motor)
    # the model states five digits, and the grain's length follows from its density
    np.testing.assert_allclose(flight.numeric_data, before, rtol=2e-3)
    np.testing.assert_allclose(flight.body_mass, masses, rtol=1e-9)
    np.testing.assert_allclose(flight.body_inertia, inertias, rtol=2e-3, atol=1e-12)


def test_reference_motor_has_the_figures_of_the_real_one(shared_data: Path) -> None:
    ours = load(MJCF / "motors" / "reference.eng")
    real = load(shared_data / "motors" / "AeroTech_H13ST.eng")
    assert ours.impulse == pytest.approx(real.impulse, rel=3e-3)
    t = np.linspace(0, 15.4, 500)
    assert np.sqrt(np.mean((thrust_at(ours, t) - thrust_at(real, t)) ** 2)) < 0.1  # N of 14


def thrust_at(motor: Motor, t: np.ndarray | float) -> np.ndarray:
    return np.interp(t, motor.time, motor.thrust, left=0.0, right=0.0)


def delivered(motor: Motor, t: float) -> float:
    """Impulse up to a time after ignition by quadrature [N s]."""
    end = min(max(t, 0.0), motor.burn_time)
    kinks = [k for k in motor.time.tolist() if 0.0 < k < end]
    return float(
        sum(quad(lambda s: float(thrust_at(motor, s)), *p)[0] for p in pairwise([0.0, *kinks, end]))
    )


def test_impulse_delivered_is_that_of_quadrature() -> None:
    (motor,) = parse(GOOD)
    for t in (-1.0, 0.0, 0.05, 0.63, 1.05, 1.1, 9.0):
        impulse = impulse_at(motor.time, motor.thrust, np.asarray(t))
        assert impulse == pytest.approx(delivered(motor, t), abs=1e-9)


def test_a_thinned_curve_keeps_impulse_end_and_shape() -> None:
    t = np.linspace(0, 3, 500)
    motor = Motor("fine", t, np.sin(np.pi * t / 3) * 20 * (t < 3), 0.05, 0.1, 0.029, 0.1)
    thin = motor.simplified(64)
    assert thin.time.size == 64
    assert thin.impulse == pytest.approx(motor.impulse, rel=1e-12)
    assert thin.burn_time == motor.burn_time
    assert np.abs(thrust_at(thin, t) - thrust_at(motor, t)).max() < 0.05  # of 20 N


@pytest.mark.parametrize("name", ["AeroTech_G12ST", "AeroTech_G25W", "Estes_F15"])
def test_a_motor_fits_the_same_before_and_after_compiling(shared_data: Path, name: str) -> None:
    motor = load(shared_data / "motors" / f"{name}.eng")
    spec = mujoco.MjSpec.from_file(str(MJCF / "flight.xml"))
    apply_motor(spec, motor)
    before, after = spec.compile(), mujoco.MjModel.from_xml_path(str(MJCF / "flight.xml"))
    apply_motor(after, motor)
    for field in ("body_mass", "body_inertia", "body_subtreemass", "numeric_data", "site_pos"):
        np.testing.assert_allclose(
            getattr(before, field), getattr(after, field), rtol=1e-6, atol=1e-12, err_msg=field
        )
    total = after.body_mass[after.body("gimbal_motor").id]
    total += after.body_mass[after.body("gimbal_propellant").id]
    assert total == pytest.approx(motor.loaded_mass)
    assert after.numeric("motor_impulse").data[0] == pytest.approx(motor.impulse)
    # forward end stays at +36 mm, so the nozzle is the motor's length below it
    assert after.site("gimbal_nozzle").pos[2] == pytest.approx(0.036 - motor.length, abs=1e-6)


def test_a_motor_too_wide_for_the_holder_is_refused(flight: mujoco.MjModel) -> None:
    (motor,) = parse(GOOD.replace(" 29 ", " 38 "))
    with pytest.raises(MotorError, match="38 mm wide; the holder takes 29 mm"):
        apply_motor(flight, motor)


def test_a_vehicle_without_motor_is_refused() -> None:
    with pytest.raises(TwinError, match="no numeric 'motor_time'"):
        apply_motor(mujoco.MjModel.from_xml_string("<mujoco/>"), parse(GOOD)[0])


@pytest.mark.parametrize("burn", ["core", "end"])
@pytest.mark.parametrize("burnt", [0.0, 0.3, 0.9])
def test_inertia_of_the_remaining_grain_by_quadrature(burn: str, burnt: float) -> None:
    (motor,) = parse(GOOD)
    grain = Grain.of(motor, "end" if burn == "end" else "core")
    mass, ahead, transverse, axial = grain.remaining(burnt)
    assert mass == pytest.approx(0.06 * (1 - burnt))
    if burn == "end":
        low, high, bore = grain.length * (burnt - 0.5), grain.length / 2, 0.0
    else:
        low, high = -grain.length / 2, grain.length / 2
        bore = grain.radius * np.sqrt(1 - (1 - 0.35**2) * (1 - burnt))
    density = mass / (np.pi * (grain.radius**2 - bore**2) * (high - low))
    assert density == pytest.approx(1700)  # kg/m³, of composite propellant
    polar = quad(lambda r: 2 * np.pi * r**3, bore, grain.radius)[0] * (high - low) * density
    assert axial == pytest.approx(polar)
    area = np.pi * (grain.radius**2 - bore**2)
    along = quad(lambda z: density * area * (z - ahead) ** 2, low, high)[0]
    assert transverse == pytest.approx(polar / 2 + along)
    assert ahead == pytest.approx((low + high) / 2)


def test_depletion_conserves_mass_and_moves_the_centre_as_the_books_say(
    flight: mujoco.MjModel,
) -> None:
    depletion, data = Depletion(flight), mujoco.MjData(flight)
    vehicle = flight.body("vehicle").id
    dry = flight.body_mass.sum() - 0.1164
    for t in (0.0, 0.4, 5.0, 12.0, 20.0, 3.0):  # back in time too: a reset
        depletion.update(t)
        left = 0.1164 * (1 - depletion.burnt(t))
        assert flight.body_mass.sum() == pytest.approx(dry + max(left, 1e-6), rel=1e-12)
        children = [
            flight.body_mass[np.array([_above(flight, b, k) for b in range(flight.nbody)])].sum()
            for k in range(flight.nbody)
        ]
        np.testing.assert_allclose(flight.body_subtreemass, children, rtol=1e-9)  # of 1 mg left
        mujoco.mj_forward(flight, data)
        bodies = [b for b in range(flight.nbody) if _above(flight, b, vehicle)]
        weights = flight.body_mass[bodies]
        centre = weights @ data.xipos[bodies] / weights.sum()
        np.testing.assert_allclose(data.subtree_com[vehicle], centre, atol=1e-12)


def _above(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    while body not in (0, ancestor):
        body = model.body_parentid[body]
    return body == ancestor


def test_depletion_reaches_the_mass_matrix(flight: mujoco.MjModel) -> None:
    """A gram less in a body whose centre was its origin must be felt: MuJoCo takes short cuts."""
    data = mujoco.MjData(flight)
    totals = []
    for t in (0.0, 99.0):
        Depletion(flight).update(t)
        mujoco.mj_forward(flight, data)
        full = np.zeros((flight.nv, flight.nv))
        mujoco.mj_fullM(flight, data, full)
        totals.append(full[0, 0])
    assert totals[0] - totals[1] == pytest.approx(0.1164, abs=2e-6)


@pytest.mark.parametrize("t", [6.0, 99.0])
def test_inertia_in_the_mass_matrix_is_that_of_the_cylinder_that_is_left(
    flight: mujoco.MjModel, t: float
) -> None:
    """Rotational rows, about the vehicle's origin: m (3R² + l²)/12 + m z², and m R²/2."""
    data, depletion = mujoco.MjData(flight), Depletion(flight)
    numbers = {n: float(flight.numeric(f"motor_grain_{n}").data[0]) for n in ("length", "radius")}
    body = flight.body("gimbal_propellant").id
    height = np.zeros(flight.nbody)
    for k in range(1, flight.nbody):  # of each body's frame above the vehicle's, all joints at 0
        height[k] = height[flight.body_parentid[k]] + flight.body_pos[k][2]
    centre = height[body] - height[flight.body("vehicle").id]

    def matrix(at: float) -> np.ndarray:
        depletion.update(at)
        mujoco.mj_forward(flight, data)
        full = np.zeros((flight.nv, flight.nv))
        mujoco.mj_fullM(flight, data, full)
        return full.diagonal()[3:6]

    def grain(left: float) -> np.ndarray:
        mass, length, radius = 0.1164 * left, numbers["length"] * left, numbers["radius"]
        z = centre + (numbers["length"] - length) / 2  # an end burner's face recedes
        across = mass * (3 * radius**2 + length**2) / 12 + mass * z * z
        return np.array([across, across, mass * radius**2 / 2])

    others = np.arange(flight.nbody) != body
    kept = flight.body_inertia[others].copy()
    change = matrix(t) - matrix(0.0)
    np.testing.assert_array_equal(flight.body_inertia[others], kept)
    left = 1 - depletion.burnt(t)
    # a milligram is left of an empty motor
    np.testing.assert_allclose(change, grain(left) - grain(1.0), rtol=1e-3, atol=1e-9)


def test_centre_of_the_remaining_grain_is_where_mujoco_puts_it(flight: mujoco.MjModel) -> None:
    """Also where MuJoCo takes the centre for the body's origin, as it was in the file."""
    body = flight.body("gimbal_propellant")
    flight.body_sameframe[body.id] = mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    Depletion(flight).update(8.0)
    data = mujoco.MjData(flight)
    mujoco.mj_forward(flight, data)
    placed = data.body("gimbal_propellant")
    offset = placed.xmat.reshape(3, 3).T @ (placed.xipos - placed.xpos)
    burnt = 1 - body.mass[0] / 0.1164
    # the face of an end burner recedes: the centre moves up by half the length that is gone
    gone = flight.numeric("motor_grain_length").data[0] * burnt
    np.testing.assert_allclose(offset, [0, 0, gone / 2], atol=1e-9)


def test_burnt_fraction_is_that_of_the_motor(flight: mujoco.MjModel) -> None:
    motor = load(MJCF / "motors" / "reference.eng")
    flight.numeric("motor_ignition").data[0] = 2.0
    depletion = Depletion(flight)
    for t in np.linspace(-1, 20, 50):
        gone = delivered(motor, t - 2) / motor.impulse
        assert depletion.burnt(t) == pytest.approx(gone, abs=1e-9)


def test_a_model_without_motor_is_left_alone() -> None:
    part = '<body name="gimbal_propellant"><geom size="1"/></body>'
    time = '<custom><numeric name="motor_time" data="0 1 2"/></custom>'
    for text in ("", f"<worldbody>{part}</worldbody>", f"<worldbody>{part}</worldbody>{time}"):
        model = mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
        before = model.body_mass.copy()
        Depletion(model).update(1.0)
        np.testing.assert_array_equal(model.body_mass, before)
