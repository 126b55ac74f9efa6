"""Sensor frames in, gimbal states out: Kalman filter per axis and the fault monitor beside it."""

from hardware.fusion.base import BaseAttitude, BaseMap
from hardware.fusion.estimator import Fusion
from hardware.fusion.kalman import Noise

__all__ = ["BaseAttitude", "BaseMap", "Fusion", "Noise"]
