"""Settings of what repeats a run, and runs with other settings."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal, TypeVar

from twin.config.options import Output, Parameters, Run
from twin.config.runs import Fly
from twin.config.seats import OF_SERVOS
from twin.config.types import (
    POSITIONAL,
    TRANSFER_FUNCTION,
    Flag,
    Frequency,
    Integrator,
    Range,
    Seed,
)
from twin.config.types import Step as TimeStep


@dataclass(frozen=True)
class Replay(Output, Parameters):
    """Repeat a recorded run: bit for bit, or with changed settings."""

    group: ClassVar[str] = "replay"

    recording: Annotated[Path, POSITIONAL]
    """Recording (.rrd) of `twin fly` or `twin step`."""
    _: KW_ONLY
    gimbal: Literal["linkage", "transfer-function", "emulator", "firmware"] | None = None
    """Another gimbal source; if omitted, the recorded readings of a rig take its place."""
    integrator: Integrator | None = None
    """Another integrator."""
    dt: TimeStep | None = None
    """Another physics time step [s]."""
    control_hz: Frequency | None = None
    """Another rate of the controller [Hz]."""
    seed: Seed | None = None
    """Another random seed."""
    controller: str | None = None
    """Own controller of the recorded flight, FILE.py:NAME; a file named in a recording is never
    executed."""
    force: Flag = False
    """Replay even if versions of libraries or the model differ from those recorded, with files of
    this machine that the recording names but does not contain; also replace an existing file that
    is more than a simulation's recording."""
    out: Path | None = None
    """Recording to write; RECORDING.replay.rrd if omitted."""


@dataclass(frozen=True, kw_only=True)
class Converge(Output, Parameters):
    """Vary the time step of a flight: error and order of each integrator, and real-time limits."""

    group: ClassVar[str] = "study"
    effective = MappingProxyType({"model": ("gimbal", (TRANSFER_FUNCTION,))})

    flight: Literal["baseline", "closed-loop"] = "baseline"
    """Free flight with the gimbal at rest (baseline), or with the attitude loop from the launch on
    (closed-loop)."""
    gimbal: Literal["linkage", "transfer-function"] = "transfer-function"
    """Gimbal source: simulated servos and pushrods (linkage), or an identified model."""
    integrators: tuple[Integrator, ...] = ("ab1", "ab2", "ab3", "ab4", "implicitfast", "rk4")
    """Integrators to compare. Figure and verdict are about the one that `twin fly` uses by default,
    or about the first one where that is not compared."""
    dt_ms: tuple[Annotated[float, Range(1e-3, 20.0, "ms")], ...] = ()
    """Time steps to compare [ms], 2 to 12 of them; 20, 10, 5 and 2.5 for baseline, 4, 2, 1 and 0.5
    for closed-loop if omitted."""
    tolerance_m: Annotated[float, Range(1e-9, 1e6, "m")] = 0.1
    """Largest error of the path that counts as converged [m]."""
    duration_s: Annotated[float, Range(1e-2, 60.0, "s")] = 3.0
    """Length of the flight that is compared [s]; baseline ends earlier where its straight piece of
    the thrust curve does."""
    control_hz: Frequency = 250.0
    """Rate of the controller [Hz], whose period real time allows for the steps of one tick."""
    seed: Seed = 0
    """Random seed of the wind's gusts and of the jittered steps."""
    vehicle: Path | None = None
    """Description (TOML), OpenRocket design (.ork, with --motor) or MJCF file of the vehicle; the
    reference vehicle if omitted."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; that of the vehicle's description, or else the reference
    mechanism, if omitted."""
    model: Path | None = None
    """Identified model (JSON) for `--gimbal transfer-function`; the shipped model, which is of the
    reference mechanism, if omitted."""
    motor: Path | None = None
    """Motor file, or FILE:NAME for one of several motors in it: RASP (.eng), RockSim (.rse) or a
    thrust table of two columns (.csv); the vehicle's own motor if omitted."""
    out: Path | None = None
    """Page to write (.html); runs/converge-DATE-TIME.html if omitted."""

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return ("report",)


R = TypeVar("R", bound=Run)


def with_model(config: R, gimbal: str, **changes: object) -> R:
    """The same run with a model in the gimbal seat, without the settings of a rig.

    Parameters of servos and rods are dropped where an identified model takes their place.
    """
    rig: dict[str, object] = {
        "calibration": None, "fault": (), "unit": None, "clock": "lockstep", "no_check": False,
        "shadow": None, "shadow_set": (),
    }  # fmt: skip
    if isinstance(config, Fly):
        rig |= {"attitude": "truth", "scene": config.plant_scene, "about": config.turns_about}
    if hasattr(config, "on_fault"):
        rig["on_fault"] = None
    if gimbal == TRANSFER_FUNCTION:
        rig["set"] = _without_servos(config)
    else:
        rig["model"] = None
    return replace(config, **{**rig, "gimbal": gimbal, **changes})  # type: ignore[arg-type]


def without_ineffective(config: R) -> R:
    """A recorded run without parameters that had no effect in it and are refused by now."""
    if config.gimbal != TRANSFER_FUNCTION:
        return config
    return replace(config, set=_without_servos(config))


def added(config: R, parameters: Mapping[str, float]) -> R:
    """The same run with more parameters, which take precedence."""
    return replace(config, set=tuple({**config.overrides, **parameters}.items()))


def _without_servos(config: Run) -> tuple[tuple[str, float], ...]:
    return tuple((n, v) for n, v in config.set if not n.startswith(OF_SERVOS))
