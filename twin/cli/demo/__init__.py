"""`twin demo`: the way of a gimbal from the bench to a flight, in one command and one page."""

from twin.cli.demo.result import DemoResult
from twin.cli.demo.stages import demo

__all__ = ["DemoResult", "demo"]
