"""Short assemblies: who sits where for each command, and what is made of the outcome."""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from hardware.frames import GimbalCommand, GimbalState
from twin.config import Fly, Step
from twin.control import AttitudeController, Setpoint, control_config
from twin.errors import TwinError
from twin.experiments.flight import Flight, setpoint
from twin.experiments.session import (
    attitude_seat,
    compiled,
    gimbal_seat,
    make_clock,
    make_plant,
    make_recorder,
    steps_per_tick,
)
from twin.experiments.step import excitation, figures
from twin.experiments.summary import FlightResult, StepResult
from twin.hil.failsafe import Guard
from twin.loop.clock import Clock, Ledger, Wall
from twin.loop.loop import Controller, Gimbal, Seats, run
from twin.loop.seats import Attitude, Pilot, Sequence, SimulatedGimbal
from twin.plant.plant import Plant
from twin.recorder import Sink
from twin.recorder.rows import Rows

if TYPE_CHECKING:
    from analysis.recording import Recording
    from analysis.timing import Verdict
    from twin.hil.turntable import Turntable

__all__ = ["compiled", "fly", "step", "steps_per_tick"]


def fly(config: Fly, tape: "Recording | None" = None) -> FlightResult:
    """Fly the vehicle, with whoever has the gimbal seat, and record it.

    Parameters
    ----------
    tape : recording whose readings stand in for a rig

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began = time.perf_counter()
    real_time = config.real_time and tape is None
    # a rig is let go before its run is judged, and before the recording is complete
    with ExitStack() as stack, ExitStack() as live:
        stack.enter_context(compiled())
        plant = make_plant(config, config.motor)
        if not plant.has_vehicle:
            raise TwinError(f"scene {config.scene!r} has no joint 'vehicle' to fly")
        steps = steps_per_tick(config.control_hz, plant)
        programme, target = setpoint(config, plant.model)
        gimbal, rig = gimbal_seat(live, config, plant, tape)
        seen = attitude_seat(config, plant, rig, steps * plant.dt_ns * 1e-9)
        pilot = _pilot(plant, programme, steps, seen)
        guard = None if rig is None else Guard(pilot, rig.readings, config.on_fault or "end", seen)
        ledger = Ledger() if real_time else None
        rows = Rows(plant, pilot, rig.readings if rig else None, ledger, seen)
        flight = Flight(plant, rows, pilot.error, target)
        recorder = stack.enter_context(
            make_recorder(config, "fly", plant.twin, rows, rig=rig, real_time=real_time, tape=tape)
        )
        rows.bind(recorder)
        flight.announce = recorder.event
        if real_time:
            warm_up(plant, gimbal, rows, _pilot(plant, programme, steps), steps)
        clock = live.enter_context(make_clock(real_time=real_time))
        outcome = run(
            Seats(plant, gimbal, guard or pilot, clock),
            steps_per_tick=steps,
            duration_ns=_length(round(config.duration_s * 1e9), tape),
            command=rows.command,
            each_tick=(rows.write, flight.watch, _counting(seen, flight.burnout_ns)),
            stop=flight.over if guard is None else lambda: guard.over() or flight.over(),
            ledger=ledger,
        )
        live.close()
        recorder.event(plant.time_ns, f"flight ended: {outcome.ended}")
        timing = judged(recorder, clock, plant.time_ns)
    result = flight.result(recorder.path, outcome, time.perf_counter() - began)
    return replace(
        result,
        fault=guard.fault if guard else None,
        turntable_rms_deg=None if seen is None else math.degrees(seen.rms),
        timing=timing,
    )


def _counting(seen: "Turntable | None", burnout_ns: int) -> Callable[[int], None]:
    """Let a turntable's figure end with the thrust."""

    def look(time_ns: int) -> None:
        if seen is not None:
            seen.counting = time_ns < burnout_ns

    return look


def _pilot(plant: Plant, programme: Setpoint, steps: int, seen: Attitude | None = None) -> Pilot:
    controller = AttitudeController(control_config(plant.model))
    return Pilot(plant, controller, programme, steps * plant.dt_ns * 1e-9, seen)


def step(config: Step, tape: "Recording | None" = None) -> StepResult:
    """Excite a gimbal on the bench and record its response.

    Parameters
    ----------
    tape : recording whose readings stand in for a rig

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began = time.perf_counter()
    real_time = config.real_time and tape is None
    asked = excitation(config)
    with ExitStack() as stack, ExitStack() as live:
        stack.enter_context(compiled())
        plant = make_plant(config)
        if plant.twin.gimbal == "fixed":
            raise TwinError(f"scene {config.scene!r} has no gimbal to step")
        steps = steps_per_tick(config.control_hz, plant)
        plan = asked.plan(steps * plant.dt_ns * 1e-9)
        gimbal, rig = gimbal_seat(live, config, plant, tape)
        ledger = Ledger() if real_time else None
        rows = Rows(plant, readings=rig.readings if rig else None, ledger=ledger)
        recorder = stack.enter_context(
            make_recorder(config, "step", plant.twin, rows, real_time=real_time, tape=tape)
        )
        rows.bind(recorder)
        sequence = Sequence(plan.times, plan.angles)
        guard = None if rig is None else Guard(sequence, rig.readings, config.on_fault or "end")
        if real_time:
            warm_up(plant, gimbal, rows, sequence, steps)
        clock = live.enter_context(make_clock(real_time=real_time))
        run(
            Seats(plant, gimbal, guard or sequence, clock),
            steps_per_tick=steps,
            duration_ns=_length(round(plan.duration * 1e9), tape),
            command=rows.command,
            each_tick=(rows.write,),
            stop=guard.over if guard else lambda: None,
            ledger=ledger,
        )
        live.close()
        timing = judged(recorder, clock, plant.time_ns)
    return StepResult(
        recording=str(recorder.path),
        gimbal=config.gimbal,
        signal=config.signal,
        excitation_s=plan.duration,
        figures=figures(recorder.path),
        physics_steps=plant.steps,
        physics_s=plant.computing_s,
        wall_s=time.perf_counter() - began,
        warnings=plant.warnings(),
        fault=guard.fault if guard else None,
        timing=timing,
    )


def _length(asked_ns: int, tape: "Recording | None") -> int:
    """How long to run [ns]: a tape ends with its last tick, also where its run was cut off."""
    if tape is None:
        return asked_ns
    return min(asked_ns, int(tape["gimbal/command"].time_ns[-1]) + 1)


def warm_up(plant: Plant, gimbal: Gimbal, rows: Rows, controller: Controller, steps: int) -> None:
    """Go once through what a tick does and back to the start: the first time takes 15 ms.

    Parameters
    ----------
    controller : one that nobody else uses, for it may remember
    steps : physics steps to a tick
    """
    for _ in range(3):
        time_ns = plant.time_ns
        controller.update(time_ns * 1e-9, GimbalState(time_ns, (0.0, 0.0)))
        if isinstance(gimbal, SimulatedGimbal):  # a rig would move
            gimbal.send(GimbalCommand(time_ns, (0.0, 0.0)))
        rows.derive(time_ns)
        plant.advance(steps)
    plant.reset()
    plant.computing_s = 0.0


def judged(recorder: Sink, clock: Clock, time_ns: int) -> "Verdict | None":
    """Whether real time left a run what it was meant to be; None where it was not in real time.

    The verdict becomes part of the recording. Within `compiled()`, after the clock has ended.
    """
    if not isinstance(clock, Wall):
        return None
    from analysis.recording import read
    from twin.experiments.timing import verdict

    rights = {"SCHED_FIFO": clock.rights.scheduling, "locked memory": clock.rights.memory}
    found = verdict(
        read(recorder.flush(), growing=True),
        overruns=clock.overruns,
        rights=rights,
        stolen=clock.stolen,
    )
    recorder.timing(found.as_dict())
    level = "INFO" if found.word == "valid" else "WARN"
    recorder.event(time_ns, f"timing {found.text()}", level)
    return found
