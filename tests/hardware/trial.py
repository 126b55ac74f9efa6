"""A run of an emulated rig with the truth beside it: what studies, tests and tuning start from."""

from collections.abc import Callable
from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from hardware.calibration import CalibrationRig, Procedure
from hardware.calibration.result import Calibration
from hardware.emulator.bench import RigParameters
from hardware.emulator.emulator import Emulator
from hardware.emulator.injection import Injection
from hardware.emulator.truth import exact_calibration
from hardware.frames import GimbalCommand, Pair, SensorFrame
from hardware.rig import Rig, in_process

Array = NDArray[np.float64]

COMMAND_US = 10_000
Command = Callable[[float], Pair]


@dataclass(frozen=True, slots=True)
class Change:
    """One sensor's state moved.

    Attributes
    ----------
    time : rig time [s]
    sensor, old, new, kind : arguments of the monitor's listener
    """

    time: float
    sensor: str
    old: str
    new: str
    kind: str


@dataclass(frozen=True, slots=True)
class Trial:
    """Frame by frame, n frames of one run.

    Attributes
    ----------
    time : world time of the sample (n,) [s]
    true_angle, true_rate, true_bias : (n, 2) [rad], [rad/s], [rad/s]
    angle, rate : estimates (n, 2)
    sigma : stated standard deviation of the angle (n, 2) [rad]
    potentiometer : each potentiometer's angle by its map (n, 4) [rad]
    state, covariance : of the filters (n, 2, 4), (n, 2, 4, 4)
    changes : of the sensors' health, in order
    """

    time: Array
    true_angle: Array
    true_rate: Array
    true_bias: Array
    angle: Array
    rate: Array
    sigma: Array
    potentiometer: Array
    state: Array
    covariance: Array
    changes: tuple[Change, ...]

    def error(self, start: float = 0.0, end: float = np.inf) -> Array:
        """Return the angle's root-mean-square error per axis in a window [s] → (2,) [rad]."""
        inside = (self.time >= start) & (self.time < end)
        square: Array = (self.angle - self.true_angle)[inside] ** 2
        return np.asarray(np.sqrt(square.mean(axis=0)))

    def named(self, start: float = 0.0) -> dict[str, float]:
        """Return when each sensor was first named at or after a time [s]."""
        first: dict[str, float] = {}
        for c in self.changes:
            if c.new == "faulty" and c.old in ("ok", "suspect") and c.time >= start:
                first.setdefault(c.sensor, c.time)
        return first


def random_steps(seed: int, amplitude: float = radians(6.0), hold: float = 0.3) -> Command:
    """Return a command that jumps to a new random angle every `hold` seconds."""
    steps = np.random.default_rng([seed, 7]).uniform(-amplitude, amplitude, (4096, 2)).tolist()

    def command(time: float) -> Pair:
        x, y = steps[int(time / hold) % len(steps)]
        return x, y

    return command


def run(
    parameters: RigParameters,
    command: Command,
    duration: float,
    *,
    injections: tuple[Injection, ...] = (),
    seed: int = 0,
    calibration: Calibration | None = None,
    safe: float | None = None,
) -> Trial:
    """Drive a rig open loop and note truth and estimate of every frame.

    Parameters
    ----------
    parameters : the rig
    command : rig time [s] → gimbal angles [rad]
    duration : [s]
    injections : faults, in rig time
    seed : of the sensors' noise
    calibration : the exact one when left out
    safe : time for which a run goes on, commanded to zero, after a fault is named [s]
    """
    device = Emulator(parameters, injections=injections, seed=seed)
    rig = in_process(device, calibration or exact_calibration(parameters))
    truth: dict[int, tuple[float, Pair, Pair, Pair]] = {}

    def observe(device_us: int, angle: Pair, rate: Pair) -> None:
        jump = radians(device.bench._value("gyro", "bias"))
        bias = device.bench._imus.bias[:2] + jump
        truth[device_us] = (device.bench.time, angle, rate, (bias[0], bias[1]))

    device.observer = observe
    changes: list[Change] = []
    rig.fusion.monitor.listener = lambda sensor, old, new, kind: changes.append(
        Change(device.time_us * 1e-6, sensor, str(old), str(new), kind)
    )
    rig.connect()
    rows: list[list[float]] = []
    while (time := device.time_us * 1e-6) < duration:
        named = [c.time for c in changes if c.new == "faulty"] if safe is not None else []
        if named and time > named[0] + (safe or 0.0):
            break
        if device.time_us % COMMAND_US == 0:
            rig.send(GimbalCommand(device.time_ns, (0.0, 0.0) if named else command(time)))
        device.advance_us(1000)  # one frame at most: the filter's state is that of the last
        rows.extend(_row(rig, frame, truth.pop(frame.device_us)) for frame in rig.poll())
        if len(truth) > 1000:
            truth.clear()
    return _trial(rows, tuple(changes), rig)


def _row(rig: Rig, frame: SensorFrame, truth: tuple[float, Pair, Pair, Pair]) -> list[float]:
    time, angle, rate, bias = truth
    state = rig.state
    assert state is not None
    maps = rig.calibration.potentiometers
    readings = [m.angle(f) for m, f in zip(maps, frame.potentiometer, strict=True)]
    x, P = rig.fusion.filter.x.ravel().tolist(), rig.fusion.filter.P.ravel().tolist()
    return [time, *angle, *rate, *bias, *state.angle, *state.rate, *state.sigma, *readings, *x, *P]


def _trial(rows: list[list[float]], changes: tuple[Change, ...], rig: Rig) -> Trial:
    a = np.array(rows)
    # What the filter calls bias is what the calibration has not taken out, in gimbal axes.
    (p, q), (r, s) = rig.calibration.gyro.matrix
    rest = a[:, 5:7] - np.array(rig.calibration.gyro.bias[:2])
    bias = rest @ np.linalg.inv(np.array([[p, q], [r, s]])).T
    return Trial(
        time=a[:, 0],
        true_angle=a[:, 1:3],
        true_rate=a[:, 3:5],
        true_bias=bias,
        angle=a[:, 7:9],
        rate=a[:, 9:11],
        sigma=a[:, 11:13],
        potentiometer=a[:, 13:17],
        state=a[:, 17:25].reshape(-1, 2, 4),
        covariance=a[:, 25:57].reshape(-1, 2, 4, 4),
        changes=changes,
    )


def calibrate(
    parameters: RigParameters,
    rig: CalibrationRig | None = None,
    *,
    injections: tuple[Injection, ...] = (),
    seed: int = 0,
) -> Calibration:
    """Run a whole calibration of an emulated rig and return its result.

    Raises
    ------
    hardware.calibration.CalibrationError : implausible
    """
    device = Emulator(parameters, injections=injections, seed=seed)
    seat = in_process(device, fuse=False)
    hello = seat.connect()
    procedure = Procedure(rig or CalibrationRig(seed=seed), hello.serial)
    frames = 0
    while not procedure.done:
        device.advance_us(2000)
        for frame in seat.poll():
            pulses = procedure.step(frame)
            frames += 1
            if frames % 5 == 0:
                seat.send_pulses(*pulses)
    return procedure.result()
