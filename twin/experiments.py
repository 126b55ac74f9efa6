"""Short assemblies: who sits where for each command, and what is made of the outcome."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from twin import native, overrides
from twin.clock import Clock, Lockstep, Wall
from twin.configuration import Fly, Run, Step, as_properties
from twin.control import AttitudeController, control_config
from twin.errors import TwinError
from twin.flight import Flight, setpoint
from twin.loop import Seats, run
from twin.model import ModelConfig, TwinModel, load
from twin.plant import Plant
from twin.recorder import Recorder
from twin.results import FlightResult, StepResult
from twin.rows import Rows
from twin.seats import Pilot, Sequence, SimulatedGimbal
from twin.steps import excitation, figures

VERSIONS = ("tvc-twin", "mujoco", "numpy", "numba", "rerun-sdk")
# Each write costs the same however much it holds; a run in real time may be cut off at any moment.
DRAIN_LOCKSTEP_NS, DRAIN_WALL_NS = 8_000_000_000, 200_000_000
PATIENCE_S = 2.0
UNRECORDED = ("out", "json")  # where and how a result is told changes nothing about the run


def fly(config: Fly) -> FlightResult:
    """Fly the vehicle on a simulated gimbal and record it.

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began = time.perf_counter()
    with ExitStack() as stack:
        stack.enter_context(compiled())
        plant = _plant(config, config.motor)
        if not plant.has_vehicle:
            raise TwinError(f"scene {config.scene!r} has no joint 'vehicle' to fly")
        steps = steps_per_tick(config.control_hz, plant)
        programme, target = setpoint(config, plant.model)
        controller = AttitudeController(control_config(plant.model))
        pilot = Pilot(plant, controller, programme, steps * plant.dt_ns * 1e-9)
        rows = Rows(plant, pilot)
        flight = Flight(plant, rows, pilot.error, target)
        recorder = stack.enter_context(_recorder(config, "fly", plant.twin, rows))
        rows.bind(recorder)
        flight.announce = recorder.event
        clock = stack.enter_context(_clock(config))
        outcome = run(
            Seats(plant, SimulatedGimbal(plant), pilot, clock),
            steps_per_tick=steps,
            duration_ns=round(config.duration_s * 1e9),
            command=rows.command,
            each_tick=(rows.write, flight.watch),
            stop=flight.over,
        )
        recorder.event(plant.time_ns, f"flight ended: {outcome.ended}")
    return flight.result(recorder.path, outcome, time.perf_counter() - began)


def step(config: Step) -> StepResult:
    """Excite a gimbal on the bench and record its response.

    Raises
    ------
    TwinError : something the user asked for cannot be done, in one line
    DivergenceError : the physics left the finite numbers; the recording up to there is kept
    """
    began = time.perf_counter()
    asked = excitation(config)
    with ExitStack() as stack:
        stack.enter_context(compiled())
        plant = _plant(config)
        if plant.twin.gimbal == "fixed":
            raise TwinError(f"scene {config.scene!r} has no gimbal to step")
        steps = steps_per_tick(config.control_hz, plant)
        plan = asked.plan(steps * plant.dt_ns * 1e-9)
        rows = Rows(plant)
        recorder = stack.enter_context(_recorder(config, "step", plant.twin, rows))
        rows.bind(recorder)
        clock = stack.enter_context(_clock(config))
        run(
            Seats(plant, SimulatedGimbal(plant), Sequence(plan.times, plan.angles), clock),
            steps_per_tick=steps,
            duration_ns=round(plan.duration * 1e9),
            command=rows.command,
            each_tick=(rows.write,),
        )
    return StepResult(
        recording=str(recorder.path),
        gimbal=plant.twin.gimbal,
        signal=config.signal,
        excitation_s=plan.duration,
        figures=figures(recorder.path),
        physics_steps=plant.steps,
        physics_s=plant.computing_s,
        wall_s=time.perf_counter() - began,
        warnings=plant.warnings(),
    )


@contextmanager
def compiled() -> Iterator[None]:
    """Install the native callbacks; tell whoever waits at a terminal why it takes long at first."""
    timer = threading.Timer(PATIENCE_S, _explain_wait)
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    try:
        with native.installed():
            timer.cancel()
            yield
    finally:
        timer.cancel()


def _explain_wait() -> None:
    print("twin: compiling the native forces, once after an update …", file=sys.stderr)


def steps_per_tick(control_hz: float, plant: Plant) -> int:
    """Physics steps between two commands.

    Raises
    ------
    TwinError : the control period is no whole number of physics steps
    """
    if not 0 < control_hz <= 1e5:
        raise TwinError(f"--control-hz {control_hz}: must lie in 0 to 100000")
    steps = 1e9 / control_hz / plant.dt_ns
    if steps < 0.999 or abs(steps - round(steps)) > 1e-6:
        raise TwinError(
            f"--control-hz {control_hz:g} is no whole number of physics steps of"
            f" {plant.dt_ns * 1e-6:g} ms; {1e9 / plant.dt_ns / max(1, round(steps)):g} Hz would be"
        )
    return round(steps)


def _plant(config: Run, motor: Path | None = None) -> Plant:
    return Plant(
        load(
            ModelConfig(
                scene=config.scene,
                gimbal=config.gimbal,
                transfer_function=config.model,
                vehicle=config.vehicle,
                mechanism=config.mechanism,
                motor=motor,
                overrides=overrides.parse(config.set, config.set_from),
                dt=config.dt,
                seed=config.seed,
            )
        ),
        config.integrator,
    )


def _clock(config: Run) -> Clock:
    return Wall() if config.clock == "wall" else Lockstep()


def _recorder(config: Run, command: str, twin: TwinModel, rows: Rows) -> Recorder:
    settings = {k: v for k, v in as_properties(config).items() if k not in UNRECORDED}
    properties: dict[str, object] = {
        "command": command,
        "configuration": settings,
        "versions": {name: version(name) for name in VERSIONS},
        "model_sha256": twin.sha256,
        "seed": config.seed,
    }
    if config.clock == "wall":
        properties["date"] = datetime.now(UTC).isoformat(timespec="milliseconds")
    path = config.out or Path("runs")
    if path.is_dir() or not path.suffix:
        path /= f"{command}.rrd"
    return Recorder(
        path,
        signals=rows.signals,
        properties=properties,
        model=twin.mj,
        drain_ns=DRAIN_WALL_NS if config.clock == "wall" else DRAIN_LOCKSTEP_NS,
    )
