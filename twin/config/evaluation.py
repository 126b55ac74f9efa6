"""What the commands that make knowledge of recordings can be told."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Literal

import tyro

from twin.config.types import Flag, Integrator, refuse_no_number
from twin.errors import TwinError


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns of a table (.csv, .tsv, .txt, .mat) are what; a recording knows its own."""

    time: str | None = None
    """Column of time stamps of a table."""
    input: str | None = None
    """Columns of commands, separated by commas."""
    angle: str | None = None
    """Columns of measured angles, separated by commas."""
    unit: str | None = None
    """Of the columns: rad, deg, mrad or turn; rad without it."""
    input_unit: str | None = None
    """Of the commands, where it is another."""
    time_scale: float | None = None
    """Seconds per unit of the time column, for example 1e-3."""
    commands: Path | None = None
    """Table of the commands with time stamps of their own. Without it they change at the sample
    that first shows them."""
    input_stamps: Literal["exact", "sampled"] | None = None
    """Without `--commands`: they were given at the sample that first shows them (exact), as in the
    log of the loop that gives them, or at any time since the sample before (sampled). Without it
    as `exact`, with delays uncertain by a period."""
    before: str | None = None
    """Commands that held before the first row, separated by commas, in their unit."""

    @property
    def told(self) -> tuple[str, ...]:
        """Flags about columns that were given."""
        given = (f.name for f in fields(Columns) if getattr(self, f.name) is not None)
        return tuple(f"--{name.replace('_', '-')}" for name in given)


@dataclass(frozen=True)
class Identify(Columns):
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
    rate: str | None = None
    """Columns of gyro rates, per second; of a recording the signal, for example sensors/gyro. So
    does `--angle` name one, gimbal/measured without it."""
    from_pulses: Flag = False
    """Take the pulses of a rig for its commands, from when they were in force: the delay is then
    without the wait for the next pulse frame."""
    gyro_delay_ms: float = 0.0
    """Delay of the gyro's own filter, taken out of `--rate`."""
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
        refuse_no_number(self)
        if self.from_pulses and self.linkage:
            raise TwinError("--from-pulses: --linkage takes a recording's pulses by itself")
        if self.gyro_delay_ms and not self.rate:
            raise TwinError(f"--gyro-delay-ms {self.gyro_delay_ms:g}: of what? --rate names a gyro")
        if self.gyro_delay_ms < 0.0:
            raise TwinError(f"--gyro-delay-ms {self.gyro_delay_ms:g}: no filter is ahead of time")
        if self.max_delay_ms is not None and self.max_delay_ms <= 0.0:
            raise TwinError(f"--max-delay-ms {self.max_delay_ms:g}: must be more than 0")
        if self.out is not None and self.out.suffix.lower() != ".json":
            raise TwinError(f"--out {self.out}: what is identified is a .json file")


@dataclass(frozen=True)
class Compare(Columns):
    """Put two motions of a gimbal side by side: simulated and measured, rig and model."""

    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """The reference and the other, recordings or tables; or one recording that holds measured and
    simulated angles."""
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
        refuse_no_number(self)


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
        refuse_no_number(self)


@dataclass(frozen=True)
class Report(Columns):
    """Write one page about recordings of a gimbal: figures, plots, and how they compare."""

    recordings: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Recordings or tables; the first is the reference, usually the hardware."""
    model: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """Identified model (JSON) that answers the first recording's commands. Repeatable."""
    title: str = "Gimbal report"
    """Of the page."""
    out: Path | None = None
    """Page to write (.html); runs/report.html without it."""
    json: Flag = False
    """Print the numbers as one JSON object instead of a summary."""

    def __post_init__(self) -> None:
        """Refuse what is no number.

        Raises
        ------
        TwinError : the flag and its value
        """
        refuse_no_number(self)


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
        refuse_no_number(self)


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
