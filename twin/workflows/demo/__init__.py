"""`twin demo`: the way of a gimbal from the bench to a flight, in one command and one page."""

from twin.workflows.demo.result import DemoResult
from twin.workflows.demo.stages import demo

__all__ = ["DemoResult", "demo"]
