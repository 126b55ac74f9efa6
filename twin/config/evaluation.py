"""Settings of the verbs that read recordings and tables."""

from dataclasses import KW_ONLY, dataclass, fields
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from twin.config.base import Settings, flag
from twin.config.options import Output, Parameters, Rig, Time
from twin.config.seats import check_seat
from twin.config.types import POSITIONAL, REPEATABLE, Flag, Range
from twin.errors import TwinError

Files = Annotated[tuple[Path, ...], REPEATABLE]
Milliseconds = Annotated[float, Range(0.0, 60_000.0, "ms")]


@dataclass(frozen=True, kw_only=True)
class Columns(Settings):
    """Columns of a table (.csv, .log, .jsonl, .mat and others); a recording needs none of these."""

    group: ClassVar[str] = "table"

    time: str | None = None
    """Column of the time stamps."""
    input: str | None = None
    """Columns of the commands, separated by commas."""
    angle: str | None = None
    """Columns of the measured angles, separated by commas; of a recording the signal,
    gimbal/measured if omitted."""
    angle_unit: str | None = None
    """Unit of the angle columns: rad, deg, mrad, turn, counts or 1 (any other); rad if omitted."""
    input_unit: str | None = None
    """Unit of the command columns: those of `--angle-unit`, us (pulse width) or percent; as
    `--angle-unit` if omitted."""
    time_scale: Annotated[float, Range(1e-12, 1e9, "s")] | None = None
    """Seconds per unit of the time column, for example 1e-3; 1 if omitted."""
    commands: Path | None = None
    """Table of the commands with their own time stamps; if omitted, a command begins at the sample
    that first shows it."""
    input_stamps: Literal["exact", "sampled"] | None = None
    """Without `--commands`: each command was given at the sample that first shows it (exact, as in
    the log of the control loop itself), or at any time since the sample before (sampled). If
    omitted, like exact, with the delay's interval widened by one sampling period."""
    before: str | None = None
    """Commands in force before the first row, separated by commas, in the unit of the commands."""

    @property
    def given(self) -> tuple[str, ...]:
        """Flags about columns that were given."""
        names = (f.name for f in fields(Columns) if getattr(self, f.name) is not None)
        return tuple(f"--{name.replace('_', '-')}" for name in names)


@dataclass(frozen=True, kw_only=True)
class Live(Settings):
    """A gimbal that is measured until its model is known well enough."""

    group: ClassVar[str] = "measurement"

    live: str | None = None
    """Measure this gimbal in place of reading files: linkage, transfer-function, emulator, firmware
    or the port of a rig. Its test signals are chosen by what each is expected to tell."""
    until: str | None = None
    """Half widths of 95 % intervals at which the measurement ends, of every axis, for example
    delay:1ms,bandwidth:3%. Names: gain, delay, bandwidth, natural-frequency, damping."""
    within_s: Annotated[float, Range(5.0, 3600.0, "s")] = 300.0
    """Longest motion [s]."""
    amplitude_deg: Annotated[float, Range(0.1, 90.0, "°")] = 5.0
    """Largest commanded angle, either way from zero [°]; at most the mechanism's stops."""
    model: Path | None = None
    """Identified model (JSON) with `--live transfer-function`; the shipped model if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if (self.live is None) != (self.until is None):
            raise TwinError("--live SEAT and --until FIGURE:HALF_WIDTH: give both or neither")
        if self.live is not None:
            try:
                check_seat(self.live)
            except TwinError as error:
                raise TwinError(str(error).replace("--gimbal", "--live", 1)) from None
        for f in (f for kind in (Live, Rig, Time) for f in fields(kind)):
            if self.live is None and getattr(self, f.name, f.default) != f.default:
                raise TwinError(f"{flag(f.name)} {getattr(self, f.name)}: needs --live SEAT")


@dataclass(frozen=True)
class Identify(Columns, Output, Live, Time, Parameters, Rig):
    """Estimate a model of a gimbal from its commands and measured angles and rates."""

    group: ClassVar[str] = "estimation"

    sources: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Recordings (.rrd) or tables (.csv, .txt, .log, .jsonl, .mat and others), fitted together."""
    _: KW_ONLY
    linkage: Flag = False
    """Fit servo and mechanism parameters of the MJCF model instead, for `--set-from`."""
    poles: Annotated[int, Range(1, 12)] = 2
    """Poles of every transfer function."""
    zeros: Annotated[int, Range(0, 11)] = 0
    """Zeros of every transfer function, fewer than poles."""
    delay: str = "free"
    """Transport delay: free (estimated), or its known value [s]."""
    max_delay_ms: Annotated[float, Range(1e-3, 60_000.0, "ms")] | None = None
    """Longest delay searched [ms]; the longer of 100 ms and ten samples if omitted."""
    select_order: Flag = False
    """Choose the numbers of poles and zeros on held-out steps; `--poles` and `--zeros` are
    ignored."""
    servo: Flag = False
    """Fit servos with speed limit, dead band and backlash; takes some two minutes for an axis of
    thousands of readings."""
    structure: Literal["best", "speed", "clipped", "command", "set-point"] = "best"
    """Structure with `--servo`: the servo's own loop saturates (speed), its speed is clipped
    (clipped), its command is rate-limited (command), or it follows a set point of bounded speed
    (set-point)."""
    coupling: Literal["auto", "none", "full"] = "auto"
    """Cross channels: where an axis follows the other's command by 2 % (auto), never, or always."""
    rate: str | None = None
    """Columns of gyro rates, per second; of a recording the signal, for example sensors/gyro."""
    from_pulses: Flag = False
    """Take a rig's pulse widths as commands, from the time they took effect; the delay then
    excludes the wait for the next pulse frame."""
    gyro_delay_ms: Annotated[float, Range(0.0, 1000.0, "ms")] = 0.0
    """Delay of the gyro's own low-pass [ms], removed from `--rate`."""
    initial: Literal["rest", "free"] = "rest"
    """Whether the gimbal was at rest when a record starts, or may have moved (free)."""
    check: Files = ()
    """Recording or table for validation: predicted, not fitted. Repeatable."""
    check_commands: Path | None = None
    """With `--commands`: table of the commands of the `--check` table, with stamps of their own."""
    check_only: Flag = False
    """Print what the records can determine and how well, and what to record for the rest; no model
    is written. Bounds of a servo are searched in the structure speed alone."""
    both: Flag = False
    """Use the model of a single axis for both axes, so that it can be flown."""
    parameters: tuple[str, ...] = ()
    """Parameters that `--linkage` fits; those of servos and joints if omitted."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism for `--linkage`; the reference mechanism if omitted."""
    out: Path | None = None
    """File to write (.json); runs/model-DATE-TIME.json, or runs/set-DATE-TIME.json with
    `--linkage`, if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect or in contradiction.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if not self.sources and self.live is None:
            raise TwinError("twin identify needs a recording or table")
        self._check_live()
        if self.check_only and (self.linkage or self.check or self.out is not None):
            raise TwinError(
                "--check-only writes no model; it excludes --linkage, --check and --out"
            )
        if self.check_commands is not None and (self.commands is None or len(self.check) != 1):
            raise TwinError(
                f"--check-commands {self.check_commands}: needs --commands and one --check table"
            )
        if self.check_only and self.structure not in ("best", "speed"):
            raise TwinError(
                f"--structure {self.structure}: --check-only searches bounds in the structure speed"
                " alone; leave it out"
            )
        for name, other in (
            ("structure", "servo"), ("parameters", "linkage"), ("mechanism", "linkage"),
        ):  # fmt: skip
            given, default = getattr(self, name), getattr(Identify, name)
            if given != default and not getattr(self, other) and self.live is None:
                raise TwinError(f"{flag(name)}: needs {flag(other)}")
        if self.set and not self.linkage and self.live is None:
            raise TwinError(
                f"--set {self.set[0][0]}={self.set[0][1]:g}: needs --linkage or --live; a transfer"
                " function is of the records alone"
            )
        if self.from_pulses and self.linkage:
            raise TwinError("--from-pulses excludes --linkage, which always uses the pulses")
        if self.gyro_delay_ms and not self.rate:
            raise TwinError("--gyro-delay-ms needs --rate (the gyro columns)")
        if self.out is not None and self.out.suffix.lower() != ".json":
            raise TwinError(f"--out {self.out}: must be a .json file")

    def _check_live(self) -> None:
        excluded = (
            "sources", "linkage", "check_only", "zeros", "delay", "servo", "select_order", "rate",
            "angle", "initial", "both", "time", "input", "commands",
        )  # fmt: skip
        for name in excluded if self.live is not None else ():
            if getattr(self, name) != getattr(Identify, name):
                what = "files" if name == "sources" else flag(name)
                raise TwinError(f"--live {self.live}: measures a linear model; it excludes {what}")

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return ("sysid",) if self.linkage else ()


@dataclass(frozen=True)
class Compare(Columns, Output, Parameters):
    """Compare two motions of a gimbal (simulated and measured), or flights without a gimbal."""

    group: ClassVar[str] = "comparison"

    recordings: Annotated[tuple[Path, ...], POSITIONAL]
    """The reference and the other, recordings or tables; or one recording that holds measured and
    simulated angles."""
    _: KW_ONLY
    with_: str | None = None
    """Simulate a gimbal with the commands of the one file and compare it: servos and pushrods
    (linkage), or an identified model (JSON)."""
    ratio: Annotated[float, Range(-100.0, 100.0)] | None = None
    """Gimbal angle per servo shaft angle, where the columns of a table are shaft angles."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism for `--with linkage`; the reference mechanism if omitted.
    """
    drift: Flag = False
    """Of one recording of a rig: estimate gain, delay, zero, speed, backlash and friction over time
    with their intervals, and name what changes during the run, since when, by how much."""
    explain: Flag = False
    """Of one recording of a rig: give the share of each effect of the model (calibration error,
    delay, sensor lag, slew limit, servo gain, backlash, friction, dead band, wait for the pulse
    frame, load) in the difference, and what none explains."""
    fail_below: Annotated[float, Range(-1e6, 100.0, "%")] | None = None
    """Exit with 1 if the fit of an axis, delay not removed, is below this value [%]."""
    longest_delay_ms: Milliseconds = 250.0
    """Longest delay of one motion behind the other that is searched [ms]."""
    out: Path | None = None
    """Recording of both, and of gimbals their difference; runs/compare-DATE-TIME.rrd if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect or in contradiction.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if self.with_ is not None and not self.with_.lower().endswith((".json", "linkage")):
            raise TwinError(f"--with {self.with_}: must be linkage, or an identified model (.json)")
        if self.with_ is not None and len(self.recordings) != 1:
            raise TwinError(
                f"--with {self.with_}: takes one file, not {len(self.recordings)}, and simulates"
                " the other motion"
            )
        if self.with_ is not None and self.commands is not None:
            raise TwinError("--with: not with --commands; give one table with commands and angles")
        given = {"--ratio": self.ratio, "--mechanism": self.mechanism, "--set": self.set or None}
        for name, value in given.items():
            again = (self.drift or self.explain) and name != "--ratio"
            if value is not None and self.with_ is None and not again:
                raise TwinError(f"{name} {value}: needs --with linkage or --with model.json")
        for name, asked in (("--drift", self.drift), ("--explain", self.explain)):
            if asked and (self.with_ is not None or len(self.recordings) != 1):
                raise TwinError(f"{name}: takes one recording of a rig with a model beside it")


@dataclass(frozen=True)
class History(Output):
    """Compare the recordings of one board over time with the model beside them."""

    group: ClassVar[str] = "history"

    recordings: Annotated[tuple[Path, ...], POSITIONAL]
    """Recordings (.rrd) of a rig that has a model beside it, or folders of such."""
    _: KW_ONLY
    board: str | None = None
    """Serial number of the board, or its beginning, where the recordings are of several boards."""
    mechanism: Path | None = None
    """MJCF file of the gimbal mechanism; the reference mechanism if omitted."""
    out: Path | None = None
    """Page to write (.html); runs/history-DATE-TIME.html if omitted."""


@dataclass(frozen=True)
class Report(Columns, Output):
    """Write one page about recordings of a gimbal: figures, plots and their comparison."""

    group: ClassVar[str] = "report"

    recordings: Annotated[tuple[Path, ...], POSITIONAL]
    """Recordings or tables; the first is the reference, usually the hardware."""
    _: KW_ONLY
    model: Files = ()
    """Identified model (JSON) to simulate with the commands of the first recording. Repeatable."""
    title: str | None = None
    """Title of the page; Flight report or Gimbal report if omitted."""
    out: Path | None = None
    """Page to write (.html); runs/report-DATE-TIME.html if omitted."""

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return ("report",)
