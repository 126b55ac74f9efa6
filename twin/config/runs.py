"""Settings of flights and step tests, and of what is derived from them."""

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal

from twin.config.options import FaultResponse, Run
from twin.config.seats import is_rig
from twin.config.types import (
    TURNTABLE,
    Axis,
    Count,
    Degrees,
    Duration,
    Flag,
    Frequency,
    Programme,
    Range,
    Signal,
)
from twin.errors import TwinError

Distance = Annotated[float, Range(-1e5, 1e5, "m")]
Speed = Annotated[float, Range(0.0, 50.0, "m/s")]
Direction = Annotated[float, Range(-180.0, 180.0, "°")]
MANOEUVRES = ("step", "doublet", "pitch-over")  # programmes with an amplitude and a time
OF_COMMANDS = ("time", "input", "input_unit", "ratio", "time_scale")  # columns of --commands
OF_SIGNAL = ("signal", "amplitude_deg", "repeats", "rate_limit_deg_s", "duration_s", "band_hz",
             "smallest_deg")  # fmt: skip
OBJECT = "object:"  # how a recording names a controller that was given as a Python object


@dataclass(frozen=True, kw_only=True)
class Fly(FaultResponse, Run):
    """Fly the vehicle headless and record it."""

    group: ClassVar[str] = "flight"
    effective = MappingProxyType(
        {
            "amplitude_deg": ("programme", MANOEUVRES),
            "at_s": ("programme", MANOEUVRES),
            "target_range_m": ("programme", ("point",)),
            "off_axis_deg": ("programme", ("point",)),
            "any_gain": ("gimbal", ("transfer-function",)),
            "hand_speed_m_s": ("launch", ("hand",)),
            "hand_attitude_deg": ("launch", ("hand",)),
            "hand_rate_deg_s": ("launch", ("hand",)),
        }
    )

    motor: Path | None = None
    """Motor file, or FILE:NAME for one of several motors in it: RASP (.eng), RockSim (.rse) or a
    thrust table of two columns (.csv); the vehicle's own motor if omitted."""
    launch: Literal["ramp", "hand", "stand"] = "ramp"
    """Launch from the vehicle's ramp; by hand, with random speed, attitude and rates of `--seed`;
    or upright from rest on a stand."""
    hand_speed_m_s: tuple[Speed, Speed] = (6.0, 1.0)
    """Mean and standard deviation of the speed along the nose, by hand [m/s]."""
    hand_attitude_deg: Annotated[float, Range(0.0, 60.0, "°")] = 5.0
    """Standard deviation of the attitude about each axis across the nose, by hand [°]."""
    hand_rate_deg_s: Annotated[float, Range(0.0, 720.0, "°/s")] = 30.0
    """Standard deviation of the angular rate about each axis, by hand [°/s]."""
    any_gain: Flag = False
    """Fly also an identified model whose gain is negative, or makes the attitude loop unstable."""
    programme: Programme = "hold"
    """Attitude programme: hold the launch direction, step, doublet, pitch-over, or steer to a
    point."""
    controller: str | None = None
    """Own controller in place of the attitude loop, FILE.py:NAME: a class or object with
    update(time, gimbal, vehicle) -> (x, y) [rad]. The file is executed."""
    target: tuple[Distance, Distance, Distance] | None = None
    """Fixed point to steer to: east, north and up from the launch point [m]."""
    target_range_m: Annotated[float, Range(1.0, 1e5, "m")] = 500.0
    """Distance of the point of `--programme point` from the launch point [m]."""
    off_axis_deg: tuple[Direction, Direction] = (0.0, 0.0)
    """Direction of that point from the launch direction: right and up [°]."""
    within: Annotated[float, Range(1e-3, 1e5, "m")] | None = None
    """Largest distance from the point that counts as reaching it [m]; a flight that misses by more
    ends with exit code 1. A miss is only reported if omitted."""
    amplitude_deg: Degrees = 5.0
    """Amplitude of the step, doublet or pitch-over [°]."""
    at_s: Annotated[float, Range(0.0, 36_000.0, "s")] = 3.0
    """Time at which the step, doublet or pitch-over begins [s]."""
    about: Literal["level", "x"] | None = None
    """Axis about which step, doublet and pitch-over turn the nose: horizontal, across the launch
    direction (level), or the vehicle's x axis (x, as a turntable can reproduce it); x with
    `--attitude base-gyro`, level otherwise, if omitted."""
    attitude: Literal["truth", "base-gyro"] = "truth"
    """Attitude that the controller sees: that of the simulated vehicle (truth), or the estimate
    from the IMU on the base of a rig that a third servo turns like the vehicle (base-gyro, the
    turntable of the thesis)."""
    control_hz: Frequency = 250.0
    """Rate of the controller [Hz]."""
    duration_s: Duration = 600.0
    """Longest flight [s]; it ends earlier on the ground or past the point."""
    repeat: Count = 1
    """Number of flights, each with the next seed; more than one writes a page with the spread of
    paths and, for a rig, the comparison with both models."""

    def validate(self) -> None:
        """Refuse settings without effect or in contradiction.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if self.at_s != Fly.at_s and self.at_s >= self.duration_s:
            raise TwinError(
                f"--at-s {self.at_s:g}: must be before the end, --duration-s {self.duration_s:g}"
            )
        if self.target is not None and self.programme not in ("hold", "point"):
            raise TwinError(f"--programme {self.programme} and --target exclude each other")
        if self.attitude == "base-gyro" and not is_rig(self.gimbal):
            raise TwinError(
                "--attitude base-gyro needs a rig (--gimbal emulator, firmware or a port);"
                f" --gimbal is {self.gimbal}"
            )
        if self.scene == TURNTABLE and self.attitude != "base-gyro":
            raise TwinError("--scene turntable needs --attitude base-gyro")
        if self.off_axis_deg != (0.0, 0.0) and self.target:
            raise TwinError("--off-axis-deg and --target exclude each other")
        if self.within is not None and self.programme != "point" and self.target is None:
            raise TwinError(f"--within {self.within:g}: needs --programme point or --target")
        if self.controller is not None and ":" not in self.controller:
            raise TwinError(
                f"--controller {self.controller}: must be FILE.py:NAME, for example own.py:Loop"
            )

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need."""
        return ("report",) if self.repeat > 1 else ()

    @property
    def controller_file(self) -> Path | None:
        """File of an own controller; None for the attitude loop and for a Python object."""
        if self.controller is None or self.controller.startswith(OBJECT):
            return None
        return Path(self.controller.rpartition(":")[0])

    @property
    def turns_about(self) -> str:
        """Axis of the programme, as given or as the attitude seat has it."""
        return self.about or ("x" if self.attitude == "base-gyro" else "level")

    @property
    def plant_scene(self) -> str:
        """Scene that the vehicle flies in, beside a rig that may stand on a turntable."""
        return "flight" if self.scene == TURNTABLE else self.scene

    @property
    def rig_scene(self) -> str:
        """Scene that a rig stands on."""
        return TURNTABLE if self.attitude == "base-gyro" else "bench"


@dataclass(frozen=True, kw_only=True)
class Step(FaultResponse, Run):
    """Command a clamped gimbal with a test signal and record its response."""

    group: ClassVar[str] = "signal"
    effective = MappingProxyType(
        {
            "duration_s": ("signal", ("chirp", "triangle", "dog-leg")),
            "band_hz": ("signal", ("chirp", "prbs", "multisine")),
            "smallest_deg": ("signal", ("staircase",)),
        }
    )

    scene: str = "bench"
    signal: Signal = "steps"
    """Test signal: steps back and forth, ever smaller steps (staircase), a logarithmic sweep
    (chirp), a pseudo-random binary sequence (prbs), many sines at once (multisine), slow ramps
    (triangle), or ramps with a change of slope (dog-leg)."""
    amplitude_deg: Degrees = 5.0
    """Largest angle, either way from zero [°]; at most the mechanism's stops."""
    axis: Axis = "both"
    """Axis excited; `both` excites one after the other."""
    repeats: Annotated[int, Range(1, 10_000)] = 3
    """Steps per axis and direction (after every three one of half the size), or periods of the
    other signals."""
    hold_s: Annotated[float, Range(0.01, 100.0, "s")] = 0.8
    """Time between two steps, and at rest before and after any signal [s]."""
    duration_s: Annotated[float, Range(0.1, 600.0, "s")] = 20.0
    """Length of one chirp, triangle or dog-leg [s]."""
    band_hz: tuple[
        Annotated[float, Range(0.01, 1000.0, "Hz")], Annotated[float, Range(0.01, 1000.0, "Hz")]
    ] = (0.2, 10.0)
    """Lowest and highest frequency of chirp, prbs and multisine [Hz]."""
    smallest_deg: Degrees = 0.05
    """Last and smallest step of the staircase [°]."""
    rate_limit_deg_s: Annotated[float, Range(1e-3, 1e6, "°/s")] | None = None
    """Largest rate of the command [°/s]; unlimited if omitted."""
    control_hz: Frequency = 500.0
    """Rate of commands and of recorded rows [Hz]."""
    commands: Path | None = None
    """Commands in place of a test signal: a recording, or a table (.csv, .log, .jsonl, .mat and
    others) with `--time` and `--input`."""
    time: str | None = None
    """Column of the time stamps of `--commands`."""
    input: str | None = None
    """Columns of the commands for x and y, separated by a comma; one column is for x, or for
    `--axis`."""
    input_unit: str = "rad"
    """Unit of the command columns: rad, deg, mrad or turn, us (pulse width), or percent (100 is the
    longest pulse, -100 the shortest)."""
    ratio: Annotated[float, Range(-100.0, 100.0)] | None = None
    """Gimbal angle per servo shaft angle, where the columns are shaft angles; they are gimbal
    angles if omitted."""
    time_scale: Annotated[float, Range(1e-12, 1e9, "s")] | None = None
    """Seconds per unit of the time column, for example 1e-3; 1 if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect or in contradiction.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        for name in OF_SIGNAL if self.commands else OF_COMMANDS:
            if getattr(self, name) != getattr(Step, name):
                flag = f"--{name.replace('_', '-')} {getattr(self, name)}"
                raise TwinError(
                    f"{flag}: --commands takes the place of the test signal"
                    if self.commands
                    else f"{flag}: needs --commands FILE"
                )
        if self.ratio == 0.0:
            raise TwinError("--ratio 0: must not be zero")

    def as_properties(self) -> dict[str, object]:
        """Settings as JSON values; none of a test signal that was not commanded."""
        values = super().as_properties()
        return {k: v for k, v in values.items() if not (self.commands and k in OF_SIGNAL)}
