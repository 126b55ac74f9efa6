"""`twin fly`: the seats of one flight, and its result."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis import schema
from analysis.transfer_function import TransferFunctionModel
from twin.config import OBJECT, Fly
from twin.config.seats import MODELS
from twin.control import AttitudeController, Setpoint
from twin.errors import DivergenceError, TwinError
from twin.experiments.flight.flight import Flight
from twin.experiments.flight.miss import missed
from twin.experiments.flight.own_controller import OwnController, load
from twin.experiments.flight.result import FlightResult
from twin.experiments.flight.ticks import compiled_ticks
from twin.experiments.flight.track import Track
from twin.experiments.kept import Origin
from twin.experiments.programme import setpoint
from twin.experiments.session import Session
from twin.loop.loop import Controller
from twin.loop.seats import Attitude, Pilot
from twin.plant.authority import control_config
from twin.plant.loops import unstable, wrong_gain
from twin.plant.model.model import REFERENCE_GIMBAL
from twin.plant.plant import Plant

if TYPE_CHECKING:
    from analysis.recording import Recording
    from twin.hil.turntable import Turntable


def fly(
    config: Fly,
    playback: "Recording | None" = None,
    controller: object | None = None,
    origin: Origin | None = None,
    *,
    recorded: bool = True,
) -> FlightResult:
    """Fly the vehicle once, with the component in the gimbal seat that was asked for; record it.

    Parameters
    ----------
    playback : recording whose readings take the place of a rig
    controller : own controller object in place of the attitude loop and of `config.controller`
    origin : what is recorded about the files of a flight that is repeated
    recorded : False flies without a recording, in lockstep only

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began, busy = time.perf_counter(), time.process_time()
    if controller is not None:
        config = replace(config, controller=f"{OBJECT}{type(controller).__name__}")
    elif config.controller is not None:
        controller = load(config.controller)
    with Session(
        config, "fly", config.control_hz, motor=config.motor, playback=playback, origin=origin,
        recorded=recorded,
    ) as s:  # fmt: skip
        plant = s.plant
        if not plant.has_vehicle:
            raise TwinError(f"--scene {config.scene}: has no joint 'vehicle' to fly")
        if config.gimbal == "transfer-function":
            _judge_gain(config, plant)
        programme, target = setpoint(config, plant.model)
        s.connect()
        turntable = s.turntable()
        pilot = _pilot(plant, programme, s.tick_ns, turntable)
        commanding: Controller = pilot
        if controller is not None:
            commanding = OwnController(controller, plant.model, pilot, s.tick_ns * 1e-9)
        guard = s.guard(commanding, config.on_fault, turntable)
        recorder = s.record(pilot, turntable, guard) if recorded else None
        if recorder is None:
            s.gather(pilot, turntable, guard)
        flight, track = Flight(plant, target), Track(plant, s.rows.command, pilot.error)
        if recorder is not None:
            flight.announce = recorder.event
        if s.real_time:
            s.rehearse(_pilot(plant, programme, s.tick_ns))
            _rehearse(Flight(plant, target), Track(plant, s.rows.command, pilot.error))
        powered = _powered(turntable, flight.burnout_ns)
        duration_ns = round(config.duration_s * 1e9)
        outcome = None
        try:
            alone = commanding is pilot and guard is None and playback is None and not s.real_time
            if alone:
                rows = None if recorder is None else s.rows
                outcome = compiled_ticks(plant, pilot, flight, track, s.steps, duration_ns, rows)
            outcome = outcome or s.run(
                guard or commanding,
                duration_ns,
                each_tick=(s.rows.write, track.watch, flight.watch, powered),
                stop=flight.over if guard is None else lambda: guard.over() or flight.over(),
            )
        except DivergenceError as error:
            raise DivergenceError(_why(str(error), config, plant)) from error
        result = flight.result(recorder.path if recorder else None, outcome, track)
        result = replace(
            result,
            within_m=config.within,
            missed=missed(result, programme, track, flight.burnout_ns * 1e-9, config.within),
            notes=result.notes + s.notes,
            fault=guard.fault if guard else None,
            turntable_rms_deg=None if turntable is None else math.degrees(turntable.rms),
        )
        if recorder is not None:
            recorder.event(plant.time_ns, f"flight ended: {outcome.ended}")
            recorder.attach(schema.FLIGHT, result.kept())
        timing = s.verdict()
    cpu_s, wall_s = time.process_time() - busy, time.perf_counter() - began
    return replace(result, cpu_s=cpu_s, wall_s=wall_s, timing=timing)


def _powered(turntable: "Turntable | None", burnout_ns: int) -> Callable[[int], None]:
    """Let a turntable's error count only until burnout."""

    def count(time_ns: int) -> None:
        if turntable is not None:
            turntable.counting = time_ns < burnout_ns

    return count


def _why(text: str, config: Fly, plant: Plant) -> str:
    """A divergence with its likely cause: a loop that is unstable, whatever the step of time."""
    if config.controller is not None:
        return f"{text}, unless the controller's gain is beyond the margin of its loop"
    if config.gimbal not in MODELS or plant.twin.gimbal == "fixed":
        return text
    cause = unstable(TransferFunctionModel.read(config.model or REFERENCE_GIMBAL), plant.model)
    if cause is None:
        return text
    return f"{text.partition(';')[0]}; {cause}: give a lower gain, --dt does not help"


def _judge_gain(config: Fly, plant: Plant) -> None:
    """Refuse a model with whose gain the attitude loop of the vehicle is unstable.

    The margins of an own controller are not known: of its model only sign and order are judged.

    Raises
    ------
    TwinError : the axis and its gain
    """
    if config.any_gain or config.model is None:
        return
    loop = plant.model if config.controller is None else None
    wrong = wrong_gain(TransferFunctionModel.read(config.model), loop)
    if wrong is not None:
        raise TwinError(
            f"--model {config.model}: {wrong}; check sign, units and order of the columns it was"
            " identified from, or give --any-gain"
        )


def _pilot(
    plant: Plant, programme: Setpoint, tick_ns: int, attitude: Attitude | None = None
) -> Pilot:
    loop = AttitudeController(control_config(plant.model))
    return Pilot(plant, loop, programme, tick_ns * 1e-9, attitude)


def _rehearse(flight: Flight, track: Track) -> None:
    """Compile what watches a flight before the clock starts."""
    flight.watch(0)
    flight.over()
    track.watch(0)
