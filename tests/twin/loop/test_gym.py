"""The environment is a flight: same path, same numbers, an agent in the controller seat."""

import subprocess
import sys
import warnings

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import twin
import twin.gym
from analysis.recording import read
from twin.errors import DivergenceError, TwinError
from twin.gym import COMPONENTS, GimbalEnv, Policy
from twin.gym.observation import HIGH, LOW

GUSTS = {"wind_speed": 6.0, "wind_turbulence": 0.2}
MODEL = {"gimbal": "transfer-function"}


def flown(env, act, **reset):
    """Positions (n, 3) before each step, observations, rewards, and what the last step gave."""
    observation, info = env.reset(**reset)
    positions, observations, rewards, ended = [], [], [], (False, False)
    while not any(ended):
        positions.append(info["position"])
        observations.append(observation)
        observation, reward, *ended, info = env.step(act(observation, info))
        rewards.append(reward)
    return np.array(positions), np.array([*observations, observation]), rewards, (*ended, info)


def attitude_loop(observation, info):
    return info["attitude_loop"]


def gains(observation):
    """A policy of a proportional and a damping part, with the signs of the attitude loop."""
    return np.clip(-4.0 * observation[0:2] + 1.5 * observation[2:4], -1.0, 1.0)


def test_gymnasiums_checker_passes_without_a_warning():
    env = gymnasium.make(twin.gym.ID, programme="doublet", set=GUSTS, duration_s=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


@pytest.mark.thorough
def test_an_episode_of_the_attitude_loop_is_the_flight_of_that_seed(tmp_path):
    settings = MODEL | {"programme": "doublet", "set": GUSTS, "duration_s": 60.0}
    flight = twin.fly(seed=3, out=tmp_path / "f.rrd", **settings)
    env = gymnasium.make(twin.gym.ID, **settings)
    path, _, _, (terminated, truncated, info) = flown(env, attitude_loop, seed=3)
    recorded = read(flight)["vehicle/position"].values
    assert path.shape == recorded.shape
    assert np.abs(path - recorded).max() <= 1e-9  # m; the figure
    assert (terminated, truncated) == (True, False)
    assert info["ended"] == flight.ended == "reached the ground"


def test_an_episode_with_a_rig_is_the_flight_of_that_rig(tmp_path):
    settings = {"gimbal": "emulator", "unit": 2, "duration_s": 0.6}
    flight = twin.fly(seed=4, out=tmp_path / "f.rrd", **settings)
    env = GimbalEnv(seed=4, **settings)
    path, _, _, (terminated, truncated, _) = flown(env, attitude_loop)
    assert np.abs(path - read(flight)["vehicle/position"].values).max() <= 1e-9
    assert (terminated, truncated) == (False, True)


@pytest.fixture(scope="module")
def episode(tmp_path_factory):
    """A recorded episode of a policy: its recording, and what its steps gave."""
    out = tmp_path_factory.mktemp("episode") / "e.rrd"
    env = GimbalEnv(programme="step", at_s=0.5, duration_s=2.0, out=out)
    return flown(env, lambda o, _: gains(o), seed=1), out


def test_a_policy_flies_as_own_controller_what_it_flew_in_the_environment(tmp_path, episode):
    (path, *_), _ = episode
    settings = MODEL | {"programme": "step", "at_s": 0.5, "duration_s": 2.0}
    flight = twin.fly(controller=Policy(gains), seed=1, out=tmp_path / "f.rrd", **settings)
    np.testing.assert_array_equal(read(flight)["vehicle/position"].values, path)


def test_observations_are_the_recorded_signals(episode):
    (_, observations, *_), out = episode
    run = read(out)
    rows = {name: observations[:-1, k] for k, name in enumerate(COMPONENTS)}
    errors = np.vstack([observations[0, :2], run["control/error"].values])  # none without thrust
    expected = {
        "error_x": errors[:, 0],
        "error_y": errors[:, 1],
        "rate_y": run["vehicle/rate"].values[:, 1],
        "rate_z": run["vehicle/rate"].values[:, 2],
        "gimbal_x": run["gimbal/simulated"].values[:, 0],
        "gimbal_rate_y": run["gimbal/rate/simulated"].values[:, 1],
        "speed": np.linalg.norm(run["vehicle/velocity"].values, axis=1),
        "thrust": run["vehicle/thrust"].values[:, 0],
    }
    for name, values in expected.items():
        scale = max(1.0, np.abs(values).max())
        assert rows[name] == pytest.approx(values, abs=1e-6 * scale, nan_ok=True), name
    previous = np.radians(8.0) * np.column_stack([rows["action_x"], rows["action_y"]])
    assert previous[1:] == pytest.approx(run["gimbal/command"].values[:-1], abs=1e-7)


def test_the_reward_is_the_documented_cost(episode):
    (_, _, rewards, _), out = episode
    run = read(out)
    error, command = run["control/error"].values, run["gimbal/command"].values
    assert len(error) == len(command) - 1  # none at time zero, when there is no thrust
    action = command / np.radians(8.0)
    cost = (error**2).sum(axis=1) + 0.01 * (action[:-1] ** 2).sum(axis=1)
    assert rewards[:-1] == pytest.approx(-cost * 0.004, rel=1e-6, abs=1e-12)


def test_a_recorded_episode_is_complete_and_replayed_only_with_its_policy(tmp_path, episode):
    _, out = episode
    assert any("flight ended: time" in e.text for e in read(out).events)
    with pytest.raises(TwinError, match="own controller object:GimbalEnv"):
        twin.replay(out)
    again = twin.replay(out, controller=Policy(gains), out=tmp_path / "r.rrd")
    assert all(d.equal for d in again.differences)


def test_an_end_on_the_ground_costs_the_rest_of_the_burn_and_ends_the_episode():
    env = GimbalEnv(duration_s=60.0)
    _, observations, rewards, (terminated, _, info) = flown(env, lambda *_: (1.0, 0.0), seed=0)
    assert terminated
    assert info["ended"] == "reached the ground"
    burnout = 15.2  # s, of the reference motor
    assert rewards[-1] == pytest.approx(-((np.pi / 2) ** 2) * (burnout - info["time_s"]), rel=0.05)
    assert np.isfinite(observations).all()
    assert (observations >= LOW).all()
    assert (observations <= HIGH).all()
    with pytest.raises(TwinError, match="has ended"):
        env.step((0.0, 0.0))


def test_without_thrust_nothing_costs():
    env = GimbalEnv(duration_s=16.0)
    _, _, rewards, _ = flown(env, attitude_loop)
    assert rewards[-1] == 0.0
    assert rewards[3700] < 0.0  # at 14.8 s


def test_a_diverged_simulation_terminates_with_the_last_observation(monkeypatch):
    env = GimbalEnv()
    env.reset()
    before, *_ = env.step((0.0, 0.0))

    def diverge(*_):
        raise DivergenceError("the simulation diverged")

    monkeypatch.setattr("twin.plant.plant.Plant.advance", diverge)
    after, reward, terminated, _, info = env.step((0.0, 0.0))
    assert terminated
    assert "diverged" in info["ended"]
    assert reward < -30.0  # (π/2)² a second of burn
    np.testing.assert_array_equal(before, after)


def test_seeds_decide_the_gusts_and_random_ones_are_named():
    env = GimbalEnv(set=GUSTS, duration_s=1.0)

    def end(**reset):
        path, _, _, (*_, info) = flown(env, attitude_loop, **reset)
        return path[-1].tolist(), info["seed"]

    first, again, other = end(seed=5), end(seed=5), end()
    assert first == again
    assert other[0] != first[0]
    assert other == end(seed=other[1])
    env.reset(seed=5)
    assert end() == other  # what follows a seed is decided by it, too


def test_the_first_episode_has_the_seed_of_the_settings():
    ends = [GimbalEnv(seed=7).reset()[1]["seed"] for _ in range(2)]
    assert ends == [7, 7]
    assert GimbalEnv().reset()[1]["seed"] == 0


def test_options_hold_for_one_episode():
    env = GimbalEnv(duration_s=1.0)
    env.reset(options={"duration_s": 0.004, "set": {"wind_speed": 5.0}})
    *_, truncated, _ = env.step((0.0, 0.0))
    assert truncated
    env.reset()
    *_, truncated, _ = env.step((0.0, 0.0))
    assert not truncated


def test_environments_may_overlap_and_leave_nothing_behind(tmp_path):
    alone, *_ = flown(GimbalEnv(duration_s=0.2), attitude_loop)
    handler = mujoco.get_mju_user_warning()
    a, b = GimbalEnv(duration_s=0.2), GimbalEnv(duration_s=0.2)
    a.reset()
    b.reset()
    a.step((1.0, 1.0))
    a.close()
    assert mujoco.get_mju_user_warning() != handler
    path, *_ = flown(b, attitude_loop)
    np.testing.assert_array_equal(path, alone)
    assert mujoco.get_mju_user_warning() == handler
    assert mujoco.get_mjcb_passive() is None


def test_vector_environments_step_together():
    envs = gymnasium.make_vec(twin.gym.ID, num_envs=2, duration_s=0.1)
    observations, _ = envs.reset(seed=1)
    assert observations.shape == (2, len(COMPONENTS))
    observations, *_ = envs.step(np.zeros((2, 2), np.float32))
    np.testing.assert_array_equal(*observations)
    envs.close()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"programe": "step"}, "programme"),
        ({"clock": "wall"}, "lockstep"),
        ({"gimbal": "/dev/ttyUSB0"}, "twin.gym.Policy"),
        ({"controller": "own.py:Loop"}, "controller"),
        ({"repeat": 3}, "repeat"),
        ({"effort": -1.0}, "effort"),
        ({"render_mode": "human"}, "out="),
    ],
)
def test_a_setting_that_cannot_be_is_refused(settings, says):
    with pytest.raises(TwinError, match=says):
        GimbalEnv(**settings)


def test_an_action_that_is_not_two_numbers_is_refused():
    env = GimbalEnv()
    with pytest.raises(TwinError, match=r"call reset\(\)"):
        env.step((0.0, 0.0))
    env.reset()
    for action in ((0.0,), (0.0, np.nan), "left", None, ((0, 0), (0, 0))):
        with pytest.raises(TwinError, match="two numbers from -1 to 1"):
            env.step(action)
    env.close()


def test_without_gymnasium_the_extra_is_named():
    code = "import sys; sys.modules['gymnasium'] = None; import twin.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ImportError: twin.gym needs gymnasium; run pip install '.[gym]'" in done.stderr
