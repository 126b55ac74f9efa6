"""The loop: controller → command → gimbal → state → vehicle, one row a tick."""

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
    """The gimbal seat: takes commands and gives the state that the gimbal joints follow."""

    def send(self, command: GimbalCommand) -> None:
        """Send one command; does not block."""

    def poll(self) -> GimbalState:
        """Return the latest known state; does not block."""


@runtime_checkable
class Listening(Protocol):
    """A gimbal seat that must be served between two polls."""

    def catch_up(self) -> None:
        """Process what arrived before the run, to keep the first tick as short as others."""

    def listen(self) -> bool:
        """Receive what must be time-stamped before the next poll; return whether to call again."""


class Controller(Protocol):
    """The controller seat: one gimbal angle a tick."""

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Return the gimbal angle to command now [rad], at experiment time `time` [s]."""


@dataclass(frozen=True)
class Seats:
    """The components of one run."""

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
    ended : reason
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
    """Run until `duration_ns` of experiment time or until `stop` gives a reason.

    Yields the gimbal's state in every tick, before the controller is asked for its command, and
    the outcome after the last tick.

    Parameters
    ----------
    steps_per_tick : physics steps between two commands
    command : (2,) array that holds the latest command, for the recorder [rad]
    each_tick : called with the time of the tick [ns] after the command is sent and before the
        plant advances, so that all they read belongs to one instant

    Raises
    ------
    DivergenceError : the simulation diverged
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
