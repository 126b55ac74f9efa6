"""The loop: controller → command → gimbal → state → vehicle, one row a tick. There is no other."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from hardware.frames import GimbalCommand, GimbalState, Pair
from twin.loop.clock import Clock, Ledger
from twin.plant.plant import Plant

Array = NDArray[np.float64]
TIME_UP = "time"  # why a loop ended that nothing else ended


class Gimbal(Protocol):
    """The gimbal seat: takes commands, tells the state that moves the vehicle's gimbal joints."""

    def send(self, command: GimbalCommand) -> None:
        """Pass one command on; never blocks."""

    def poll(self) -> GimbalState:
        """The latest known state; never blocks."""


@runtime_checkable
class Listening(Protocol):
    """A gimbal seat that hears more than the loop asks for."""

    def catch_up(self) -> None:
        """Forget what came before the run, so that the first tick has no more to do than others."""

    def listen(self) -> bool:
        """Hear what must be dated sooner than by the next poll; whether to call again soon."""


class Controller(Protocol):
    """The controller seat: one gimbal angle a tick from whatever it can see."""

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Gimbal angle to command now [rad], `time` in experiment time [s]."""


@dataclass(frozen=True)
class Seats:
    """Who sits where in one run."""

    plant: Plant
    gimbal: Gimbal
    controller: Controller
    clock: Clock


@dataclass(frozen=True)
class Outcome:
    """How a loop ended.

    Attributes
    ----------
    ticks : control ticks begun
    ended : why, in words
    """

    ticks: int
    ended: str


def run(
    seats: Seats,
    *,
    steps_per_tick: int,
    duration_ns: int,
    command: Array,
    each_tick: Sequence[Callable[[int], None]] = (),
    stop: Callable[[], str | None] = lambda: None,
    ledger: Ledger | None = None,
) -> Outcome:
    """Run the loop to its end; parameters and errors are those of `ticks`."""
    tick = ticks(
        seats, steps_per_tick=steps_per_tick, duration_ns=duration_ns, command=command,
        each_tick=each_tick, stop=stop, ledger=ledger,
    )  # fmt: skip
    while not isinstance(outcome := next(tick), Outcome):
        pass
    return outcome


def ticks(
    seats: Seats,
    *,
    steps_per_tick: int,
    duration_ns: int,
    command: Array,
    each_tick: Sequence[Callable[[int], None]] = (),
    stop: Callable[[], str | None] = lambda: None,
    ledger: Ledger | None = None,
) -> Iterator[GimbalState | Outcome]:
    """Run the seats until `duration_ns` of experiment time or until `stop` gives a reason.

    Yields the gimbal's state in every tick, before the controller is asked for its command, and
    the outcome after the last tick.

    Parameters
    ----------
    steps_per_tick : physics steps between two commands
    command : (2,) array that holds the latest command, for the recorder [rad]
    each_tick : called with the tick's time [ns] after the command is sent and before the plant
        moves on, so that what they read belongs to one instant

    Raises
    ------
    DivergenceError : the plant left the finite numbers
    """
    plant, gimbal, controller, clock = seats.plant, seats.gimbal, seats.controller, seats.clock
    count = 0
    time_ns = plant.time_ns
    listen = None
    if isinstance(gimbal, Listening):
        gimbal.catch_up()
        listen = gimbal.listen
    while time_ns < duration_ns:
        late = clock.wait(time_ns, listen)
        if ledger is not None:
            ledger.enter(late)
        state = gimbal.poll()
        yield state
        angle = controller.update(time_ns * 1e-9, state)
        command[0], command[1] = angle
        gimbal.send(GimbalCommand(time_ns, angle))
        for act in each_tick:
            act(time_ns)
        count += 1
        plant.advance(steps_per_tick)
        time_ns = plant.time_ns
        reason = stop()
        if reason is not None:
            yield Outcome(count, reason)
            return
    yield Outcome(count, TIME_UP)
