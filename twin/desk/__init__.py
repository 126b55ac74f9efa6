"""Commands around a rig on the desk: serve a simulated one, calibrate one, mirror one."""

from twin.desk.calibrating import CalibrationResult, calibrate
from twin.desk.mirroring import MirrorResult, mirror
from twin.desk.serving import rig

__all__ = ["CalibrationResult", "MirrorResult", "calibrate", "mirror", "rig"]
