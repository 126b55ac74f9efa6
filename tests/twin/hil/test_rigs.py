"""Rigs in the gimbal seat, held against the true angles of the bench they stand on."""

from contextlib import contextmanager
from math import radians

import mujoco
import numpy as np
import pytest

from analysis.recording import read
from hardware.emulator import Drive, Wear, sample_rig
from hardware.events import HealthChanged, RigBack, RigLost, SensorFault, SensorRecovered
from hardware.frames import GimbalCommand
from hardware.simavr.nano import missing
from twin.config import Step
from twin.config.seats import check_seat, is_port, is_rig
from twin.errors import TwinError
from twin.experiments.step import step
from twin.hil import BenchPlant, RigOptions, open_rig
from twin.physics import native
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

TICK_S = 2e-3
FAST = 6  # a unit whose clock is far off
needs_avr = pytest.mark.skipif(bool(missing()), reason=f"without {', '.join(missing())}")


@pytest.fixture(autouse=True)
def callbacks():
    """Dead bands are native forces."""
    with native.installed():
        yield


@pytest.fixture(scope="module")
def bench_twin():
    with native.installed():
        yield load(ModelConfig(scene="bench"))


@contextmanager
def seated(**options):
    """A simulated rig in the seat of a bench whose gimbal follows it."""
    plant = Plant(load(ModelConfig(scene="bench", gimbal="follow")))
    with open_rig(RigOptions(**{"seat": "emulator", **options}), plant) as seat:
        yield seat, plant


def drive(seat, plant, command, seconds, each=lambda state: None):
    """The loop of `twin.loop.loop`, in four lines."""
    end = plant.time_ns + round(seconds * 1e9)
    while plant.time_ns < end:
        each(seat.poll())
        seat.send(GimbalCommand(plant.time_ns, command(plant.time_ns * 1e-9)))
        plant.advance(round(TICK_S * 1e9) // plant.dt_ns)


def swing(time):
    """A new place every 0.25 s, reaching 6°."""
    k = int(time / 0.25)
    return radians(6.0) * np.sin(2.4 * k), radians(6.0) * np.cos(1.7 * k)


def truths(seat):
    """What the emulator's device stamps really were: device time [µs] → angles and rates."""
    found = {}
    device = seat.rig.line.device
    device.observer = lambda us, angle, rate: found.__setitem__(us, (angle, rate))
    return found


class TestBenchPlant:
    def test_a_jammed_servo_stays_and_one_without_power_lets_the_motor_fall(self, bench_twin):
        bench = BenchPlant(bench_twin)

        def moved(seconds, *shaft):
            for _ in range(round(seconds * 1000)):
                bench.advance(1e-3, (*shaft, 0.0))
            return np.array(bench.angles())

        before = moved(0.3, 0.2, 0.1)
        bench.set_drive(0, Drive.JAMMED)
        jammed = moved(0.3, -0.2, -0.1)
        assert abs(jammed[0] - before[0]) < radians(0.5)  # the play of ±0.2°
        assert jammed[1] < -radians(1.5)
        bench.set_drive(0, Drive.NORMAL)
        held = moved(0.3, -0.2, -0.1)
        assert held[0] < -radians(4.0)
        bench.set_drive(0, Drive.LIMP)
        # nozzle up, the motor's weight exceeds the friction of gear and bearings: outwards
        assert moved(0.5, 0.2, -0.1)[0] < held[0] - radians(0.3)
        bench.set_drive(0, Drive.NORMAL)  # the model is shared

    def test_a_servo_that_jams_at_full_speed_stays_there_while_the_other_moves(self, bench_twin):
        bench, jammed = BenchPlant(bench_twin), None
        for k in range(1500):
            wave = np.sin(4 * np.pi * k * 1e-3)  # at 0.5 s through zero, 2.5 rad/s of the shaft
            bench.advance(1e-3, (0.2 * wave, 0.3 * wave, 0.0))
            if k == 500:
                bench.set_drive(0, Drive.JAMMED)
                jammed = np.array(bench.angles())
            if k > 500:
                # play of ±0.2°, and 3.5 % of the other axis' 7° through the rods
                assert abs(bench.angles()[0] - jammed[0]) < radians(0.7)
        bench.set_drive(0, Drive.NORMAL)  # the model is shared

    def test_wear_widens_the_play_adds_friction_and_takes_voltage(self, bench_twin):
        def width_and_speed(wear):
            """Angle between both directions of approach, and the fastest rate."""
            bench = BenchPlant(bench_twin)
            bench.set_wear(1, wear)
            ends, fastest = [], 0.0
            for side in (0.2, -0.2):
                for shaft in (side, 0.0):
                    for _ in range(250):
                        bench.advance(1e-3, (0.0, shaft, 0.0))
                        fastest = max(fastest, abs(bench.rates()[1]))
                ends.append(bench.angles()[1])
            bench.set_wear(1, Wear())  # the model is shared
            return ends[0] - ends[1], fastest

        width, speed = width_and_speed(Wear())
        slow = width_and_speed(Wear(voltage=0.5))[1]
        assert 0.4 < slow / speed < 0.7  # half the voltage
        # the horn turns the gimbal by 0.44 of its angle
        assert abs(width_and_speed(Wear(backlash=radians(2.0)))[0] - width - radians(0.88)) < 0.004
        # it stops where it overshoots to
        assert width_and_speed(Wear(friction=4.0))[0] < width - 0.002
        assert width_and_speed(Wear()) == (width, speed)

    def test_its_gyro_is_mujocos_own(self, bench_twin):
        bench = BenchPlant(bench_twin)
        for k in range(150):
            bench.advance(1e-3, (0.2 * np.sin(0.05 * k), 0.15 * np.cos(0.04 * k), 0.0))
        told = bench.holder_imu()[0]
        mujoco.mj_forward(bench.model, bench.data)  # brings MuJoCo's sensor to this instant
        assert abs(np.array(told)).max() > 0.5  # it moves
        # the same formula in other words: rounding of a rotation matrix
        np.testing.assert_allclose(told, bench.data.sensor("gyro").data, atol=1e-9)

    def test_at_rest_it_feels_gravity_along_the_tilted_holder(self, bench_twin):
        bench = BenchPlant(bench_twin)
        for _ in range(900):
            bench.advance(1e-3, (0.2, -0.3, 0.0))
        (x, y), force = bench.angles(), np.array(bench.holder_imu()[1])
        assert abs(x) > 0.05
        assert abs(y) > 0.05
        # nozzle up: the holder's z points down; rotation about x, then y
        rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
        ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
        up = (rx @ ry).T @ [0.0, 0.0, -9.80665]
        # a hundredth of g: it still swings a little on its dead band
        np.testing.assert_allclose(force, up, atol=0.1)
        np.testing.assert_allclose(bench.base_imu()[1], [0, 0, -9.81], atol=0.01)

    def test_another_gimbal_than_servos_is_refused(self):
        with pytest.raises(TwinError, match="needs servos"):
            BenchPlant(load(ModelConfig(scene="bench", gimbal="follow")))


class TestRigGimbal:
    def test_the_fused_angle_is_the_benchs_true_angle(self):
        with seated(unit=2, seed=5) as (seat, plant):
            true, errors, sigmas = truths(seat), [], []

            def look(state):
                frames, states = seat.rig.states and seat.readings.frames, seat.readings.states
                for frame, seen in zip(frames, states, strict=True):
                    if frame.device_us in true:
                        errors.append(np.array(seen.angle) - true[frame.device_us][0])
                        sigmas.append(seen.sigma)

            drive(seat, plant, swing, 2.0, look)
        assert len(errors) > 900
        rms = np.degrees(np.sqrt(np.mean(np.square(errors), axis=0)))
        # half an ADC step is 0.12°; the track's waviness alone is 0.035° rms
        assert rms.max() < 0.08, rms

    def test_the_joints_follow_what_was_measured(self):
        with seated() as (seat, plant):
            worst = []

            def look(state):
                worst.append(abs(plant.gimbal_angle - before).max())
                before[:] = np.add(state.angle, TICK_S * np.array(state.rate))

            before = np.zeros(2)
            drive(seat, plant, swing, 1.0, look)
        # half of what the filter corrects in a frame, up to 0.3° where a servo starts
        assert np.sqrt(np.mean(np.square(worst[2:]))) < radians(0.05)
        assert max(worst[2:]) < radians(0.5)

    @pytest.mark.parametrize("angle", [(5.0, -3.0), (-6.0, 6.0), (0.0, 0.0)])
    def test_a_command_arrives_as_that_angle_although_the_linkage_bends_it(self, angle):
        wanted = radians(angle[0]), radians(angle[1])
        with seated() as (seat, plant):
            drive(seat, plant, lambda time: wanted, 0.8)
            bench = seat.rig.line.device.bench.plant
            off = np.degrees(np.array(bench.angles()) - wanted)
        # backlash (±0.1° at the gimbal), dead band (±0.11°) and friction; lines alone are 0.7° off
        assert abs(off).max() < 0.4, off

    def test_a_pulled_cable_is_a_gap_and_not_the_end(self):
        told, pulses, healthy = [], [], []
        with seated(faults=("link:unplug:0.4@1.6",)) as (seat, plant):
            device = seat.rig.line.device

            def look(state):
                told.extend(e for e in seat.readings.events if not isinstance(e, HealthChanged))
                healthy.append(state.healthy)
                pulses.append((device.time_us * 1e-6, device.device.pulse))

            drive(seat, plant, lambda time: (radians(5), 0.0), 2.0, look)
        assert [type(event) for event in told] == [RigLost, RigBack]
        assert told[1].away_s == pytest.approx(0.4, abs=0.1)
        assert healthy[0]
        assert not all(healthy)
        assert healthy[-1]
        neutral = (3000, 3000, 3000)
        # the command's own timeout is 0.1 s
        assert {p[:2] for t, p in pulses if 1.72 < t < 1.98} == {neutral[:2]}
        assert pulses[-1][1][0] != neutral[0]  # it steers again

    @pytest.mark.thorough
    def test_a_sensor_that_fails_and_recovers_is_reported_twice_by_name(self):
        events = []
        with seated(faults=("potentiometer_x_a:open@1.5-1.9",)) as (seat, plant):

            def look(state):
                events.extend((plant.time_ns * 1e-9, e) for e in seat.readings.events)

            drive(seat, plant, swing, 4.5, look)
        sensor = "potentiometer_x_a"
        (failed, fault), (back, recovered) = (
            e for e in events if isinstance(e[1], SensorFault | SensorRecovered)
        )
        assert (fault.sensor, fault.level) == (sensor, "WARN")
        assert recovered == SensorRecovered(sensor)
        assert 0.5 < failed < 1.1  # 0.9 s of the rig's time pass before time zero
        assert back > failed + 2.0  # trusted again after 2 s without evidence
        health = [e.health for _, e in events if isinstance(e, HealthChanged)]
        assert (health[0], health[-1]) == ("ok", "ok")
        assert any(sensor in text for text in health)


def stepped(path, gimbal, **more):
    step(Step(gimbal=gimbal, out=path, repeats=1, hold_s=0.3, axis="x", **more))
    return read(path)


@pytest.fixture(scope="module")
def emulated(tmp_path_factory):
    return stepped(tmp_path_factory.mktemp("rigs") / "emulator.rrd", "emulator")


class TestStep:
    @pytest.mark.thorough
    @needs_avr
    def test_emulator_and_firmware_answer_alike(self, tmp_path, emulated):
        a = emulated["gimbal/measured"]
        b = stepped(tmp_path / "firmware.rrd", "firmware")["gimbal/measured"]
        time = np.arange(0.05, a.time[-1] - 0.05, 1e-3)
        for k in range(2):
            ours = np.interp(time, a.time, a.values[:, k])
            theirs = np.interp(time, b.time, b.values[:, k])
            rms = np.degrees(np.sqrt(np.mean((ours - theirs) ** 2)))
            assert rms < 0.3, rms  # issue's figure

    def test_two_runs_of_one_seed_are_equal(self, tmp_path, emulated):
        a, b = emulated, stepped(tmp_path / "again.rrd", "emulator")
        assert a.series.keys() == b.series.keys()
        for name in a.series:
            np.testing.assert_array_equal(a[name].time, b[name].time)
            np.testing.assert_array_equal(a[name].values, b[name].values)

    def test_a_frame_is_recorded_at_the_time_the_device_took_it(self, tmp_path):
        run = stepped(tmp_path / "a.rrd", "emulator", unit=FAST)
        device, measured = run["sensors/device_time"], run["gimbal/measured"]
        np.testing.assert_array_equal(device.time, measured.time)
        # what was sampled before time zero and arrived after it stands just behind it
        within = device.time > 1e-6
        assert (~within).sum() <= 3
        stamps, clock = device.time[within], device.values[within, 0]
        line = np.polyfit(stamps, clock, 1)
        rest = clock - np.polyval(line, stamps)
        # what matters is that neither tick nor wire shows in the stamps: 2 ms each
        assert line[0] == pytest.approx(1.0 + sample_rig(FAST).skew, abs=1e-4)
        assert abs(rest).max() < 4e-4  # the clock is estimated through ticks of 1 ms
        age = run["timing/sensor_age"].values
        # the frame alone takes 1.5 ms on the wire; half of a PONG's millisecond may be off
        assert np.nanmin(age) > 0.8e-3
        assert np.nanmax(age) < 6e-3


@pytest.mark.parametrize(
    ("hz", "repeats"),
    [
        (40.0, 1),  # 500 Hz: as recorded above
        *(pytest.param(hz, 4, marks=pytest.mark.slow) for hz in (250.0, 100.0, 40.0)),
    ],
)
def test_the_devices_clock_is_known_however_seldom_the_loop_looks(tmp_path, hz, repeats):
    """Stamps follow the device's own clock, and no reading is younger than its way here."""
    out = tmp_path / "a.rrd"
    step(Step(gimbal="emulator", control_hz=hz, repeats=repeats, axis="x", out=out))
    run = read(out)
    device = run["sensors/device_time"]
    within = device.time > 1e-6
    apart = device.values[within, 0] - device.time[within]
    # a PONG is dated within a millisecond of its coming, whose half is what the clock may be off
    assert np.ptp(apart) < 1e-3
    age = run["timing/sensor_age"].values
    assert np.nanmin(age[1:]) > 0.8e-3  # as above


class TestSeatNames:
    @pytest.mark.parametrize("name", ["/dev/ttyUSB0", "COM3", "com12", "socket://127.0.0.1:1"])
    def test_ports_are_told_from_names(self, name):
        assert is_port(name)
        assert is_rig(name)
        check_seat(name)

    @pytest.mark.parametrize("name", ["", "rope", "emulater", "com", "linkage2"])
    def test_what_is_neither_is_refused_with_the_valid_names(self, name):
        with pytest.raises(TwinError, match=r"linkage, transfer-function, emulator, firmware"):
            check_seat(name)
