"""What runs of the twin can be told: flights and steps."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import tyro

from twin.config.overrides import parse
from twin.config.seats import OF_SERVOS, check_seat, is_port, is_rig
from twin.config.types import (
    LARGEST_DT,
    LARGEST_SEED,
    LONGEST_FLIGHT,
    TRANSFER_FUNCTION,
    TURNTABLE,
    Flag,
    Integrator,
    OnFault,
    Programme,
    Signal,
    refuse_no_number,
)
from twin.errors import TwinError


@dataclass(frozen=True)
class Run:
    """What every run of the twin can be told."""

    scene: str = "flight"
    """A shipped scene, or an MJCF file."""
    gimbal: str = "linkage"
    """Who moves the gimbal: servos and pushrods (linkage), an identified model (transfer-function),
    or a rig: a simulated one (emulator, or firmware on a simulated Nano), or a port such as
    /dev/ttyUSB0, COM3 or socket://127.0.0.1:5555."""
    model: Path | None = None
    """Identified model (JSON) for `--gimbal transfer-function`, or of the rig, for what is said
    about its timing; the shipped one without it."""
    calibration: Path | None = None
    """Calibration (JSON) of the rig; what the drawings say without it."""
    fault: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """What is wrong with a simulated rig, for example potentiometer_x_a:glitch:0.2. Repeatable."""
    unit: int | None = None
    """Which of many simulated rigs, every tolerance drawn; the rig exactly as drawn without it."""
    vehicle: Path | None = None
    """MJCF file in place of the reference vehicle."""
    mechanism: Path | None = None
    """MJCF file in place of the reference mechanism."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE, any named model parameter, for example gimbal_holder.mass=0.05. Repeatable."""
    set_from: Path | None = None
    """JSON file of such names and values."""
    integrator: Integrator = "implicitfast"
    """How the physics steps."""
    dt: float | None = None
    """Physics step [s]; the scene's own, 1 ms, without it."""
    clock: Literal["lockstep", "wall"] | None = None
    """As fast as it goes, or in real time; without it a rig on a port decides for real time."""
    seed: int = 0
    """Of everything random."""
    out: Path | None = None
    """Recording to write; runs/<command>.rrd without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        refuse_no_number(self)
        if self.dt is not None and not 0 < self.dt <= LARGEST_DT:
            raise TwinError(
                f"--dt {self.dt:g}: the physics step must lie in 0 < dt ≤ {LARGEST_DT} s"
            )
        if not 0 <= self.seed < LARGEST_SEED:
            raise TwinError(f"--seed {str(self.seed)[:20]}: a seed is a whole number from 0")
        check_seat(self.gimbal)
        if is_port(self.gimbal) and self.clock == "lockstep":
            raise TwinError(f"--clock lockstep: a rig at {self.gimbal} lives in real time")
        _check_rig_flags(self)
        if self.model is not None and not (self.gimbal == TRANSFER_FUNCTION or is_rig(self.gimbal)):
            raise TwinError(
                f"--model is for --gimbal transfer-function, or a rig that it is a model of, not"
                f" {self.gimbal}"
            )

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


@dataclass(frozen=True)
class Fly(Run):
    """Fly the vehicle headless and record it."""

    motor: Path | None = None
    """RASP .eng file in place of the vehicle's own motor."""
    programme: Programme = "hold"
    """What the attitude is to do: hold the launch direction, step, doublet, pitch over, or steer to
    a point."""
    target: tuple[float, float, float] | None = None
    """A fixed point to steer to: east, north, up from the launch point [m]."""
    target_range_m: float = 500.0
    """Distance of the point of `--programme point`."""
    off_axis_deg: tuple[float, float] = (0.0, 0.0)
    """Its direction from the launch direction: to the right, and up."""
    amplitude_deg: float = 5.0
    """Of the step, doublet or pitch-over."""
    at_s: float = 3.0
    """When the step, doublet or pitch-over begins."""
    control_hz: float = 250.0
    """Rate of the controller."""
    duration_s: float = 120.0
    """Longest flight; it ends earlier on the ground, or once a point has been passed."""
    attitude: Literal["truth", "base-gyro"] = "truth"
    """What the controller sees of the attitude: the simulated vehicle (truth), or what gyro and
    accelerometer say on the base of a rig that a third servo turns as the vehicle turns about its
    x axis (base-gyro, the thesis's turntable)."""
    about: Literal["level", "x"] | None = None
    """Axis that step, doublet and pitch-over turn the nose about: level, across the launch
    direction, or the vehicle's own x, which a turntable plays (with base-gyro)."""
    on_fault: OnFault | None = None
    """When a rig fails or one of its sensors does: servos to neutral and end the flight (as without
    it), go on with the servos at neutral, or ignore it."""
    repeat: int = 1
    """How often to fly, each time with the next seed: spread of path and answers, and with a rig
    the same for its models; writes a page."""

    def __post_init__(self) -> None:
        """Refuse what cannot be flown, and flags that would be silently without effect.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().__post_init__()
        if not 0 < self.duration_s <= LONGEST_FLIGHT:
            raise TwinError(f"--duration-s {self.duration_s:g}: must lie in 0 to {LONGEST_FLIGHT}")
        if self.target is not None and self.programme not in ("hold", "point"):
            raise TwinError(f"--programme {self.programme} and --target exclude each other")
        self._check_attitude()
        if self.off_axis_deg != (0.0, 0.0) and (self.programme != "point" or self.target):
            raise TwinError("--off-axis-deg places the point of --programme point; nothing else")

    def _check_attitude(self) -> None:
        if self.attitude == "base-gyro" and not is_rig(self.gimbal):
            raise TwinError(
                f"--attitude base-gyro: --gimbal {self.gimbal} has no base with a gyro (emulator,"
                " firmware and ports have)"
            )
        if self.scene == TURNTABLE and self.attitude != "base-gyro":
            raise TwinError("--scene turntable is where a rig stands for --attitude base-gyro")

    @property
    def turns_about(self) -> str:
        """Axis of the programme, as told or as the attitude seat has it."""
        return self.about or ("x" if self.attitude == "base-gyro" else "level")

    @property
    def plant_scene(self) -> str:
        """Scene that the vehicle flies in, beside a rig that may stand on a turntable."""
        return "flight" if self.scene == TURNTABLE else self.scene

    @property
    def rig_scene(self) -> str:
        """Scene that a rig stands on."""
        return TURNTABLE if self.attitude == "base-gyro" else "bench"


@dataclass(frozen=True)
class Step(Run):
    """Excite a clamped gimbal and record its response."""

    scene: str = "bench"
    """A shipped scene, or an MJCF file."""
    signal: Signal = "steps"
    """What it is told: steps back and forth, ever smaller steps (staircase), a logarithmic sweep, a
    pseudo-random binary sequence, many sines at once, slow ramps, or ramps with a bend."""
    amplitude_deg: float = 5.0
    """Largest angle, either way from zero."""
    axis: Literal["x", "y", "both"] = "both"
    """Axis excited; `both` takes one after the other."""
    repeats: int = 3
    """Steps per axis and direction, or periods of the other signals."""
    hold_s: float = 0.8
    """Time between two steps, and at rest before and after any signal."""
    duration_s: float = 20.0
    """Length of one chirp, triangle or dog-leg."""
    band_hz: tuple[float, float] = (0.2, 10.0)
    """Lowest and highest frequency of chirp, prbs and multisine."""
    smallest_deg: float = 0.05
    """Last and smallest step of the staircase."""
    rate_limit_deg_s: float | None = None
    """Fastest change of the command; jumps stay jumps without it."""
    control_hz: float = 500.0
    """Rate of commands and of recorded rows."""
    on_fault: OnFault | None = None
    """When a rig fails or one of its sensors does: servos to neutral and end the run (as without
    it), go on with the servos at neutral, or ignore it."""


def _check_rig_flags(config: Run) -> None:
    """Refuse flags that would be silently without effect."""
    given = {
        "--calibration": config.calibration is not None,
        "--fault": bool(config.fault),
        "--unit": config.unit is not None,
        "--on-fault": getattr(config, "on_fault", None) is not None,
    }
    for flag, present in given.items():
        if present and not is_rig(config.gimbal):
            raise TwinError(
                f"{flag} is about a rig; --gimbal {config.gimbal} is none (emulator, firmware and"
                " ports are)"
            )


R = TypeVar("R", bound=Run)


def with_model(config: R, gimbal: str, **changes: object) -> R:
    """The same run with a model in the gimbal seat; what is about a rig alone goes.

    So do parameters of servos and rods where an identified model takes their place.
    """
    rig: dict[str, object] = {"calibration": None, "fault": (), "unit": None, "clock": "lockstep"}
    if isinstance(config, Fly):
        rig |= {"attitude": "truth", "scene": config.plant_scene, "about": config.turns_about}
    if isinstance(config, Fly | Step):
        rig["on_fault"] = None
    if gimbal != TRANSFER_FUNCTION:
        rig["model"] = None
    else:
        rig |= _without_servos(config, changes)
    return replace(config, **{**rig, "gimbal": gimbal, **changes})  # type: ignore[arg-type]


def heeded(config: Run) -> Run:
    """A recorded run without overrides that changed nothing in it and are refused by now."""
    if config.gimbal != TRANSFER_FUNCTION:
        return config
    return replace(config, **_without_servos(config, {}))  # type: ignore[arg-type]


def _without_servos(config: Run, changes: dict[str, object]) -> dict[str, object]:
    """Overrides of a run but those of servos and rods; takes what it adds out of `changes`."""
    given = parse(config.set, config.set_from)
    kept = {name: value for name, value in given.items() if not name.startswith(OF_SERVOS)}
    if len(kept) == len(given):
        return {}
    now = changes.pop("set", config.set)
    assert isinstance(now, tuple)
    added = now[len(config.set) :]  # asked for of this run, so to be refused
    return {"set": (*(f"{n}={v!r}" for n, v in kept.items()), *added), "set_from": None}


def as_properties(config: Run) -> dict[str, object]:
    """Return a run's configuration as JSON values, for the recording."""
    return {k: str(v) if isinstance(v, Path) else v for k, v in asdict(config).items()}
