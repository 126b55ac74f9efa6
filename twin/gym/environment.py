"""The environment: an agent in the controller seat of a flight in lockstep."""

import math
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from twin.config import OBJECT, Fly
from twin.config.types import LARGEST_SEED
from twin.errors import TwinError
from twin.experiments.flight.flight import PASSED
from twin.gym.episode import Episode
from twin.gym.observation import HIGH, LOW, Observation
from twin.loop.loop import TIME_UP

DEFAULTS: dict[str, object] = {"gimbal": "transfer-function", "duration_s": 15.0}
FIXED = ("controller", "repeat", "json")  # settings of a flight that an environment does not have
LYING = (math.pi / 2.0) ** 2  # rad²; squared error that counts for the burn after an early end


class GimbalEnv(gymnasium.Env[Observation, Observation]):
    """Steer a vehicle by its gimbal, one control tick a step.

    Observations are those of `twin.gym.COMPONENTS`. An action gives both gimbal angles as parts of
    the attitude loop's largest angle, from -1 to 1.

    While the motor burns, the reward of a step is `-(|e|² + effort·|a|²)·dt` with the rotation
    missing `e` after it [rad] and the action `a`; afterwards zero, since nothing steers. An episode
    that ends on the ground, by divergence or by a fault also costs `(π/2)²` times the rest of the
    burn [s].

    Truncated at `duration_s`; terminated when the flight ends earlier, for the reason `ended` in
    the info. The info also has the time `time_s`, the `seed`, the `position` (3,) [m], and the
    action `attitude_loop` (2,) that the built-in loop would take next.

    Parameters
    ----------
    effort : weight of the squared action in the reward [rad²]
    render_mode : None; a recording shows more, see `out`
    settings : of `twin.fly`, with an identified model as gimbal and 15 s by default. With `out`
        every episode is recorded, each in place of the one before. A rig must be simulated.

    Raises
    ------
    TwinError : an unknown setting, or one that an environment cannot have
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  as gymnasium declares it

    def __init__(
        self, *, effort: float = 0.01, render_mode: str | None = None, **settings: object
    ) -> None:
        if render_mode is not None:
            raise TwinError(f"render_mode {render_mode!r}: must be None; record with out= instead")
        if not (math.isfinite(effort) and effort >= 0.0):
            raise TwinError(f"effort {effort!r}: must be a finite number from 0")
        self.render_mode = None
        self.effort = effort
        self._settings = {**DEFAULTS, **settings}
        self._first_seed: int | None = _config(self._settings).seed
        self._episode: Episode | None = None
        self._seed = 0
        self.observation_space = gymnasium.spaces.Box(LOW, HIGH)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new flight.

        Parameters
        ----------
        seed : of this flight and of those after it; the setting `seed` for the first one if
            omitted, a random one for the others
        options : settings of `twin.fly` for this flight alone

        Raises
        ------
        TwinError : an option that cannot be
        """
        if seed is None:
            seed = self._first_seed
        super().reset(seed=seed)
        self._first_seed = None
        self._seed = int(self.np_random.integers(LARGEST_SEED)) if seed is None else int(seed)
        config = _config({**self._settings, **(options or {}), "seed": self._seed})
        self.close()
        self._episode = Episode(config)
        return self._episode.observation, self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Command an action (2,) for one tick.

        Raises
        ------
        TwinError : it is not two numbers, or the episode has ended
        """
        episode = self._running()
        episode.advance(episode.observer.angle(action))
        ended = None if episode.outcome is None else episode.outcome.ended
        terminated, truncated = ended not in (None, TIME_UP), ended == TIME_UP
        reward = self._reward(episode, early=terminated and ended != PASSED)
        return episode.observation, reward, terminated, truncated, self._info()

    def close(self) -> None:
        """Release what the flight needs; its recording is completed."""
        if self._episode is not None:
            self._episode.close()

    def _running(self) -> Episode:
        if self._episode is None:
            raise TwinError("no episode has begun; call reset()")
        return self._episode

    def _reward(self, episode: Episode, *, early: bool) -> float:
        left = (episode.flight.burnout_ns - episode.plant.time_ns) * 1e-9
        if left < 0.0:
            return 0.0
        error, action = episode.pilot.error, episode.observer.action
        cost = float(error @ error + self.effort * (action @ action)) * episode.period
        return -cost - (LYING * left if early else 0.0)

    def _info(self) -> dict[str, Any]:
        episode = self._running()
        info: dict[str, Any] = {
            "time_s": episode.plant.time_ns * 1e-9,
            "seed": self._seed,
            "position": episode.plant.position.copy(),
            "attitude_loop": np.array(episode.action_of_pilot) / episode.observer.limit,
        }
        if episode.outcome is not None:
            info["ended"] = episode.outcome.ended
        return info


def _config(settings: dict[str, object]) -> Fly:
    """Settings of an episode's flight.

    Raises
    ------
    TwinError : one that an environment cannot have
    """
    for name in FIXED:
        if name in settings:
            raise TwinError(f"{name}: an environment has no such setting")
    config = Fly.of({**settings, "controller": f"{OBJECT}{GimbalEnv.__name__}"})
    if config.real_time:
        raise TwinError(
            f"gimbal {config.gimbal!r}, clock {config.clock!r}: an environment runs in lockstep;"
            " fly a policy in real time with twin.fly(controller=twin.gym.Policy(...))"
        )
    return config
