"""What every run is put together from: model, clock, rig, recorder."""

import hashlib
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco

from twin.config import TURNTABLE, Run, as_properties
from twin.config.seats import MODELS, OF_SERVOS, is_rig
from twin.errors import TwinError
from twin.loop.clock import Clock, Lockstep, Wall
from twin.loop.loop import Gimbal
from twin.loop.seats import SimulatedGimbal
from twin.physics import native
from twin.plant import integrators, overrides
from twin.plant.model import ModelConfig, Seat, TwinModel, load
from twin.plant.plant import Plant
from twin.recorder import DetachedRecorder, Recorder, Sink
from twin.recorder.rows import Rows

if TYPE_CHECKING:
    from analysis.recording import Recording
    from twin.config import Fly
    from twin.hil import RigGimbal, RigOptions
    from twin.hil.turntable import Turntable

VERSIONS = ("tvc-twin", "mujoco", "numpy", "numba", "rerun-sdk")
# Each write costs the same however much it holds; in real time a viewer may be watching, and the
# process that writes may be ended by force.
DRAIN_LOCKSTEP_NS, DRAIN_WALL_NS = 16_000_000_000, 1_000_000_000
LARGEST_KEPT = 200_000  # bytes of a motor, model or vehicle file that a recording carries whole
PATIENCE_S = 2.0
OF_THE_RIG = ("gimbal_servo_", "gimbal_rod_")  # what a gimbal that follows a rig does not have
UNRECORDED = ("out", "json")  # where and how a result is told changes nothing about the run


@contextmanager
def compiled() -> Iterator[None]:
    """Install the native callbacks; tell whoever waits at a terminal why it takes long at first."""
    timer = threading.Timer(PATIENCE_S, _explain_wait)
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    before = mujoco.get_mju_user_warning()
    told: set[str] = set()

    def warn(message: str) -> None:
        kind = message.partition("Time")[0]
        if kind not in told:  # a simulation in trouble says the same at every step
            told.add(kind)
            print(f"twin: MuJoCo: {message}", file=sys.stderr)

    mujoco.set_mju_user_warning(warn)  # MuJoCo's own handler leaves a log file where one stands
    try:
        with native.installed():
            timer.cancel()
            yield
    finally:
        timer.cancel()
        mujoco.set_mju_user_warning(before)


def _explain_wait() -> None:
    print("twin: compiling the native forces, once after an update …", file=sys.stderr)


def make_plant(config: Run, motor: Path | None = None) -> Plant:
    """The simulated side of a run; its gimbal follows where a rig has the gimbal seat.

    Raises
    ------
    TwinError : a file, name or number that cannot be used, or a step too long for the integrator
    """
    given = _of_the_plant(config)
    kind: Seat = "follow"
    if config.gimbal in MODELS:
        kind = "linkage" if config.gimbal == "linkage" else "transfer-function"
    if kind == "transfer-function":
        _refuse_servos(given)
    twin = load(
        ModelConfig(
            scene=config.plant_scene,
            gimbal=kind,
            transfer_function=config.model,
            vehicle=config.vehicle,
            mechanism=config.mechanism,
            motor=motor,
            overrides=given,
            dt=config.dt,
            seed=config.seed,
        )
    )
    integrators.check_step(
        config.integrator, twin.mj.opt.timestep, ramp=_on_ramp(twin.mj), rods=twin.mj.neq > 0
    )
    return Plant(twin, config.integrator)


def _refuse_servos(given: Iterable[str]) -> None:
    for name in given:
        if name.startswith(OF_SERVOS):
            raise TwinError(
                f"--set {name}: an identified model has no servos, rods or play of its own, so this"
                " would change nothing; it is for --gimbal linkage"
            )


def _on_ramp(model: mujoco.MjModel) -> bool:
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, "ramp_length")
    return found >= 0 and bool(model.numeric("ramp_length").data[0] > 0.0)


def _of_the_plant(config: Run) -> dict[str, float]:
    """Overrides without those of servos, rods and turntable, where these are a rig's own."""
    given = overrides.parse(config.set, config.set_from)
    if not is_rig(config.gimbal):
        return given
    theirs = (*OF_THE_RIG, TURNTABLE) if config.rig_scene == TURNTABLE else OF_THE_RIG
    return {k: v for k, v in given.items() if not k.startswith(theirs)}


def gimbal_seat(
    stack: ExitStack, config: Run, plant: Plant, tape: "Recording | None" = None
) -> "tuple[Gimbal, RigGimbal | None]":
    """Who the run's `--gimbal` names, connected; and the same where it is a rig.

    Parameters
    ----------
    tape : recording of a rig that stands in for it

    Raises
    ------
    TwinError, HardwareError : a rig that cannot be opened, in one line
    """
    if not is_rig(config.gimbal):
        return SimulatedGimbal(plant), None
    from twin.hil import open_rig

    seat = stack.enter_context(open_rig(rig_options(config), plant, tape))
    return seat, seat


def attitude_seat(
    config: "Fly", plant: Plant, rig: "RigGimbal | None", period: float
) -> "Turntable | None":
    """Who tells the controller how the vehicle lies, once in `period` [s]; None for the truth."""
    if rig is None or rig.base is None:
        return None
    from twin.hil.connect import lead
    from twin.hil.turntable import Turntable

    return Turntable(plant, rig, rig.base, lead(rig_options(config)), period)


def rig_options(config: Run, *, watch: bool = False) -> "RigOptions":
    """How the rig of a run is to be opened."""
    from twin.hil import RigOptions

    return RigOptions(
        seat=config.gimbal,
        calibration=config.calibration,
        unit=config.unit,
        faults=config.fault,
        seed=config.seed,
        mechanism=config.mechanism,
        overrides=overrides.parse(config.set, config.set_from),
        scene=config.rig_scene,
        watch=watch,
    )


def steps_per_tick(control_hz: float, plant: Plant) -> int:
    """Physics steps between two commands.

    Raises
    ------
    TwinError : the control period is no whole number of physics steps
    """
    if not 0.1 <= control_hz <= 1e5:
        raise TwinError(f"--control-hz {control_hz:g}: must lie in 0.1 to 100000")
    steps = 1e9 / control_hz / plant.dt_ns
    if steps < 0.999 or abs(steps - round(steps)) > 1e-3:  # 333.333 Hz means a third of 1 kHz
        raise TwinError(
            f"--control-hz {control_hz:g} is no whole number of physics steps of"
            f" {plant.dt_ns * 1e-6:g} ms; {1e9 / plant.dt_ns / max(1, round(steps)):g} Hz would be"
        )
    return round(steps)


def make_clock(*, real_time: bool) -> Clock:
    """The run's clock."""
    return Wall() if real_time else Lockstep()


def _kept(path: Path) -> dict[str, str]:
    """Digest of a file a run was given, and its text where that is short."""
    try:
        content = path.read_bytes()
    except OSError:
        return {}
    kept = {"sha256": hashlib.sha256(content).hexdigest()}
    if len(content) <= LARGEST_KEPT:
        kept["text"] = content.decode(errors="replace")
    return kept


def make_recorder(
    config: Run,
    command: str,
    twin: TwinModel,
    rows: Rows,
    *,
    serve: int | None = None,
    drain_ns: int | None = None,
    rig: "RigGimbal | None" = None,
    real_time: bool | None = None,
    tape: "Recording | None" = None,
) -> Sink:
    """The run's recorder, its properties complete enough to repeat the run.

    Parameters
    ----------
    rig : whose base, if it turns, belongs to the properties
    real_time : whether the run keeps pace with the wall clock; as its configuration says if None
    tape : recording that is replayed; its files are this run's files, whatever became of them

    Raises
    ------
    TwinError : the file cannot be written, or the port is taken
    """
    settings = {k: v for k, v in as_properties(config).items() if k not in UNRECORDED}
    resolved = overrides.parse(config.set, config.set_from)
    settings |= {"set": [f"{name}={value!r}" for name, value in resolved.items()], "set_from": None}
    properties: dict[str, object] = {
        "command": command,
        "configuration": settings,
        "versions": {name: version(name) for name in VERSIONS},
        "model_sha256": twin.sha256,
        "seed": config.seed,
        "files": {
            name: _kept(path)
            for name, path in asdict(config).items()
            if isinstance(path, Path) and name not in UNRECORDED
        },
    }
    if tape is not None:
        properties["files"] = tape.properties.get("files", {})
    if real_time is None:
        real_time = config.real_time
    if rig is not None and rig.base is not None:
        properties["base"] = asdict(rig.base)
    if real_time:
        properties["date"] = datetime.now(UTC).isoformat(timespec="milliseconds")
    path = config.out or Path("runs")
    if path.is_dir() or not path.suffix:
        path /= f"{command}.rrd"
    make = DetachedRecorder if real_time else Recorder
    return make(
        path,
        signals=rows.signals,
        properties=properties,
        model=twin.mj,
        drain_ns=drain_ns or (DRAIN_WALL_NS if real_time else DRAIN_LOCKSTEP_NS),
        serve=serve,
    )
