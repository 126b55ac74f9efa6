"""How far delays moved a flight, told from its recording, against flights really delayed."""

from collections import deque
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from analysis.convergence import Trajectory, distance
from analysis.delays import Delays
from analysis.recording import Recording, TimeSeries
from hardware.frames import GimbalCommand, GimbalState
from twin.config import Fly, Step
from twin.control import AttitudeController
from twin.experiments.assembly import make_plant
from twin.experiments.programme import setpoint
from twin.experiments.timing import DelayedGimbal, rerun_of, verdict
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.physics import native
from twin.plant.authority import control_config

TICK_NS = 2_000_000  # so that 10, 20 and 40 ms are whole ticks of a plain queue
END_NS = 5_000_000_000


@pytest.fixture(autouse=True, scope="module")
def compiled():
    with native.installed():
        yield


class Queue:
    """Commands come out of the other end later; nothing of the estimate's own machinery."""

    def __init__(self, gimbal, late_ns):
        self.gimbal, self.late, self.waiting = gimbal, late_ns, deque()

    def send(self, command):
        self.waiting.append(command)
        while self.waiting and self.waiting[0].time_ns + self.late <= command.time_ns:
            self.gimbal.send(self.waiting.popleft())

    def poll(self):
        return self.gimbal.poll()


def flown(config, late_ns):
    """Servos and rods behind a queue; the path, and the recording a rig would have left."""
    plant = make_plant(config)
    programme, _ = setpoint(config, plant.model)
    pilot = Pilot(plant, AttitudeController(control_config(plant.model)), programme, 1e-9 * TICK_NS)
    rows = []

    def sample(time_ns):
        rows.append((time_ns * 1e-9, plant.position.copy(), plant.attitude.copy()))

    run(
        Seats(plant, Queue(SimulatedGimbal(plant), late_ns), pilot, Lockstep()),
        steps_per_tick=TICK_NS // plant.dt_ns,
        duration_ns=END_NS,
        command=np.zeros(2),
        each_tick=(sample,),
    )
    time, position, attitude = (np.array(c) for c in zip(*rows, strict=True))
    return Trajectory(time, position, attitude)


def recording(config, path, late):
    """With what a clock estimate over a slow way out measures: see `analysis.timing.loop_delay`."""
    n = len(path.time)

    def series(name, values, unit):
        values = np.asarray(values).reshape(n, -1)
        return TimeSeries(name, path.time, values, unit, tuple("abcd"[: values.shape[1]]))

    signals = (
        series("gimbal/command", np.zeros((n, 2)), "rad"),
        series("vehicle/position", path.position, "m"),
        series("vehicle/attitude", path.attitude, "1"),
        series("timing/lateness", np.full(n, 4e-5), "s"),
        series("timing/sensor_age", np.full(n, late / 2), "s"),
        series("timing/round_trip", np.full(n, late), "s"),
    )
    properties = {"command": "fly", "configuration": config.as_properties()}
    return Recording(properties, MappingProxyType({s.name: s for s in signals}))


@pytest.fixture(scope="module")
def on_time():
    config = Fly(programme="doublet", control_hz=1e9 / TICK_NS)
    return config, flown(config, 0)


@pytest.mark.thorough
@pytest.mark.parametrize("late_ms", [10, 20, 40])
def test_a_delayed_loop_is_invalid_and_the_path_error_told_is_within_a_factor_of_two(
    on_time, late_ms
):
    config, truth = on_time
    delayed = flown(config, late_ms * 1_000_000)
    # whoever judges knows servos and rods only as the identified model, as with a rig
    told = verdict(recording(replace(config, gimbal="emulator"), delayed, late_ms * 1e-3))
    assert told.word == "invalid"
    assert told.delay.p50 == pytest.approx(late_ms * 1e-3)
    true = distance(delayed, truth).position
    assert 0.5 < told.moved.timing.position / true < 2.0


def test_a_period_that_no_whole_nanoseconds_divide_is_flown_again_in_finer_steps(on_time):
    _, path = on_time
    start = replace(path, **{f: getattr(path, f)[:300] for f in ("time", "position", "attitude")})
    again = rerun_of(recording(Fly(gimbal="emulator", control_hz=100.0), start, 0.01))
    whole, finer = again(None, 1), again(None, 4)
    assert len(whole.time) >= 2
    assert distance(finer, whole).position < 2e-4  # m; 0.1 mm by the step


def test_a_delay_spoils_no_test_in_which_nobody_answers_the_angles(on_time):
    _, path = on_time
    steps = recording(Step(gimbal="emulator", control_hz=1e9 / TICK_NS), path, 0.04)
    steps.properties["command"] = "step"
    told = verdict(steps)
    assert (told.word, told.delay.p50) == ("valid", pytest.approx(0.04))
    late = dict(steps.series)
    late["timing/lateness"] = replace(
        late["timing/lateness"], values=np.full((len(path.time), 1), 2e-3)
    )
    assert verdict(replace(steps, series=late)).word == "invalid"


def test_a_loop_on_time_is_valid(on_time):
    config, truth = on_time
    told = verdict(recording(replace(config, gimbal="emulator"), truth, 0.0))
    assert told.word == "valid", told.reasons
    assert told.moved.timing.position == 0.0


def test_a_rerun_on_time_of_a_simulated_seat_is_the_recorded_flight(on_time):
    config, truth = on_time
    again = rerun_of(recording(config, truth, 0.0))(None, 1)
    every = round(0.1e9) // TICK_NS
    np.testing.assert_array_equal(again.position, truth.position[::every][: len(again.time)])


def test_a_finer_rerun_comes_closer_to_a_still_finer_one(on_time):
    config, truth = on_time
    config = replace(config, gimbal="transfer-function", integrator="implicitfast")
    rerun = rerun_of(recording(config, truth, 0.0))
    coarse, fine, finest = (rerun(None, k) for k in (1, 2, 4))
    assert distance(fine, finest).position < 0.6 * distance(coarse, finest).position


class Listener:
    def __init__(self):
        self.heard = []

    def send(self, command):
        self.heard.append(command.angle)

    def poll(self):
        return GimbalState(0, (0.0, 0.0))


def test_a_delay_of_two_and_a_half_ticks_is_the_mean_of_two_commands():
    ear = Listener()
    gimbal = DelayedGimbal(ear, Delays(np.zeros(1), np.array([2.5 * 0.004])), 4_000_000)
    for k in range(6):
        gimbal.send(GimbalCommand(k * 4_000_000, (float(k + 1), -float(k + 1))))
    # commands 1, 2, 3 … ; neutral before the first
    assert [x for x, _ in ear.heard] == pytest.approx([0.0, 0.0, 0.5, 1.5, 2.5, 3.5])
    assert [y for _, y in ear.heard] == pytest.approx([0.0, 0.0, -0.5, -1.5, -2.5, -3.5])


def test_a_delay_that_was_estimated_below_zero_is_none():
    ear = Listener()
    gimbal = DelayedGimbal(ear, Delays(np.zeros(1), np.array([-1.5 * 0.004])), 4_000_000)
    for k in range(3):
        gimbal.send(GimbalCommand(k * 4_000_000, (float(k + 1), 0.0)))
    assert [x for x, _ in ear.heard] == [1.0, 2.0, 3.0]
