"""Timing verdict of a recorded run, from re-simulations with and without its delays.

The identified model takes the place of a recorded rig's gimbal, so a re-simulation shows the effect
of delays on the loop, not the behaviour of the rig.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.convergence import Trajectory
from analysis.delays import Delays
from analysis.recording import Recording
from analysis.timing import Limits, Rerun, Verdict, assess
from hardware.frames import GimbalCommand, GimbalState
from hardware.protocol import BAUD, Encoder, Ping, Pong
from twin.config import Fly, Run, with_model
from twin.config.recorded import configuration_of
from twin.config.seats import is_rig
from twin.control import AttitudeController
from twin.errors import DivergenceError, TwinError
from twin.experiments.assembly import make_plant, steps_per_tick
from twin.experiments.programme import setpoint
from twin.loop.clock import Lockstep
from twin.loop.loop import Gimbal, Seats, run
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.plant.authority import control_config

Array = NDArray[np.float64]
SAMPLE_S = 0.1  # between the instants compared
PWM_FRAME_S = 0.020  # of hobby servos; a command waits half of it on average
# A step test has no feedback, and the device stamps each sample: a delay has no effect on it.
OPEN_LOOP = Limits(delay=math.inf)
BITS = 10  # to a byte on a serial line, with start and stop


class DelayedGimbal:
    """A gimbal whose commands arrive late, by any part of a tick.

    A command in force from one tick to the next and delayed by τ is, as a mean over a tick, the
    straight line between two commands; τ may change from tick to tick.

    Parameters
    ----------
    gimbal : receives the delayed commands
    delays : over experiment time
    period_ns : of the ticks
    """

    def __init__(self, gimbal: Gimbal, delays: Delays, period_ns: int) -> None:
        self._gimbal, self._delays, self._period = gimbal, delays, period_ns
        self._sent: list[tuple[float, float]] = []

    def send(self, command: GimbalCommand) -> None:
        """Pass on the command of one delay ago; zero before the first command."""
        self._sent.append(command.angle)
        late = float(np.interp(command.time_ns * 1e-9, self._delays.time, self._delays.value))
        late = max(0.0, late)  # an estimate of the device's clock may be off by more than the delay
        at = len(self._sent) - 1 - late * 1e9 / self._period
        angle = (0.0, 0.0)
        if at > -1.0:
            k = int(np.floor(at))
            a, b = (self._sent[k] if k >= 0 else (0.0, 0.0)), self._sent[min(k + 1, self._last)]
            share = at - k
            angle = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        self._gimbal.send(replace(command, angle=angle))

    @property
    def _last(self) -> int:
        return len(self._sent) - 1

    def poll(self) -> GimbalState:
        """State of the gimbal."""
        return self._gimbal.poll()


def rerun_of(recording: Recording, gimbal: str | None = None) -> Rerun:
    """A function that simulates a recorded flight again, for `analysis.timing`.

    Parameters
    ----------
    gimbal : `linkage` or `transfer-function` in place of the recorded one; a rig's is always
        replaced by its identified model

    Raises
    ------
    TwinError : the recording is not of a flight
    """
    asked = configuration_of(recording)
    if not isinstance(asked, Fly):
        raise TwinError("only a flight has a path that timing could have moved")
    seat = gimbal or ("transfer-function" if is_rig(asked.gimbal) else asked.gimbal)
    config = with_model(asked, seat, out=None)
    end_ns = int(recording["gimbal/command"].time_ns[-1])

    def fly(delays: Delays | None, finer: int) -> Trajectory:
        return _flown(config, delays, finer, end_ns)

    return fly


def verdict(
    recording: Recording,
    *,
    overruns: int | None = None,
    rights: Mapping[str, str] | None = None,
    stolen: float = 0.0,
    limits: Limits | None = None,
) -> Verdict:
    """The timing verdict of a recorded run, within `native.installed()`.

    Raises
    ------
    AnalysisError : the recording has no timing signals
    """
    config = configuration_of(recording)
    # an own controller is not executed again
    again = isinstance(config, Fly) and config.controller is None
    rerun = rerun_of(recording) if again else None
    if limits is None:
        limits = Limits() if isinstance(config, Fly) else OPEN_LOOP
    rig = is_rig(config.gimbal)
    return assess(
        recording,
        _period(config),
        rerun=rerun,
        overruns=overruns,
        wire=_wire() if rig else 0.0,
        frame=0.5 * PWM_FRAME_S if rig else 0.0,
        limits=limits,
        rights=rights or {},
        stolen=stolen,
    )


def _wire() -> float:
    """Time on the line of one PING and its PONG [s]."""
    encoder = Encoder()
    return BITS * sum(len(encoder.encode(m)) for m in (Ping(0), Pong(0, 0, 0))) / BAUD


def _period(config: Run) -> float:
    hz = getattr(config, "control_hz", 0.0)
    return 1.0 / hz if hz > 0 else 0.0


def _flown(config: Fly, delays: Delays | None, finer: int, end_ns: int) -> Trajectory:
    plant = make_plant(config, config.motor)
    if finer > 1:
        plant = make_plant(replace(config, dt=round(plant.dt_ns / finer) * 1e-9), config.motor)
    steps = steps_per_tick(config.control_hz, plant)
    tick_ns = steps * plant.dt_ns
    programme, _ = setpoint(config, plant.model)
    pilot = Pilot(plant, AttitudeController(control_config(plant.model)), programme, tick_ns * 1e-9)
    gimbal: Gimbal = SimulatedGimbal(plant)
    if delays is not None:
        gimbal = DelayedGimbal(gimbal, delays, tick_ns)
    ticks = max(1, round(SAMPLE_S * 1e9 / tick_ns))
    every = ticks * tick_ns
    kept: list[tuple[float, Array, Array]] = []

    def sample(time_ns: int) -> None:
        if time_ns % every == 0:
            # the tick's nominal time: refined steps of whole nanoseconds may miss it by a few
            at = time_ns // every * ticks / config.control_hz
            kept.append((at, plant.position.copy(), plant.attitude.copy()))

    with suppress(DivergenceError):  # an unstable loop; the comparison ends there
        run(
            Seats(plant, gimbal, pilot, Lockstep()),
            steps_per_tick=steps,
            duration_ns=end_ns,
            command=np.zeros(2),
            each_tick=(sample,),
            stop=lambda: "ground" if plant.landed else None,
        )
    time, position, attitude = (np.array(c) for c in zip(*kept, strict=True))
    return Trajectory(time, position, attitude)
