"""The shipped model of the gimbal against the rig it was identified from, in flight."""

import json

import numpy as np
import pytest
from scipy.signal import lsim

from analysis.recording import Recording
from analysis.recording import reader as recording
from twin.config import Fly, Identify, Step
from twin.evaluation.identify import identify
from twin.experiments.flight.fly import fly
from twin.experiments.step import step
from twin.plant.model.compose import MJCF

ATTITUDE_DEG, PATH = 0.5, 0.0024  # rms, and of the distance flown; twice what the page says
DELAY_S = 6e-3  # the wait for a pulse frame, 0 to 20 ms, and the dead band move the best one by 4.5


def nose(run: Recording, times: np.ndarray) -> np.ndarray:
    """Direction of the body's z axis (n, 3): third column of the rotation of a quaternion."""
    attitude = run["vehicle/attitude"]
    w, x, y, z = attitude.values.T
    axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return np.stack([np.interp(times, attitude.time, a) for a in axis], axis=1)


def place(run: Recording, times: np.ndarray) -> np.ndarray:
    position = run["vehicle/position"]
    return np.stack([np.interp(times, position.time, p) for p in position.values.T], axis=1)


def best_delay(run: Recording) -> float:
    """Delay with which the shipped poles, simulated by SciPy, follow the rig's y axis best [s]."""
    channel = json.loads((MJCF / "gimbal.json").read_text())["channels"][1][1]
    command, measured = run["gimbal/command"], run["gimbal/measured"]
    t = np.arange(0.0, command.time[-1], 1e-3)
    u = command.values[np.maximum(np.searchsorted(command.time, t, "right") - 1, 0), 1]
    simulated = lsim((channel["num"], channel["den"]), u, t)[1]
    late = t > measured.time[0] + 0.5
    seen = np.interp(t, measured.time, measured.values[:, 1])
    delays = np.arange(0.0, 0.05, 5e-4)
    errors = [np.sum((np.interp(t - d, t, simulated) - seen)[late] ** 2) for d in delays]
    return float(delays[np.argmin(errors)])


def staleness(folder) -> float:
    """Worst distance of a shipped figure from that of docs/identification.md's commands, run now.

    In half widths of its own 95 % interval.
    """
    files = []
    for seed, amplitude in enumerate((1.5, 3.0, 6.0), start=1):
        files.append(folder / f"{seed}.rrd")
        step(
            Step(
                gimbal="emulator", amplitude_deg=amplitude, repeats=5, hold_s=0.5, seed=seed,
                out=files[-1],
            )
        )  # fmt: skip
    result = identify(Identify(sources=tuple(files), out=folder / "gimbal.json"))
    return apart_in_intervals(shipped_figures(), {e.name: e.value for e in result.model.estimates})


def shipped_figures() -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each figure of the shipped model, from its polynomials."""
    model = json.loads((MJCF / "gimbal.json").read_text())
    found = {}
    for k, axis in enumerate("xy"):
        channel = model["channels"][k][k]
        (_, c1, c0), w = channel["den"], np.sqrt(channel["den"][2])
        values = {
            "gain": channel["num"][-1] / c0, "delay": channel["delay_s"],
            "natural frequency": w, "damping": c1 / (2.0 * w),
        }  # fmt: skip
        for what, value in values.items():
            name = f"{axis}/{axis} {what}"
            found[name] = (value, model["std"][name])
    return found


def apart_in_intervals(shipped, renewed) -> float:
    """Largest distance of two models' figures over the half width of the first one's interval."""
    return max(abs(renewed[name] - value) / (1.96 * std) for name, (value, std) in shipped.items())


def flights(folder, programme, seconds=8.0, gimbals=("emulator", "transfer-function"), **more):
    """A recording of the rig's flight and one of its model's."""
    runs = []
    for gimbal in gimbals:
        out = folder / f"{gimbal}.rrd"
        fly(Fly(gimbal=gimbal, programme=programme, duration_s=seconds, out=out, **more))
        runs.append(recording.read(out))
    return runs


def apart(runs, seconds=8.0):
    """Angle between the noses, rms and worst [deg], distance of the paths, length of one [m]."""
    times = np.arange(0.0, seconds - 0.1, 0.01)
    noses, places = ([f(r, times) for r in runs] for f in (nose, place))
    angle = np.degrees(np.linalg.norm(np.cross(*noses), axis=1))  # small: sine for arc
    flown = np.linalg.norm(np.diff(places[0], axis=0), axis=1).sum()
    distance = np.linalg.norm(places[0] - places[1], axis=1).max()
    return np.sqrt(np.mean(angle**2)), angle.max(), distance, flown


def agree(runs):
    """Assert that a flight of the rig and that of its model are as near as the page says."""
    angle, _, distance, flown = apart(runs)
    assert 0.01 < angle < ATTITUDE_DEG  # and not the same flight twice
    assert flown > 100.0
    assert distance < PATH * flown
    shipped = json.loads((MJCF / "gimbal.json").read_text())["channels"][1][1]["delay_s"]
    assert best_delay(runs[0]) == pytest.approx(shipped, abs=DELAY_S)


@pytest.mark.slow
def test_a_flight_of_the_model_and_of_the_rig_agree(tmp_path):
    """Eight seconds hold the programme; the doublet is flown in test_hil.py."""
    agree(flights(tmp_path, "step"))


@pytest.mark.slow
def test_the_shipped_model_is_what_its_documented_commands_give(tmp_path):
    """Within half of its own intervals: the emulator is deterministic, its model may improve."""
    assert staleness(tmp_path) < 0.5


def test_a_model_that_is_stale_by_more_than_its_interval_is_noticed():
    """The short form: `staleness` sees 5 ms more delay, and nothing in the model itself."""
    shipped = shipped_figures()
    renewed = {name: value for name, (value, _) in shipped.items()}
    assert apart_in_intervals(shipped, renewed) == 0.0
    renewed["y/y delay"] += 5e-3
    assert apart_in_intervals(shipped, renewed) > 1.0
