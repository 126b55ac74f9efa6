"""Sensor frames in, gimbal states out: Kalman filter per axis and the fault monitor beside it."""

from hardware.fusion.axis import Noise
from hardware.fusion.base import BaseAttitude, BaseMap
from hardware.fusion.estimator import Fusion

__all__ = ["BaseAttitude", "BaseMap", "Fusion", "Noise"]
