"""Reinforcement learning: the controller seat as a gymnasium environment.

    import gymnasium
    import twin.gym

    env = gymnasium.make("tvc-twin/Gimbal-v0", programme="doublet")

Needs the extra `gym`.
"""

try:
    import gymnasium
except ImportError:
    raise ImportError("twin.gym needs gymnasium; run pip install '.[gym]'") from None

from twin.gym.environment import GimbalEnv
from twin.gym.observation import COMPONENTS, Observer
from twin.gym.policy import Policy

ID = "tvc-twin/Gimbal-v0"

__all__ = ["COMPONENTS", "ID", "GimbalEnv", "Observer", "Policy"]

if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point="twin.gym.environment:GimbalEnv")
