"""`twin identify --live`: measure a gimbal until its model is known well enough."""

from twin.workflows.live.measurement import identify

__all__ = ["identify"]
