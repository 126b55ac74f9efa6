"""One flight that waits for a command in every tick."""

from contextlib import ExitStack

import numpy as np

from hardware.frames import GimbalState, Pair
from twin.config import Fly
from twin.control import AttitudeController
from twin.errors import DivergenceError, TwinError
from twin.experiments.flight.flight import Flight
from twin.experiments.programme import setpoint
from twin.experiments.session import Session
from twin.gym.observation import Observation, Observer
from twin.loop.clock import Lockstep
from twin.loop.loop import Controller, Outcome, Seats, ticks
from twin.loop.seats import Pilot
from twin.plant.authority import control_config


class _Held:
    """The controller seat: commands what it was given before the tick."""

    angle: Pair = (0.0, 0.0)

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        return self.angle


class Episode:
    """A flight's seats around the loop, which stands before the command of its first tick.

    Attributes
    ----------
    plant, pilot, flight, observer : of this flight; the pilot's command is not used
    observation : (13,) before the next command, or after the last
    outcome : how it ended; None while it has not

    Raises
    ------
    TwinError, HardwareError : something asked for cannot be done, in one line
    """

    def __init__(self, config: Fly) -> None:
        with ExitStack() as stack:
            self._session = s = stack.enter_context(
                Session(config, "fly", config.control_hz, motor=config.motor)
            )
            self.plant = plant = s.plant
            if not plant.has_vehicle or plant.twin.gimbal == "fixed":
                raise TwinError(f"--scene {config.scene}: has no vehicle with a gimbal to control")
            programme, target = setpoint(config, plant.model)
            s.connect()
            turntable = s.turntable()
            loop = AttitudeController(control_config(plant.model))
            self.period = s.tick_ns * 1e-9
            self.pilot = Pilot(plant, loop, programme, self.period, turntable)
            self.flight = flight = Flight(plant, target)
            self.observer = Observer(plant.model)
            self._held = _Held()
            guard = s.guard(self._held, config.on_fault, turntable)
            controller: Controller = guard or self._held
            ended = flight.over if guard is None else lambda: guard.over() or flight.over()
            self._command, acts = np.zeros(2), [flight.watch]
            if config.out is not None:
                flight.announce = s.record(self.pilot, turntable).event
                self._command, acts = s.rows.command, [s.rows.write, flight.watch]
            self._ticks = ticks(
                Seats(plant, s.gimbal, controller, Lockstep()),
                steps_per_tick=s.steps,
                duration_ns=round(config.duration_s * 1e9),
                command=self._command,
                each_tick=acts,
                stop=ended if config.out is None else s.beside(ended),
            )
            self.outcome: Outcome | None = None
            self._recorded = config.out is not None
            self._stack = stack.pop_all()
        self._go_on()

    def advance(self, angle: Pair) -> None:
        """Command a gimbal angle [rad] and go on to the next tick, or to the end.

        Raises
        ------
        TwinError : the episode has ended
        """
        if self.outcome is not None:
            raise TwinError("the episode has ended; call reset()")
        self._held.angle = angle
        self._go_on()

    def _go_on(self) -> None:
        """Run the loop to the next command."""
        try:
            item = next(self._ticks)
        except DivergenceError as error:  # the last observation stays, since there is no state
            self._end(Outcome(0, str(error)))
            return
        except BaseException:
            self.close()
            raise
        self.observation = self._observed(
            self._session.gimbal.poll() if isinstance(item, Outcome) else item
        )
        if isinstance(item, Outcome):
            self._end(item)

    def _observed(self, gimbal: GimbalState) -> Observation:
        time = self.plant.time_ns * 1e-9
        self.action_of_pilot = self.pilot.update(time, gimbal)
        return self.observer.observe(time, gimbal, self.pilot.vehicle(), self.pilot.direction)

    def _end(self, outcome: Outcome) -> None:
        self.outcome = outcome
        if self._recorded:
            self._session.recorder.event(self.plant.time_ns, f"flight ended: {outcome.ended}")
        self.close()

    def close(self) -> None:
        """Release a rig and complete the recording; a second call does nothing."""
        self._stack.close()
