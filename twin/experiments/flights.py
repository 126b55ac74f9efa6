"""`twin fly`: one flight, or repeated ones."""

from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.flight.fly import fly as once
from twin.experiments.flight.result import FlightResult
from twin.experiments.repeat.repeat import repeat
from twin.experiments.repeat.result import RepeatResult


def fly(config: Fly, controller: object | None = None) -> FlightResult | RepeatResult:
    """Fly once, or as often as asked with the next seed each time.

    Parameters
    ----------
    controller : own controller object in place of the attitude loop

    Raises
    ------
    TwinError, HardwareError, AnalysisError : something asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    if config.repeat == 1:
        return once(config, controller=controller)
    if controller is not None or config.controller is not None:
        raise TwinError("--repeat: needs the built-in attitude loop, not an own controller")
    return repeat(config)
