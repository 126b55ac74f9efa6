"""Open and connect the rig that `--gimbal` names."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from analysis.recording import Recording
from hardware.calibration import Calibration
from hardware.calibration import read as read_calibration
from hardware.emulator import Injection, parse
from hardware.events import ReadingsDropped
from hardware.frames import POTENTIOMETER_NAMES, Pair, SensorFrame
from hardware.fusion import Fusion
from hardware.link import Link
from hardware.parts import POTENTIOMETER_TRAVEL
from hardware.rig import Rig, in_process
from twin import status
from twin.config import TURNTABLE
from twin.config.seats import SIMULATED, check_seat, is_rig
from twin.errors import TwinError
from twin.hil.bench import BenchPlant
from twin.hil.check import MotionChecked, check_motion
from twin.hil.gimbal import RigGimbal
from twin.hil.simulated import Device, make_device, nominal_calibration, parameters
from twin.hil.tolerances import vary
from twin.hil.turntable import measure_base
from twin.plant.model.model import ModelConfig, TwinModel, load
from twin.plant.plant import Plant

OWN = (
    "without --calibration the maps of a simulated rig are taken from its own parameters;"
    " twin calibrate measures them"
)
NOMINAL = "no --calibration: nominal maps, angles unproven; run twin calibrate first"
LONG_AGO = -1.0  # s; when the wires of absent potentiometers opened
RIG_PARAMETERS = ("gimbal_", TURNTABLE)  # prefixes of names; the second for turntables only


@dataclass(frozen=True)
class RigOptions:
    """Options of opening a rig.

    Attributes
    ----------
    seat : `emulator`, `firmware` or a port
    calibration : JSON file of this rig; nominal values where None
    unit : serial number of a simulated rig with random tolerances; None is the nominal rig
    faults : of a simulated rig, see `hardware.emulator.parse`
    seed : of the noise of a simulated rig
    mechanism : MJCF file in place of the reference mechanism
    overrides : named parameters; a rig uses those of mechanism and turntable
    scene : `bench`, or `turntable` with a base that turns
    watch : neither arm nor command it
    fuse : estimate angles; not needed for a calibration
    minimal : a rig without potentiometers; with `calibration` the file decides
    track : travel of a simulated rig's potentiometers [rad]; with `calibration` the file decides
    check : make the motion check before a run that commands the rig; None leaves it out silently
    """

    seat: str
    calibration: Path | None = None
    unit: int | None = None
    faults: tuple[str, ...] = ()
    seed: int = 0
    mechanism: Path | None = None
    overrides: Mapping[str, float] = field(default_factory=dict)
    scene: str = "bench"
    watch: bool = False
    fuse: bool = True
    minimal: bool = False
    track: float = POTENTIOMETER_TRAVEL
    check: bool | None = None


def lead(options: RigOptions) -> Pair:
    """Feed-forward of the turntable servo per rate [s] and per acceleration [s²]."""
    first, second = _model(options, TURNTABLE).mj.numeric("turntable_lead").data.tolist()
    return first, second


def device(options: RigOptions) -> Device:
    """A simulated rig with a separate scene.

    Raises
    ------
    TwinError, HardwareError : unknown fault, missing AVR tools, impossible override
    """
    faults = [parse(text) for text in options.faults]
    if options.minimal:
        faults += [Injection(name, "open", 0.0, LONG_AGO) for name in POTENTIOMETER_NAMES]
    rig = parameters(_model(options, "bench").mj, options.unit, options.track)
    twin = _model(options, options.scene)
    if options.unit is not None:
        vary(twin.mj, rig)
    plant = BenchPlant(twin)
    return make_device(options.seat, plant, rig, faults=faults, seed=options.seed)


def check_parameters(options: RigOptions) -> None:
    """Refuse parameters that a served rig does not have.

    Raises
    ------
    TwinError : the first of them
    """
    names = _parameters(options.scene)
    for name in options.overrides:
        if not name.startswith(names):
            raise TwinError(
                f"--set {name}: a rig on the {options.scene} has no such parameter; must begin with"
                f" {' or '.join(names)}"
            )


def _parameters(scene: str) -> tuple[str, ...]:
    return RIG_PARAMETERS if scene == TURNTABLE else RIG_PARAMETERS[:1]


def _model(options: RigOptions, scene: str) -> TwinModel:
    """A scene with the mechanism of the rig; only the bench has the limit switches."""
    names = _parameters(scene)
    ours = {k: v for k, v in options.overrides.items() if k.startswith(names)}
    return load(ModelConfig(scene=scene, mechanism=options.mechanism, overrides=ours))


@contextmanager
def open_rig(
    options: RigOptions, plant: Plant | None, playback: Recording | None = None
) -> Iterator[RigGimbal]:
    """Connect a rig for the length of a block, within `native.installed()`; see `opened`.

    Parameters
    ----------
    playback : recording whose readings replace the rig
    """
    if playback is not None:
        assert plant is not None
        seat = _replayed(options, plant, playback)
    else:
        seat = opened(options, plant)
    try:
        status.say(f"waiting for the rig {options.seat}")
        seat.start()
        if options.scene == TURNTABLE and seat.base is None:
            seat.base = measure_base(seat)
            seat.settle()
        if playback is None and not options.watch:
            _check(seat, options)
        yield seat
    finally:
        seat.close()
        if seat.dropped:
            status.note(f"twin: {options.seat}: {ReadingsDropped().text} ({seat.dropped} bytes)")


def _check(seat: RigGimbal, options: RigOptions) -> None:
    """Make the motion check before a run; faults of a simulated rig do not advance meanwhile."""
    if options.check is None:
        return
    if not options.check:
        seat.notices.append(MotionChecked(None))
        return
    if options.seat not in SIMULATED:
        status.note(f"twin: {options.seat}: motion check, the gimbal moves by 2°")
    status.say("motion check")
    if seat.bench is not None:
        seat.bench.paused = True
    check_motion(seat)
    if seat.bench is not None:
        seat.bench.paused = False


def opened(options: RigOptions, plant: Plant | None) -> RigGimbal:
    """A rig for the gimbal seat with its line open; `start` has not been called.

    Raises
    ------
    TwinError, HardwareError : in one line, what cannot be opened and what to do
    """
    check_seat(options.seat)
    if not is_rig(options.seat):
        raise TwinError(f"--gimbal {options.seat}: must be a rig: emulator, firmware or a port")
    if options.seat in SIMULATED:
        return _simulated(options, plant)
    _refuse_simulation(options)
    calibration = calibration_of(options)
    _warm(calibration)
    link = Link(options.seat)
    rig = Rig(link, calibration, arm=not options.watch, fuse=options.fuse)
    seat = RigGimbal(
        rig,
        plant,
        clock=time.monotonic_ns,
        wait=lambda ns: time.sleep(ns * 1e-9),
        lockstep=False,
        watch=options.watch,
    )
    seat.note = "" if options.calibration else NOMINAL
    return seat


def _warm(calibration: Calibration) -> None:
    """Compile the estimator before frames arrive; takes long once after an update."""
    still = SensorFrame(
        0, 0, (0.5,) * 4, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3,
        (False,) * 4, (0.0, 0.0), 0,
    )  # fmt: skip
    fusion = Fusion(calibration)
    fusion.update(still)
    fusion.update(replace(still, device_us=2000))


def _replayed(options: RigOptions, plant: Plant, playback: Recording) -> RigGimbal:
    from twin.hil.recorded import RecordedRig, base_of, calibration_of

    bench = _model(options, "bench").mj
    calibration = calibration_of(playback, given=options.calibration is not None)
    if calibration is None:
        simulated = options.seat in SIMULATED
        rig = parameters(bench, options.unit) if simulated else None
        calibration = nominal_calibration(bench, rig)
    turntable = options.scene == TURNTABLE
    seat = RigGimbal(
        RecordedRig(playback, calibration, plant, turntable=turntable),
        plant,
        clock=lambda: plant.time_ns,
        wait=lambda _: None,
        lockstep=False,
        live=False,
    )
    seat.base = base_of(playback) if turntable else None
    return seat


def _simulated(options: RigOptions, plant: Plant | None) -> RigGimbal:
    calibration = _calibration(options)
    measured = calibration is not None
    if calibration is not None:
        options = replace(options, minimal=calibration.minimal, track=calibration.track)
    simulated = device(options)
    if calibration is None:
        bench = _model(options, "bench").mj
        calibration = nominal_calibration(bench, parameters(bench, options.unit))
    rig = in_process(simulated, calibration, arm=not options.watch, fuse=options.fuse)
    seat = RigGimbal(
        rig,
        plant,
        clock=lambda: round(simulated.time_us * 1000),
        wait=lambda ns: simulated.advance_us(max(1, ns // 1000)),
        lockstep=True,
        watch=options.watch,
    )
    seat.note = "" if measured else OWN
    seat.bench = simulated.bench
    return seat


def calibration_of(options: RigOptions) -> Calibration:
    """Map of a rig that is not simulated: its calibration file, or the nominal geometry.

    Raises
    ------
    TwinError, HardwareError : a file that cannot be used
    """
    return _calibration(options) or nominal_calibration(_model(options, "bench").mj)


def _calibration(options: RigOptions) -> Calibration | None:
    if options.calibration is None:
        return None
    calibration = read_calibration(options.calibration)
    if calibration.minimal and options.scene == TURNTABLE:
        raise TwinError(
            f"--calibration {options.calibration}: must be of a rig with potentiometers; on a"
            " turntable an accelerometer shows the motion of the base as well"
        )
    if calibration.note:
        status.note(f"twin: {options.calibration}: {calibration.note}")
    return calibration


def _refuse_simulation(options: RigOptions) -> None:
    """Refuse options of simulated rigs for a port."""
    given: Sequence[tuple[str, object]] = (
        ("--fault", options.faults),
        ("--unit", options.unit is not None),
    )
    for flag, value in given:
        if value:
            raise TwinError(
                f"{flag} is for simulated rigs and --gimbal {options.seat} is a port; give it to"
                " the `twin rig` that serves the port"
            )
