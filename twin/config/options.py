"""Settings that several verbs share, one class a group of `--help`."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from twin.config.base import Settings
from twin.config.overrides import parse
from twin.config.seats import SIMULATED, check_seat, is_port, is_rig
from twin.config.types import (
    TRANSFER_FUNCTION,
    Flag,
    Integrator,
    OnFault,
    Overrides,
    Seed,
    Step,
    Texts,
    Unit,
)
from twin.errors import TwinError


@dataclass(frozen=True, kw_only=True)
class Output(Settings):
    """Where results go."""

    group: ClassVar[str] = "common"

    out: Path | None = None
    """File to write."""
    json: Flag = False
    """Print the results as one JSON object instead of a table."""
    force: Flag = False
    """Replace an existing file that is more than a simulation's recording or a report: a rig's
    recording, a calibration, a model, or what another program wrote."""


@dataclass(frozen=True, kw_only=True)
class Parameters(Settings):
    """Named parameters of the model."""

    group: ClassVar[str] = "model"

    set: Overrides = ()
    """NAME=VALUE: value of a named model parameter, for example gimbal_holder.mass=0.05; `twin
    parameters` lists the names with unit, value and meaning. Repeatable."""
    set_from: Path | None = None
    """JSON file of parameter names and values; `--set` takes precedence."""

    def validate(self) -> None:
        """Merge the file's parameters into `set`, once.

        Raises
        ------
        TwinError : the file cannot be read
        """
        super().validate()
        if self.set_from is not None:
            object.__setattr__(self, "set", tuple(parse(self.set, self.set_from).items()))
            object.__setattr__(self, "set_from", None)

    @property
    def overrides(self) -> dict[str, float]:
        """Parameter values by name."""
        return dict(self.set)


@dataclass(frozen=True, kw_only=True)
class Model(Parameters):
    """What is simulated."""

    group: ClassVar[str] = "model"

    scene: str = "flight"
    """Scene: flight, bench, turntable, or an MJCF file."""
    vehicle: Path | None = None
    """Description (TOML), OpenRocket design (.ork, for verbs with --motor) or MJCF file of the
    vehicle; the reference vehicle if omitted."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; that of the vehicle's description, or else the reference
    mechanism, if omitted."""
    model: Path | None = None
    """Identified model (JSON): the gimbal of `--gimbal transfer-function` or `--shadow
    transfer-function`, or the model of a rig that its timing verdict uses; the shipped model, which
    is of the reference mechanism, if omitted."""
    integrator: Integrator | None = None
    """Numerical integrator of the physics; if omitted, rk4 for simulated flights, implicitfast with
    a rig, on an elastic rail and for other verbs."""
    dt: Step | None = None
    """Physics time step [s]; if omitted, with rk4 a whole fraction of the control period, at most
    4 ms with a gimbal and 20 ms without moving parts; the scene's own (1 ms) otherwise."""


@dataclass(frozen=True, kw_only=True)
class SimulatedRig(Settings):
    """A simulated rig's tolerances and faults."""

    group: ClassVar[str] = "rig"

    fault: Texts = ()
    """Fault of a simulated rig, TARGET:KIND[:VALUE][@START[-END]] with times in s, for example
    potentiometer_x_a:glitch:0.2@3; an unknown target or kind is answered with those there are.
    Repeatable."""
    unit: Unit | None = None
    """Serial number of a simulated rig with random tolerances; the nominal rig if omitted."""


@dataclass(frozen=True, kw_only=True)
class Rig(SimulatedRig):
    """How a rig is used."""

    group: ClassVar[str] = "rig"

    calibration: Path | None = None
    """Calibration file (JSON) of the rig; the nominal geometry if omitted."""
    no_check: Flag = False
    """Skip the motion check before the run, which moves both axes by 2° for 1.6 s and refuses a
    servo that is dead, reversed, swapped or moves by the wrong angle."""


@dataclass(frozen=True, kw_only=True)
class Shadow(Settings):
    """The model that is simulated beside a rig."""

    group: ClassVar[str] = "rig"

    shadow: Literal["linkage", "transfer-function", "none"] | None = None
    """Model simulated beside a rig under the same commands, recorded as gimbal/simulated: servos
    and pushrods (linkage, the default), the identified model of `--model` (transfer-function), or
    none."""
    shadow_set: Overrides = ()
    """NAME=VALUE: value of a named parameter of that model alone, for example
    gimbal_servo_slew=8. `--set` changes a simulated rig, or the model beside a rig on a port.
    Repeatable."""


@dataclass(frozen=True, kw_only=True)
class FaultResponse(Settings):
    """What a run does when its rig fails."""

    group: ClassVar[str] = "rig"

    on_fault: OnFault | None = None
    """When the rig or one of its sensors fails: move the servos to neutral and end the run (end,
    the default), continue with the servos at neutral (neutral), or continue unchanged (ignore)."""


@dataclass(frozen=True, kw_only=True)
class Gimbal(Settings):
    """The component in the gimbal seat."""

    group: ClassVar[str] = "common"

    gimbal: str = "linkage"
    """Gimbal source: simulated servos and pushrods (linkage), an identified model
    (transfer-function), a simulated rig (emulator, or firmware on a simulated Nano), or the port of
    a rig such as /dev/ttyUSB0, COM3 or socket://127.0.0.1:5555."""


@dataclass(frozen=True, kw_only=True)
class Time(Settings):
    """Clock and randomness."""

    group: ClassVar[str] = "time"

    clock: Literal["lockstep", "wall"] | None = None
    """Simulation time, as fast as possible (lockstep), or real time (wall); wall for a rig on a
    port, lockstep otherwise, if omitted."""
    seed: Seed = 0
    """Random seed."""


@dataclass(frozen=True, kw_only=True)
class Run(Output, Time, Model, Shadow, Rig, Gimbal):
    """Settings of every run of the twin."""

    out: Path | None = None
    """Recording to write (.rrd), or a folder; runs/VERB-DATE-TIME.rrd if omitted, to
    which runs/latest-VERB.rrd then leads."""

    def validate(self) -> None:
        """Refuse settings without effect or in contradiction.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        check_seat(self.gimbal)
        if is_port(self.gimbal) and self.clock == "lockstep":
            raise TwinError(f"--clock lockstep: a rig on a port ({self.gimbal}) runs in real time")
        self._check_rig()
        if self.model is not None and not (self.gimbal == TRANSFER_FUNCTION or is_rig(self.gimbal)):
            raise TwinError(
                f"--model needs --gimbal transfer-function or a rig; --gimbal is {self.gimbal}"
            )

    def _check_rig(self) -> None:
        given = {
            "--calibration": self.calibration is not None,
            "--fault": bool(self.fault),
            "--unit": self.unit is not None,
            "--no-check": self.no_check,
            "--shadow": self.shadow is not None,
            "--shadow-set": bool(self.shadow_set),
            "--on-fault": getattr(self, "on_fault", None) is not None,
        }
        for flag, present in given.items():
            if present and not is_rig(self.gimbal):
                raise TwinError(
                    f"{flag} needs a rig (--gimbal emulator, firmware or a port); --gimbal is"
                    f" {self.gimbal}"
                )
        if self.shadow == "none" and self.shadow_set:
            raise TwinError("--shadow-set: --shadow none has no parameters")

    @property
    def shadow_parameters(self) -> dict[str, float]:
        """Parameters of the mechanism of the model beside a rig.

        `--set` means the gimbal that is simulated: a simulated rig, or else the model beside it.
        """
        given = {} if self.gimbal in SIMULATED else self.overrides
        return {k: v for k, v in given.items() if k.startswith("gimbal_")} | dict(self.shadow_set)

    @property
    def plant_scene(self) -> str:
        """Scene of what is simulated beside a rig."""
        return self.scene

    @property
    def rig_scene(self) -> str:
        """Scene that a rig stands on."""
        return "bench"

    @property
    def real_time(self) -> bool:
        """Whether the run keeps pace with the wall clock."""
        return self.clock == "wall" or (self.clock is None and is_port(self.gimbal))
