"""The turntable: rotations taken apart, its base found, and flights that see only its gyro."""

from math import degrees, radians
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from analysis.recording import read
from hardware.frames import GimbalCommand, HardwareError, SensorFrame
from hardware.fusion import BaseMap
from hardware.fusion.base import tilt
from hardware.simavr.nano import missing
from tests.twin.cli.test_cli import run as command
from twin.config import Fly
from twin.experiments.flight.fly import fly
from twin.hil import BenchPlant, RigOptions, open_rig
from twin.hil.connect import lead, opened
from twin.hil.gimbal import COMMAND_NS
from twin.hil.turntable import Turntable, _twist, measure_base
from twin.physics import native
from twin.plant.model.model import ModelConfig, load

needs_avr = pytest.mark.skipif(bool(missing()), reason=f"without {', '.join(missing())}")
angles = st.floats(-1.2, 1.2)


def wxyz(rotation):
    x, y, z, w = rotation.as_quat()
    return [w, x, y, z]


@given(
    launch=st.tuples(angles, angles, angles),
    twist=st.floats(-2.5, 2.5),
    swing=st.tuples(angles, angles),
)
def test_a_twist_about_x_is_found_behind_any_swing(launch, twist, swing):
    start = Rotation.from_euler("xyz", launch)
    # a swing's axis lies across x, so that it has no twist of its own
    across = Rotation.from_rotvec([0.0, *swing])
    turned = start * Rotation.from_rotvec([twist, 0, 0]) * across
    found, _ = _twist(wxyz(start), wxyz(turned), [0.0, 0.0, 0.0])
    assert found == pytest.approx(twist, abs=1e-9)


@given(first=st.tuples(angles, angles, angles), rate=st.tuples(angles, angles, angles))
def test_its_rate_is_the_derivative(first, rate):
    start = Rotation.from_euler("xyz", [0.2, -0.4, 0.1])
    now = start * Rotation.from_rotvec(first)
    assume(abs(_twist(wxyz(start), wxyz(now), rate)[0]) < 3.0)
    h = 1e-5
    ahead, behind = (now * Rotation.from_rotvec(np.array(rate) * s) for s in (h, -h))
    told = [_twist(wxyz(start), wxyz(r), rate)[0] for r in (behind, ahead)]
    speed = _twist(wxyz(start), wxyz(now), rate)[1]
    # central differences of second order at 1e-5
    assert speed == pytest.approx((told[1] - told[0]) / (2 * h), abs=1e-6, rel=1e-6)


class TestPlant:
    @pytest.fixture
    def plant(self):
        with native.installed():
            yield BenchPlant(load(ModelConfig(scene="turntable")))

    def test_both_gyros_are_mujocos_own_while_base_and_gimbal_turn(self, plant):
        for k in range(300):
            plant.advance(
                1e-3, (0.2 * np.sin(0.05 * k), 0.15 * np.cos(0.04 * k), 0.3 * np.sin(0.02 * k))
            )
        holder, base = plant.holder_imu()[0], plant.base_imu()[0]
        mujoco.mj_forward(plant.model, plant.data)  # brings MuJoCo's sensors to this instant
        assert abs(plant.turn()[1]) > 0.5
        # the same in other words: rounding of rotation matrices
        np.testing.assert_allclose(holder, plant.data.sensor("gyro").data, atol=1e-9)
        np.testing.assert_allclose(base, plant.data.sensor("base_gyro").data, atol=1e-9)

    def test_gravity_tells_the_turn_at_rest(self, plant):
        for _ in range(1500):
            plant.advance(1e-3, (0.0, 0.0, 0.25))
        # it creeps on for a while; 0.01 m/s² of that is 0.06°
        assert tilt(plant.base_imu()[1]) == pytest.approx(plant.turn()[0], abs=radians(0.1))
        assert plant.turn()[0] == pytest.approx(0.25, abs=radians(1.5))  # friction, dead band


@pytest.mark.measured
@pytest.mark.parametrize("unit", [None, 2, pytest.param(5, marks=pytest.mark.slow)])
def test_the_base_is_found_as_the_rig_was_drawn(unit):
    with native.installed():
        options = RigOptions("emulator", scene="turntable", unit=unit)
        with open_rig(options, None) as seat:
            base = seat.base
            true = seat.rig.line.device.bench
    imu = true.parameters.sensors.imus[1]
    servo = true.parameters.plant.servos[2]
    np.testing.assert_allclose(
        np.degrees(base.gyro_bias), np.degrees(imu.gyro_bias), atol=0.15
    )  # its walk over 4 s is 0.04 °/s, the mean of a look 0.01
    # the mean of two scales of ±3 % each; dead band and friction leave 0.3° of 38°
    assert base.travel == pytest.approx(servo.travel / (1 + true.parameters.skew), rel=0.04)
    imu_scale = imu.gyro_matrix[0][0]
    assert base.gyro_scale * imu_scale == pytest.approx(1.0, abs=0.01 if unit is None else 0.035)
    assert base.tilt_scale * imu.accelerometer_scale[1] == pytest.approx(
        base.gyro_scale * imu_scale, rel=0.015
    )  # the two agree with each other, wherever they stand


def flown(path, gimbal, **more):
    asked = {"attitude": "base-gyro", "scene": "turntable", "duration_s": 15.0, **more}
    return fly(Fly(gimbal=gimbal, out=path, **asked)), read(path)


@pytest.mark.measured
@pytest.mark.parametrize(
    "gimbal", ["emulator", pytest.param("firmware", marks=[needs_avr, pytest.mark.slow])]
)
@pytest.mark.parametrize(
    ("programme", "asked"),
    [
        *(pytest.param(p, {}, marks=pytest.mark.slow) for p in ("hold", "step", "doublet")),
        ("doublet", {"at_s": 1.0, "duration_s": 9.0}),
    ],
)
def test_the_attitude_seen_is_the_vehicles_within_a_degree_and_the_loop_is_stable(
    tmp_path, gimbal, programme, asked
):
    result, run = flown(tmp_path / "a.rrd", gimbal, programme=programme, **asked)
    seen = run["turntable/measured"].values[:, 0] - run["turntable/simulated"].values[:, 0]
    assert degrees(np.sqrt(np.mean(seen**2))) < 1.0  # issue's figure
    assert result.turntable_rms_deg == pytest.approx(degrees(np.sqrt(np.mean(seen**2))))
    # stable: what is left of the error over the last third is small and does not grow
    error = np.degrees(np.linalg.norm(run["control/error"].values, axis=1))
    time = run["control/error"].time
    sixth = time[-1] / 6
    late = [error[(time > k * sixth) & (time <= (k + 1) * sixth)].max() for k in (4, 5)]
    assert max(late) < 3.0
    assert late[1] < late[0] + 0.5


@pytest.mark.thorough
@needs_avr
def test_the_real_firmware_turns_its_base_alike(tmp_path):
    result, run = flown(tmp_path / "a.rrd", "firmware", duration_s=1.5, programme="step", at_s=0.3)
    assert result.turntable_rms_deg < 1.0
    assert np.ptp(run["turntable/measured"].values) > radians(4.0)


@pytest.mark.thorough
def test_the_controller_sees_the_base_and_not_the_vehicle(tmp_path, monkeypatch):
    """Told that the base leans by 3° where it stands upright, the loop holds the vehicle askew."""
    leaning = BaseMap(tilt=-radians(3.0))
    monkeypatch.setattr("twin.hil.connect.measure_base", lambda seat: leaning)
    _, run = flown(tmp_path / "a.rrd", "emulator", duration_s=3.6)
    late = run["turntable/simulated"].time > 2.4
    vehicle = np.degrees(run["turntable/simulated"].values[late, 0]).mean()
    base = np.degrees(run["turntable/measured"].values[late, 0]).mean()
    # gravity's turn and the integral leave a degree, as they do without the lean
    assert base == pytest.approx(0.0, abs=1.2)
    assert base - vehicle == pytest.approx(3.0, abs=0.5)


def test_the_rate_given_to_the_controller_is_that_of_the_base_gyro():
    """About the launch's x axis; about the others the simulated one, which here differ."""
    frame = SensorFrame(
        time_ns=0, device_us=0, potentiometer=(0.5,) * 4, gyro=(0.0,) * 3,
        accelerometer=(0.0,) * 3, base_gyro=(0.5, 0.0, 0.0), base_accelerometer=(0.0, 0.0, -9.8),
        pulse=(1.5e-3,) * 3, switches=(False,) * 4, joystick=(0.0, 0.0), flags=0,
    )  # fmt: skip
    level = np.array([1.0, 0.0, 0.0, 0.0])
    plant = SimpleNamespace(attitude=level, rate=np.array([0.1, -0.2, 0.3]))
    seat = SimpleNamespace(
        rig=SimpleNamespace(turntable_limits=(1e-3, 2e-3)),
        readings=SimpleNamespace(frames=[frame]), turntable=0.0,
    )  # fmt: skip
    attitude = Turntable(plant, seat, BaseMap(), (0.0, 0.0), 4e-3)
    attitude.update()
    np.testing.assert_allclose(attitude.rate, [0.5, -0.2, 0.3], atol=1e-12)


def test_two_flights_of_one_seed_are_equal(tmp_path):
    a, b = (flown(tmp_path / f"{k}.rrd", "emulator", duration_s=0.2)[1] for k in range(2))
    for name in a.series:
        np.testing.assert_array_equal(a[name].values, b[name].values)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("fly --attitude base-gyro", "base-gyro needs a rig"),
        ("fly --gimbal emulator --scene turntable", "needs --attitude base-gyro"),
        ("fly --attitude gyro", "base-gyro"),
    ],
)
def test_what_cannot_be_is_one_line(capsys, tmp_path, monkeypatch, line, told):
    monkeypatch.chdir(tmp_path)
    code, _, err = command(capsys, *line.split())
    assert code == 2
    assert err.count("\n") == 1
    assert told in err


def test_a_turntable_that_does_not_turn_is_told():
    with native.installed():
        seat = opened(RigOptions("emulator", scene="bench"), None)  # nothing on the third pin
        seat.start()
        with pytest.raises(HardwareError, match="pin and power of the turntable servo") as caught:
            measure_base(seat)
        seat.close()
    assert "\n" not in str(caught.value)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("fault", "begin", "told"),
    [
        ("turntable:stuck", 1.3, "the base is at"),
        ("base_gyro:frozen", 1.3, "base IMU frozen"),
        ("base_gyro:bias:60", 2.3, "gyro bias, of holder or base"),  # once gravity is known
    ],
)
def test_a_base_that_lies_or_stands_still_is_named_and_all_servos_go_neutral(
    tmp_path, fault, begin, told
):
    result, run = flown(
        tmp_path / "a.rrd", "emulator", programme="step", at_s=begin - 0.3, amplitude_deg=20.0,
        fault=(f"{fault}@{begin}",), on_fault="neutral", duration_s=begin + 1.4,
    )  # fmt: skip
    assert told in result.fault
    at = next(e.time for e in run.events if e.level == "ERROR")
    pulse = run["sensors/pulse"]
    later = pulse.time > at + 0.1
    # neutral by the device's own clock ticks
    np.testing.assert_allclose(pulse.values[later][:, 2], 1.5e-3, atol=1e-6)


@pytest.mark.thorough
def test_a_vehicle_that_turns_over_does_not_throw_the_base_from_stop_to_stop(tmp_path):
    _, run = flown(
        tmp_path / "a.rrd", "emulator", fault=("potentiometer_x_a:stuck@2.8",), on_fault="ignore",
        duration_s=6.5, set=("control_kp=0", "control_kd=0", "control_ki=0"),
    )  # fmt: skip
    assert abs(run["turntable/simulated"].values).max() > radians(120)  # it does turn over
    third = run["sensors/pulse"].values[:, 2]
    assert np.abs(np.diff(third)).max() < 3e-4  # of 1 ms between the stops


def test_a_turntables_own_parameters_reach_its_scene(tmp_path):
    _, run = flown(tmp_path / "a.rrd", "emulator", duration_s=0.2, set=("turntable_lead[0]=0.01",))
    assert run.properties["configuration"]["set"] == ["turntable_lead[0]=0.01"]
    with native.installed():
        told = lead(RigOptions("emulator", overrides={"turntable_lead[0]": 0.01}))
    assert told[0] == 0.01


@pytest.mark.slow
@pytest.mark.parametrize("unit", [None, *range(20, 26)])
def test_a_base_thrown_from_stop_to_stop_is_no_fault_of_a_servo(unit):
    """Without a calibration, as after burnout: the load moves the gimbal by 2° at a command of 0.

    Short form: `test_the_load_of_a_base_that_turns_is_no_fault_of_a_servo_and_hides_none`.
    """
    named = []
    with (
        native.installed(),
        open_rig(RigOptions("emulator", scene="turntable", unit=unit), None) as seat,
    ):
        begun = seat.now_ns()
        while (time := (seat.now_ns() - begun) * 1e-9) < 2.5:
            turn = min(1.7 * time, 0.84) if time < 1.0 else -0.84 if time < 1.7 else 0.84
            command = GimbalCommand(seat.now_ns(), (0.0, 0.0))
            seat.rig.send(command, seat.base.pulse(turn))
            seat.wait(COMMAND_NS)
            seat.rig.poll()
            named += seat.rig.faults
    assert named == []
