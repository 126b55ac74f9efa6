"""`twin identify --live`: measure a gimbal until its model is known well enough."""

from twin.cli.live.measurement import identify

__all__ = ["identify"]
