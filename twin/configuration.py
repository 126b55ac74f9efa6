"""What each command can be told; the command line is derived from these."""

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import tyro

from twin.errors import TwinError
from twin.seat_names import check_seat, is_port, is_rig

Signal = Literal["steps", "staircase", "chirp", "prbs", "multisine", "triangle", "dog-leg"]
Programme = Literal["hold", "step", "doublet", "pitch-over", "point"]
Seat = Literal["linkage", "transfer-function"]
Kind = Literal["emulator", "firmware"]
OnFault = Literal["end", "neutral", "ignore"]
Integrator = Literal["implicitfast", "euler", "rk4", "ab1", "ab2", "ab3", "ab4"]
# s; at 8 ms the rail of the ramp is no longer stable, and rods gape by a third of a millimetre at 4
LARGEST_DT = 0.005
LONGEST_FLIGHT = 36_000.0  # s
LARGEST_SEED = 2**53  # whole numbers that a model's numerics hold exactly
TURNTABLE, TRANSFER_FUNCTION = "turntable", "transfer-function"
Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]  # --json, and no --no-json


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
        _refuse_no_number(self)
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


@dataclass(frozen=True)
class Converge:
    """Vary a flight's time step over integrators: errors, orders, and what real time allows."""

    flight: Literal["baseline", "closed-loop"] = "baseline"
    """Free flight with the gimbal at rest, where everything is smooth; or steered from the launch
    on."""
    gimbal: Literal["linkage", "transfer-function"] = "transfer-function"
    """Who moves the gimbal of the steered flight."""
    model: Path | None = None
    """Identified model (JSON) for `--gimbal transfer-function`; the shipped one without it."""
    vehicle: Path | None = None
    """MJCF file in place of the reference vehicle."""
    mechanism: Path | None = None
    """MJCF file in place of the reference mechanism."""
    motor: Path | None = None
    """RASP .eng file in place of the vehicle's own motor."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE, any named model parameter. Repeatable."""
    set_from: Path | None = None
    """JSON file of such names and values."""
    integrators: tuple[Integrator, ...] = ("ab1", "ab2", "ab3", "ab4", "implicitfast", "rk4")
    """Which to compare."""
    dt_ms: tuple[float, ...] = ()
    """Time steps; 20 to 2.5 ms for the baseline, 4 to 0.5 ms for the closed loop without it."""
    integrator: Integrator = "ab2"
    """Whose flights the figure shows, and the verdict is about."""
    tolerance_m: float = 0.1
    """Largest error of the path that counts as converged."""
    duration_s: float = 3.0
    """Length of the flight at most."""
    control_hz: float = 250.0
    """Rate of the controller."""
    seed: int = 0
    """Of everything random."""
    out: Path | None = None
    """Page to write (.html); runs/converge.html without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        _refuse_no_number(self)


@dataclass(frozen=True)
class Rig:
    """Serve a simulated rig in real time, to this machine only, until it is interrupted."""

    kind: Kind = "emulator"
    """The firmware's behaviour in Python, or the real firmware on a simulated Nano."""
    port: int | None = None
    """TCP port on 127.0.0.1, 0 for a free one; a pseudo-terminal without it."""
    link: Path | None = None
    """Name to give the pseudo-terminal, for example /tmp/rig."""
    scene: Literal["bench", "turntable"] = "bench"
    """What it stands on: clamped, or on a base that its third servo turns."""
    fault: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """TARGET:KIND[:VALUE][@START[-END]], for example potentiometer_x_a:glitch:0.2. Repeatable."""
    unit: int | None = None
    """Which of many rigs, every tolerance drawn; the rig exactly as drawn without it."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE, any named parameter of the mechanism. Repeatable."""
    seed: int = 0
    """Of the sensors' noise."""
    duration_s: float | None = None
    """How long to serve."""
    json: Flag = False
    """Print where it is served as one JSON object."""


@dataclass(frozen=True)
class Calibrate:
    """Drive a rig to its four limit switches and write what its pulses and readings mean."""

    gimbal: str = "emulator"
    """The rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    out: Path = Path("calibration.json")
    """File to write."""
    switch_deg: tuple[float, float, float, float] | None = None
    """Angles at which switches +x, -x, +y, -y close; those of the printed calibration rig
    without it."""
    repeats: int = 3
    """Approaches per switch and place of the other servo."""
    fault: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """What is wrong with a simulated rig. Repeatable."""
    unit: int | None = None
    """Which of many simulated rigs; the rig exactly as drawn without it."""
    seed: int = 0
    """Of a simulated rig's noise, and of the approaches."""
    json: Flag = False
    """Print the calibration as one JSON object instead of a summary."""


@dataclass(frozen=True)
class Mirror(Run):
    """Let the MuJoCo gimbal follow a rig's live readings, or those on a tape, and record both."""

    scene: str = "bench"
    """A shipped scene, or an MJCF file."""
    gimbal: str = "emulator"
    """The rig: emulator, firmware, or a port such as /dev/ttyUSB0 or socket://127.0.0.1:5555."""
    steer: Literal["keys", "joystick"] | None = None
    """Steer with the arrow keys (space: zero, q: end) or the rig's joystick; only watch without
    it."""
    tape: Path | None = None
    """Follow a recorded run (.rrd) instead of a rig, as fast as it goes unless --clock wall."""
    duration_s: float | None = None
    """How long; until it is interrupted without it."""
    serve: int | None = None
    """Port on this machine where the Rerun viewer may watch live."""
    dt: float | None = 0.0005
    """Physics step [s]."""
    control_hz: float = 2000.0
    """Rate at which the rig is looked at."""

    def __post_init__(self) -> None:
        """Refuse what fits nothing.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().__post_init__()
        if self.tape is None and not is_rig(self.gimbal):
            raise TwinError(
                f"--gimbal {self.gimbal}: twin mirror follows a rig (emulator, firmware or a"
                " port) or a --tape"
            )
        if self.tape is not None and self.steer is not None:
            raise TwinError(f"--steer {self.steer}: a tape cannot be steered")
        if self.duration_s is not None and not self.duration_s > 0:
            raise TwinError(f"--duration-s {self.duration_s}: must be greater than zero")

    @property
    def real_time(self) -> bool:
        """Whether the run keeps pace with the wall clock; only a tape may go faster."""
        return self.clock == "wall" or (self.clock is None and self.tape is None)


@dataclass(frozen=True)
class Identify:
    """Make a model of a gimbal from what it was told and what was measured of it."""

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Recordings (.rrd) or tables (.csv, .tsv, .txt, .mat), fitted together."""
    linkage: Flag = False
    """Fit the servo and mechanism parameters of the MJCF instead, for `--set-from`."""
    poles: int = 2
    """Of every transfer function."""
    zeros: int = 0
    """Of every transfer function, fewer than poles."""
    delay: str = "free"
    """`free`, or the known transport delay [s]."""
    max_delay_ms: float | None = None
    """Longest delay searched; 100 ms or ten samples without it."""
    select_order: Flag = False
    """Choose poles and zeros on steps held out; `--poles` and `--zeros` are then ignored."""
    servo: Flag = False
    """Fit servos with bounded speed, dead band and backlash."""
    structure: Literal["best", "speed", "command"] = "best"
    """Of such a servo: its own loop saturates (speed), or its command is made ramps (command)."""
    coupling: Literal["auto", "none", "full"] = "auto"
    """Cross channels: where an axis follows the other's command by 2 %, never, or always."""
    time: str | None = None
    """Column of time stamps of a table."""
    input: str | None = None
    """Columns of commands, separated by commas."""
    angle: str | None = None
    """Columns of measured angles; of a recording the signal, gimbal/measured without it."""
    rate: str | None = None
    """Columns of gyro rates, per second; of a recording the signal, for example sensors/gyro."""
    unit: str | None = None
    """Of the columns: rad, deg, mrad or turn."""
    input_unit: str | None = None
    """Of the commands, where it is another."""
    time_scale: float | None = None
    """Seconds per unit of the time column, for example 1e-3."""
    commands: Path | None = None
    """Table of the commands with time stamps of their own."""
    from_pulses: Flag = False
    """Take the pulses of a rig for its commands, from when they were in force: the delay is then
    without the wait for the next pulse frame."""
    gyro_delay_ms: float = 0.0
    """Delay of the gyro's own filter, taken out."""
    initial: Literal["rest", "free"] = "rest"
    """Whether the gimbal stood still when a record starts, or may have moved."""
    check: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """Another recording or table, only to be predicted. Repeatable."""
    both: Flag = False
    """Write the model of a single axis for x and y alike, so that it can be flown."""
    parameters: tuple[str, ...] = ()
    """Which parameters `--linkage` fits; the servo's and the joints' without it."""
    mechanism: Path | None = None
    """MJCF file in place of the reference mechanism, for `--linkage`."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE, where `--linkage` starts or what it takes as known. Repeatable."""
    set_from: Path | None = None
    """JSON file of such names and values."""
    out: Path | None = None
    """File to write (.json); runs/model.json, or runs/set.json with `--linkage`, without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        _refuse_no_number(self)
        if self.out is not None and self.out.suffix.lower() != ".json":
            raise TwinError(f"--out {self.out}: what is identified is a .json file")


@dataclass(frozen=True)
class Compare:
    """Put two motions of a gimbal side by side: simulated and measured, rig and model."""

    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """The reference and the other recording; or one that holds measured and simulated angles."""
    fail_below: float | None = None
    """End with 1 if the fit of an axis is below this many percent."""
    longest_delay_ms: float = 250.0
    """Longest delay of one motion behind the other that is looked for."""
    out: Path | None = None
    """Recording of both and their difference; runs/compare.rrd without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        _refuse_no_number(self)


@dataclass(frozen=True)
class Replay:
    """Fly a recorded run again: bit for bit, or with something changed to see what it would do."""

    recording: Annotated[Path, tyro.conf.Positional]
    """A recording (.rrd) of `twin fly` or `twin step`."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """NAME=VALUE on top of what was set then, for example a gain of the controller. Repeatable."""
    integrator: Integrator | None = None
    """Another integrator."""
    dt: float | None = None
    """Another physics step [s]."""
    gimbal: Literal["linkage", "transfer-function", "emulator", "firmware"] | None = None
    """Another model in the gimbal seat, or a simulated rig; what was recorded of a rig stands in
    for it otherwise."""
    control_hz: float | None = None
    """Another rate of the controller."""
    seed: int | None = None
    """Another seed."""
    force: Flag = False
    """Also where versions or the model are others than they were."""
    out: Path | None = None
    """Recording to write; beside the old one, .replay.rrd, without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        _refuse_no_number(self)


@dataclass(frozen=True)
class Report:
    """Write one page about recordings of a gimbal: figures, plots, and how they compare."""

    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Recordings; the first is the reference, usually the hardware."""
    model: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """Identified model (JSON) that answers the first recording's commands. Repeatable."""
    title: str = "Gimbal report"
    """Of the page."""
    out: Path | None = None
    """Page to write (.html); runs/report.html without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""


@dataclass(frozen=True)
class View:
    """Open a recording in the Rerun viewer."""

    recording: Annotated[Path, tyro.conf.Positional]
    """A recording (.rrd)."""
    web: Flag = False
    """Serve it to a browser on this machine instead of opening a window."""
    port: int = 9090
    """Port of `--web`, on loopback only."""


@dataclass(frozen=True)
class Doctor:
    """Say what this machine has, what it lacks, and what to do about it."""

    json: Flag = False
    """Print the findings as one JSON object."""


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


def _refuse_no_number(config: Run | Converge | Replay | Identify | Compare) -> None:
    for name, value in asdict(config).items():
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and not math.isfinite(number):
                raise TwinError(f"--{name.replace('_', '-')} {number}: must be finite")


R = TypeVar("R", bound=Run)


def with_model(config: R, gimbal: str, **changes: object) -> R:
    """The same run with a model in the gimbal seat; what is about a rig alone goes."""
    rig: dict[str, object] = {"calibration": None, "fault": (), "unit": None, "clock": "lockstep"}
    if isinstance(config, Fly):
        rig |= {"attitude": "truth", "scene": config.plant_scene, "about": config.turns_about}
    if isinstance(config, Fly | Step):
        rig["on_fault"] = None
    if gimbal != TRANSFER_FUNCTION:
        rig["model"] = None
    return replace(config, **{**rig, "gimbal": gimbal, **changes})  # type: ignore[arg-type]


def as_properties(config: Run) -> dict[str, object]:
    """Return a run's configuration as JSON values, for the recording."""
    return {k: str(v) if isinstance(v, Path) else v for k, v in asdict(config).items()}
