"""A second gimbal beside a rig: simulated under the same commands, touched by no measurement."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from hardware.events import Event, Level
from hardware.frames import Pair
from hardware.protocol import BAUD, Command, Encoder, constants
from twin.errors import DivergenceError, TwinError
from twin.loop.readings import Readings
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

Array = NDArray[np.float64]
Kind = Literal["linkage", "transfer-function"]

LONGEST_STEP_NS = 1_000_000  # of the bench scene, whatever the step of the vehicle's simulation
FRAME_NS = constants.PWM_PERIOD_US * 1000
BITS = 10  # to a byte on a serial line, with start and stop
# Time of a command on the wire: one that arrives after a pulse frame has begun waits for the next.
WIRE_NS = round(BITS * len(Encoder().encode(Command((0, 0, 0), 0, 0))) / BAUD * 1e9)
SETTLE_NS = 500_000_000  # at rest under gravity, backlash and friction
# Frames sampled before time zero are recorded a few nanoseconds after it.
FIRST_NS = 1000


@dataclass(frozen=True)
class ShadowLost(Event):
    """The model beside the rig is not simulated any more.

    Attributes
    ----------
    reason : of the end
    """

    level: ClassVar[Level] = "WARN"
    reason: str

    @property
    def text(self) -> str:
        """Reason on one line."""
        return f"the model beside the rig ended: {self.reason}"


@dataclass(frozen=True)
class ShadowOptions:
    """Model beside a rig.

    Attributes
    ----------
    kind : servos and rods, or an identified model
    transfer_function : file of the identified model; the shipped reference where None
    mechanism : MJCF file in place of the reference mechanism
    overrides : named parameters of the mechanism
    at_once : whether commands are pulses in force, which wait for no frame
    """

    kind: Kind
    transfer_function: Path | None
    mechanism: Path | None
    overrides: Mapping[str, float]
    at_once: bool = False


class Shadow:
    """A clamped gimbal on the bench that gets every command a rig gets.

    Servos receive pulses every 20 ms, from when the device's clock passes a multiple of that
    (docs/protocol.md); the clock is all that is used of the rig. An identified model has the mean
    wait in its delay and takes commands at once.

    Parameters
    ----------
    tick_ns : time between two commands [ns]

    Attributes
    ----------
    readings : of the rig, whose clock is used
    signals : simulated angle and rate; NaN after the simulation has diverged
    events : since the last tick

    Raises
    ------
    TwinError : a model that cannot be used
    """

    def __init__(self, options: ShadowOptions, tick_ns: int) -> None:
        self._n = steps_of(tick_ns)
        self.plant = Plant(
            load(
                ModelConfig(
                    scene="bench",
                    gimbal=options.kind,
                    transfer_function=options.transfer_function,
                    mechanism=options.mechanism,
                    overrides=options.overrides,
                    dt=tick_ns / self._n * 1e-9,
                )
            )
        )
        self.readings = Readings()
        self._at_once = options.at_once or options.kind == "transfer-function"
        angle, rate = self.plant.gimbal_angle, self.plant.gimbal_rate
        self.signals: Mapping[str, Array] = {
            "gimbal/simulated": angle,
            "gimbal/rate/simulated": rate,
        }
        self.events: list[ShadowLost] = []
        self.reset()

    def reset(self) -> None:
        """Return to rest at time zero."""
        self.plant.reset()
        rested(self.plant)
        self._waiting: deque[tuple[int, Pair]] = deque()
        self._stamp_ns = -1
        self._clock: tuple[int, int] | None = None  # experiment and device time of a frame [ns]
        self._latched_ns = -FRAME_NS
        self._lost = False

    def advance(self, command: Array) -> None:
        """Simulate one tick under a command (2,) that was sent at its beginning [rad]."""
        self.events.clear()
        self._read_clock()
        if self._lost:
            return
        angle = float(command[0]), float(command[1])
        if self._at_once:
            self.plant.drive(angle)
        else:
            self._waiting.append((self.plant.time_ns + WIRE_NS, angle))
        try:
            self._simulate()
        except DivergenceError as error:
            self._lost = True
            self.events.append(ShadowLost(str(error)))
            self.plant.gimbal_angle[:] = self.plant.gimbal_rate[:] = math.nan

    def _simulate(self) -> None:
        plant = self.plant
        begin, left = plant.time_ns, self._n
        end = begin + left * plant.dt_ns
        while (frame := self._next_frame(begin)) < end:
            ahead = min(round((frame - plant.time_ns) / plant.dt_ns), left)
            if ahead > 0:
                plant.advance(ahead)
                left -= ahead
            self._latch(frame)
        if left:
            plant.advance(left)

    def _read_clock(self) -> None:
        for frame in self.readings.frames:
            # the same stamps as in the recording, from which a replay reads them
            self._stamp_ns = max(frame.time_ns, self._stamp_ns + 1)
            if self._stamp_ns >= FIRST_NS:
                self._clock = self._stamp_ns, frame.device_us * 1000

    def _next_frame(self, begin_ns: int) -> int:
        """When the next pulse frame begins [ns]; far away while the clock is unknown."""
        if self._clock is None or self._at_once:
            return 1 << 62
        return frame_after(begin_ns, self._latched_ns, self._clock)

    def _latch(self, frame_ns: int) -> None:
        """Put the newest command that has arrived into force."""
        self._latched_ns = frame_ns
        angle = None
        while self._waiting and self._waiting[0][0] <= frame_ns:
            angle = self._waiting.popleft()[1]
        if angle is not None:
            self.plant.drive(angle)


def rested(plant: Plant) -> Plant:
    """The plant at time zero, after it has come to rest at its neutral command."""
    plant.drive((0.0, 0.0))
    plant.advance(SETTLE_NS // plant.dt_ns)
    plant.steps = 0
    return plant


def frame_after(begin_ns: int, latched_ns: int, clock: tuple[int, int]) -> int:
    """When the next pulse frame begins [ns].

    Parameters
    ----------
    begin_ns : of the tick
    latched_ns : beginning of the last frame
    clock : experiment and device time of a reading [ns]
    """
    # half a frame: an estimate of the clock that moved must neither repeat nor skip a frame
    earliest = max(begin_ns - FRAME_NS // 2, latched_ns + FRAME_NS // 2)
    stamp, device = clock
    return earliest + -(earliest - stamp + device) % FRAME_NS


def steps_of(tick_ns: int) -> int:
    """Physics steps of a tick: the fewest of a whole number of nanoseconds and at most 1 ms."""
    fewest = -(-tick_ns // LONGEST_STEP_NS)
    steps = next((n for n in range(fewest, 4 * fewest + 1) if tick_ns % n == 0), None)
    if steps is None:
        raise TwinError(
            f"--control-hz: its period of {tick_ns} ns is not a whole number of steps of the"
            " model beside the rig; give another rate, or --shadow none"
        )
    return steps
