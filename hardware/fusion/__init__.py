"""Sensor frames to gimbal states: Kalman filter over both axes, with a fault monitor."""

from hardware.fusion.base import BaseAttitude, BaseMap
from hardware.fusion.estimator import Fusion
from hardware.fusion.kalman import Noise

__all__ = ["BaseAttitude", "BaseMap", "Fusion", "Noise"]
