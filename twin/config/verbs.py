"""The verbs: name, settings, and the function that does it, imported when the verb is used."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from twin.config.base import Settings
from twin.config.campaign import Campaign
from twin.config.demo import Demo
from twin.config.derived import Converge, Replay
from twin.config.evaluation import Compare, History, Identify, Report
from twin.config.mechanism import Mechanism, Meshes
from twin.config.rig import Calibrate, Mirror, Rig
from twin.config.runs import Fly, Step
from twin.config.tools import Doctor, Export, View
from twin.config.vehicle import ListParameters, Vehicle


@dataclass(frozen=True, slots=True)
class Verb:
    """One verb of the command line and of the Python interface.

    Attributes
    ----------
    name : as it is typed
    settings : what it can be asked
    place : MODULE:FUNCTION; the function takes the settings and returns a `Result`, an exit code
        or None
    """

    name: str
    settings: type[Settings]
    place: str

    @property
    def function(self) -> Callable[..., Any]:
        """The function, with its imports."""
        module, _, name = self.place.partition(":")
        function: Callable[..., Any] = getattr(import_module(module), name)
        return function

    def run(self, **settings: object) -> Any:  # noqa: ANN401  each verb has its result
        """Result under these settings."""
        return self.function(self.settings.of(settings))


VERBS = (
    Verb("demo", Demo, "twin.workflows.demo:demo"),
    Verb("fly", Fly, "twin.experiments.flights:fly"),
    Verb("step", Step, "twin.experiments.step:step"),
    Verb("mirror", Mirror, "twin.experiments.mirror:mirror"),
    Verb("calibrate", Calibrate, "twin.experiments.calibrate:calibrate"),
    Verb("identify", Identify, "twin.workflows.live:identify"),
    Verb("compare", Compare, "twin.evaluation.compare:compare"),
    Verb("history", History, "twin.evaluation.history:history"),
    Verb("report", Report, "twin.evaluation.report:write_report"),
    Verb("converge", Converge, "twin.experiments.convergence:converge"),
    Verb("campaign", Campaign, "twin.campaigns.campaign:campaign"),
    Verb("replay", Replay, "twin.experiments.replay:replay"),
    Verb("rig", Rig, "twin.experiments.serve:rig"),
    Verb("vehicle", Vehicle, "twin.experiments.vehicle.vehicle:vehicle"),
    Verb("parameters", ListParameters, "twin.cli.parameters:parameters"),
    Verb("mechanism", Mechanism, "twin.experiments.mechanism:mechanism"),
    Verb("meshes", Meshes, "twin.experiments.mechanism.build:draw"),
    Verb("view", View, "twin.cli.view:view"),
    Verb("export", Export, "twin.evaluation.export:export"),
    Verb("doctor", Doctor, "twin.cli.doctor:doctor"),
)
BY_NAME = {verb.name: verb for verb in VERBS}
