# Written by .ci/stub.py from the settings of the verbs; do not edit.
from os import PathLike
from typing import Any, Literal

from analysis.recording import Recording
from analysis.schema import AnalysisError as AnalysisError
from hardware.frames import HardwareError as HardwareError
from twin.errors import DivergenceError as DivergenceError
from twin.errors import TwinError as TwinError
from twin.campaigns.results.result import CampaignResult
from twin.cli.doctor import DoctorResult
from twin.cli.parameters import ParametersResult
from twin.evaluation.compare_result import CompareResult
from twin.evaluation.export import ExportResult
from twin.evaluation.flights import FlightsResult
from twin.evaluation.history_result import HistoryResult
from twin.evaluation.identify_result import IdentifyResult
from twin.evaluation.identify_result import InformationResult
from twin.evaluation.linkage import PhysicsResult
from twin.evaluation.report import ReportResult
from twin.experiments.calibrate import CalibrationResult
from twin.experiments.convergence.result import ConvergenceResult
from twin.experiments.flight.result import FlightResult
from twin.experiments.mechanism.figures import MechanismResult
from twin.experiments.mechanism.search import SearchResult
from twin.experiments.mirror import MirrorResult
from twin.experiments.repeat.result import RepeatResult
from twin.experiments.replay import ReplayResult
from twin.experiments.step import StepResult
from twin.experiments.vehicle.openrocket import ImportResult
from twin.experiments.vehicle.result import BuildResult
from twin.experiments.vehicle.result import VehicleResult
from twin.workflows.demo.result import DemoResult
from twin.workflows.live.result import LiveResult

def calibrate(
    *,
    out: str | PathLike[str] = ...,
    force: bool = ...,
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    gimbal: str = ...,
    mechanism: str | PathLike[str] | None = ...,
    switch_deg: tuple[float, float, float, float] | None = ...,
    minimal: bool = ...,
    potentiometer_deg: float = ...,
    repeats: int = ...,
    seed: int = ...,
) -> CalibrationResult: ...
def campaign(
    action: Literal['run', 'resume', 'report', 'refly'],
    study: str,
    run: int | None,
    *,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    workers: int | None = ...,
    ray: str | None = ...,
    fail_if: tuple[str, ...] = ...,
    reweight: str | None = ...,
    paths: int = ...,
) -> CampaignResult | FlightResult: ...
def compare(
    *recordings: str | PathLike[str],
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    time: str | None = ...,
    input: str | None = ...,
    angle: str | None = ...,
    angle_unit: str | None = ...,
    input_unit: str | None = ...,
    time_scale: float | None = ...,
    commands: str | PathLike[str] | None = ...,
    input_stamps: Literal['exact', 'sampled'] | None = ...,
    before: str | None = ...,
    with_: str | None = ...,
    ratio: float | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    drift: bool = ...,
    explain: bool = ...,
    fail_below: float | None = ...,
    longest_delay_ms: float = ...,
) -> CompareResult | FlightsResult: ...
def converge(
    *,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    flight: Literal['baseline', 'closed-loop'] = ...,
    gimbal: Literal['linkage', 'transfer-function'] = ...,
    integrators: tuple[Literal['implicitfast', 'euler', 'rk4', 'ab1', 'ab2', 'ab3', 'ab4'], ...] = ...,
    dt_ms: tuple[float, ...] = ...,
    tolerance_m: float = ...,
    duration_s: float = ...,
    control_hz: float = ...,
    seed: int = ...,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    model: str | PathLike[str] | None = ...,
    motor: str | PathLike[str] | None = ...,
) -> ConvergenceResult: ...
def demo(
    *,
    gimbal: str = ...,
    unit: int | None = ...,
    calibration: str | PathLike[str] | None = ...,
    seed: int = ...,
    out: str | PathLike[str] | None = ...,
) -> DemoResult: ...
def doctor(
    *,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    port: str | None = ...,
    compile: bool = ...,
) -> DoctorResult: ...
def export(
    recording: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    to: Literal['csv', 'parquet', 'mat', 'mcap', 'kml', 'glb', 'usd'] = ...,
    latitude_deg: float = ...,
    longitude_deg: float = ...,
    height_m: float = ...,
) -> ExportResult: ...
def fly(
    *,
    gimbal: str = ...,
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    calibration: str | PathLike[str] | None = ...,
    no_check: bool = ...,
    shadow: Literal['linkage', 'transfer-function', 'none'] | None = ...,
    shadow_set: tuple[tuple[str, float], ...] = ...,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    scene: str = ...,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    model: str | PathLike[str] | None = ...,
    integrator: Literal['implicitfast', 'euler', 'rk4', 'ab1', 'ab2', 'ab3', 'ab4'] | None = ...,
    dt: float | None = ...,
    clock: Literal['lockstep', 'wall'] | None = ...,
    seed: int = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    on_fault: Literal['end', 'neutral', 'ignore'] | None = ...,
    motor: str | PathLike[str] | None = ...,
    launch: Literal['ramp', 'hand', 'stand'] = ...,
    hand_speed_m_s: tuple[float, float] = ...,
    hand_attitude_deg: float = ...,
    hand_rate_deg_s: float = ...,
    any_gain: bool = ...,
    programme: Literal['hold', 'step', 'doublet', 'pitch-over', 'point'] = ...,
    controller: object = ...,
    target: tuple[float, float, float] | None = ...,
    target_range_m: float = ...,
    off_axis_deg: tuple[float, float] = ...,
    within: float | None = ...,
    amplitude_deg: float = ...,
    at_s: float = ...,
    about: Literal['level', 'x'] | None = ...,
    attitude: Literal['truth', 'base-gyro'] = ...,
    control_hz: float = ...,
    duration_s: float = ...,
    repeat: int = ...,
) -> FlightResult | RepeatResult: ...
def history(
    *recordings: str | PathLike[str],
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    board: str | None = ...,
    mechanism: str | PathLike[str] | None = ...,
) -> HistoryResult: ...
def identify(
    *sources: str | PathLike[str],
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    calibration: str | PathLike[str] | None = ...,
    no_check: bool = ...,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    clock: Literal['lockstep', 'wall'] | None = ...,
    seed: int = ...,
    live: str | None = ...,
    until: str | None = ...,
    within_s: float = ...,
    amplitude_deg: float = ...,
    model: str | PathLike[str] | None = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    time: str | None = ...,
    input: str | None = ...,
    angle: str | None = ...,
    angle_unit: str | None = ...,
    input_unit: str | None = ...,
    time_scale: float | None = ...,
    commands: str | PathLike[str] | None = ...,
    input_stamps: Literal['exact', 'sampled'] | None = ...,
    before: str | None = ...,
    linkage: bool = ...,
    poles: int = ...,
    zeros: int = ...,
    delay: str = ...,
    max_delay_ms: float | None = ...,
    select_order: bool = ...,
    servo: bool = ...,
    structure: Literal['best', 'speed', 'clipped', 'command', 'set-point'] = ...,
    coupling: Literal['auto', 'none', 'full'] = ...,
    rate: str | None = ...,
    from_pulses: bool = ...,
    gyro_delay_ms: float = ...,
    initial: Literal['rest', 'free'] = ...,
    check: tuple[str | PathLike[str], ...] = ...,
    check_commands: str | PathLike[str] | None = ...,
    check_only: bool = ...,
    both: bool = ...,
    parameters: tuple[str, ...] = ...,
    mechanism: str | PathLike[str] | None = ...,
) -> IdentifyResult | PhysicsResult | InformationResult | LiveResult: ...
def mechanism(
    action: Literal['show', 'check', 'build', 'search'],
    file: str | PathLike[str] | None,
    *,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    load_g: float = ...,
    gap_mm: float = ...,
    tube_mm: float | None = ...,
    wall_mm: float = ...,
    motor_mm: float | None = ...,
    motor: str | PathLike[str] | None = ...,
    stroke_deg: float = ...,
) -> MechanismResult | BuildResult | SearchResult: ...
def meshes(
    *,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    mechanism: str | PathLike[str] | None = ...,
) -> BuildResult: ...
def mirror(
    *,
    gimbal: str = ...,
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    calibration: str | PathLike[str] | None = ...,
    no_check: bool = ...,
    shadow: Literal['linkage', 'transfer-function', 'none'] | None = ...,
    shadow_set: tuple[tuple[str, float], ...] = ...,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    scene: str = ...,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    model: str | PathLike[str] | None = ...,
    integrator: Literal['implicitfast', 'euler', 'rk4', 'ab1', 'ab2', 'ab3', 'ab4'] | None = ...,
    dt: float | None = ...,
    clock: Literal['lockstep', 'wall'] | None = ...,
    seed: int = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    steer: Literal['keys', 'joystick'] | None = ...,
    playback: str | PathLike[str] | None = ...,
    duration_s: float | None = ...,
    serve: int | None = ...,
    control_hz: float = ...,
) -> MirrorResult: ...
def parameters(
    *words: str | PathLike[str],
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    scene: str = ...,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
) -> ParametersResult: ...
def replay(
    recording: str | PathLike[str],
    *,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    gimbal: Literal['linkage', 'transfer-function', 'emulator', 'firmware'] | None = ...,
    integrator: Literal['implicitfast', 'euler', 'rk4', 'ab1', 'ab2', 'ab3', 'ab4'] | None = ...,
    dt: float | None = ...,
    control_hz: float | None = ...,
    seed: int | None = ...,
    controller: object = ...,
) -> ReplayResult: ...
def report(
    *recordings: str | PathLike[str],
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    time: str | None = ...,
    input: str | None = ...,
    angle: str | None = ...,
    angle_unit: str | None = ...,
    input_unit: str | None = ...,
    time_scale: float | None = ...,
    commands: str | PathLike[str] | None = ...,
    input_stamps: Literal['exact', 'sampled'] | None = ...,
    before: str | None = ...,
    model: tuple[str | PathLike[str], ...] = ...,
    title: str | None = ...,
) -> ReportResult: ...
def rig(
    *,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    kind: Literal['emulator', 'firmware'] = ...,
    port: int | None = ...,
    link: str | PathLike[str] | None = ...,
    scene: Literal['bench', 'turntable'] = ...,
    mechanism: str | PathLike[str] | None = ...,
    seed: int = ...,
    minimal: bool = ...,
    potentiometer_deg: float = ...,
    duration_s: float | None = ...,
) -> None: ...
def step(
    *,
    gimbal: str = ...,
    fault: tuple[str, ...] = ...,
    unit: int | None = ...,
    calibration: str | PathLike[str] | None = ...,
    no_check: bool = ...,
    shadow: Literal['linkage', 'transfer-function', 'none'] | None = ...,
    shadow_set: tuple[tuple[str, float], ...] = ...,
    set: dict[str, float] | tuple[str, ...] = ...,
    set_from: str | PathLike[str] | None = ...,
    scene: str = ...,
    vehicle: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
    model: str | PathLike[str] | None = ...,
    integrator: Literal['implicitfast', 'euler', 'rk4', 'ab1', 'ab2', 'ab3', 'ab4'] | None = ...,
    dt: float | None = ...,
    clock: Literal['lockstep', 'wall'] | None = ...,
    seed: int = ...,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    on_fault: Literal['end', 'neutral', 'ignore'] | None = ...,
    signal: Literal['steps', 'staircase', 'chirp', 'prbs', 'multisine', 'triangle', 'dog-leg'] = ...,
    amplitude_deg: float = ...,
    axis: Literal['x', 'y', 'both'] = ...,
    repeats: int = ...,
    hold_s: float = ...,
    duration_s: float = ...,
    band_hz: tuple[float, float] = ...,
    smallest_deg: float = ...,
    rate_limit_deg_s: float | None = ...,
    control_hz: float = ...,
    commands: str | PathLike[str] | None = ...,
    time: str | None = ...,
    input: str | None = ...,
    input_unit: str = ...,
    ratio: float | None = ...,
    time_scale: float | None = ...,
) -> StepResult: ...
def vehicle(
    action: Literal['show', 'build', 'import'],
    file: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = ...,
    force: bool = ...,
    motor: str | PathLike[str] | None = ...,
    mechanism: str | PathLike[str] | None = ...,
) -> VehicleResult | BuildResult | ImportResult: ...
def view(
    *recordings: str | PathLike[str],
    web: bool = ...,
    port: int = ...,
) -> int: ...

def read(path: str | PathLike[str]) -> Recording: ...
def load(path: str | PathLike[str]) -> Any: ...
