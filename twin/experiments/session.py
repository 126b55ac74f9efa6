"""One run, put together in the one right order and taken apart in it: fly, step and mirror."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from analysis import schema
from hardware.frames import GimbalCommand, GimbalState
from twin import status
from twin.config import OnFault, Run
from twin.config.paths import point_latest
from twin.config.seats import is_rig
from twin.experiments.assembly import (
    make_plant,
    rig_options,
    shadow_options,
    steps_per_tick,
)
from twin.experiments.kept import Origin
from twin.experiments.provenance import make_recorder
from twin.hil.failsafe import Guard
from twin.loop.clock import Clock, Ledger, Lockstep, Wall
from twin.loop.loop import Controller, Gimbal, Outcome, Seats, run
from twin.loop.readings import Readings
from twin.loop.seats import SimulatedGimbal
from twin.plant.compiled import compiled
from twin.recorder import Sink
from twin.recorder.rows import Eventful, Rows, Source

if TYPE_CHECKING:
    from analysis.recording import Recording
    from analysis.timing import Verdict
    from twin.hil import RigGimbal
    from twin.hil.shadow import Shadow
    from twin.hil.turntable import Turntable

LONGEST_SHOWN_NS = 60_000_000_000  # a longer one is a limit that a run seldom reaches
REHEARSALS = 3  # ticks before the clock starts: the first one takes 15 ms


class Session:
    """A run's plant, gimbal seat, recorder and clock.

    `with Session(...) as s:` builds plant and gimbal; `s.record(...)` opens the recording;
    `s.run(...)` runs the loop once; leaving the block releases the rig, then closes the recording.

    Parameters
    ----------
    config : settings of the run
    verb : `fly`, `step` or `mirror`
    control_hz : rate of the loop [Hz]
    motor : motor file in place of the vehicle's own motor
    playback : recording whose readings take the place of a rig
    origin : what is recorded about the files of a run that is repeated
    timed : whether the lateness of every tick is recorded in real time
    recorded : whether the run may be recorded

    Attributes
    ----------
    plant : owner of the simulation
    steps, tick_ns : physics steps of a tick, and its length [ns]
    gimbal : component in the gimbal seat
    rig : the same where it is a rig, else None
    readings : of that component, where it has sensors
    shadow : model beside a rig, else None

    Raises
    ------
    TwinError, HardwareError : something asked for cannot be done, in one line
    """

    def __init__(
        self,
        config: Run,
        verb: str,
        control_hz: float,
        *,
        motor: Path | None = None,
        playback: "Recording | None" = None,
        origin: Origin | None = None,
        timed: bool = True,
        recorded: bool = True,
    ) -> None:
        self.config, self.verb = config, verb
        self.real_time = config.real_time and playback is None
        self._control_hz, self._motor, self._playback = control_hz, motor, playback
        self._origin, self._recorded = origin, recorded
        # a rig is released before its run is judged, and before the recording is complete
        self._stack, self._live = ExitStack(), ExitStack()
        self.rig: RigGimbal | None = None
        self.readings: Readings | None = None
        self.shadow: Shadow | None = None
        self._ledger = Ledger() if self.real_time and timed else None
        self._clock: Wall | None = None

    def __enter__(self) -> Self:
        """Build the plant and connect the gimbal."""
        try:
            self._stack.enter_context(compiled())
            self.plant = make_plant(self.config, self._motor, recorded=self._recorded)
            self.steps = steps_per_tick(self._control_hz, self.plant)
            self.tick_ns = self.steps * self.plant.dt_ns
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Release the rig and the clock, then close the recording."""
        try:
            self._live.__exit__(kind, error, trace)
        finally:
            self._stack.__exit__(kind, error, trace)

    def connect(self, *, watch: bool = False) -> None:
        """Connect the component that `--gimbal` names; `watch` sends it no commands.

        Raises
        ------
        TwinError, HardwareError : a rig that cannot be opened, in one line
        """
        if not is_rig(self.config.gimbal):
            self.gimbal: Gimbal = SimulatedGimbal(self.plant)
            return
        from twin.hil import open_rig

        self.shadow = self._beside(watch=watch)  # refused before a servo moves
        options = rig_options(self.config, watch=watch)
        self.rig = self._live.enter_context(open_rig(options, self.plant, self._playback))
        self.seat(self.rig, self.rig.readings)
        if self.shadow is not None:
            self.shadow.readings = self.rig.readings

    def _beside(self, *, watch: bool) -> "Shadow | None":
        options = shadow_options(self.config, watch=watch)
        if options is None:
            return None
        from twin.hil.shadow import Shadow

        return Shadow(options, self.tick_ns)

    def seat(self, gimbal: Gimbal, readings: Readings) -> None:
        """Use this component with sensors as the gimbal."""
        self.gimbal, self.readings = gimbal, readings

    def turntable(self) -> "Turntable | None":
        """The attitude seat of a rig on a turntable; None where the controller sees the truth."""
        if self.rig is None or self.rig.base is None:
            return None
        from twin.hil.connect import lead
        from twin.hil.turntable import Turntable

        ahead = lead(rig_options(self.config))
        return Turntable(self.plant, self.rig, self.rig.base, ahead, self.tick_ns * 1e-9)

    def guard(
        self,
        controller: Controller,
        on_fault: OnFault | None,
        turntable: "Turntable | None" = None,
    ) -> Guard | None:
        """The fail-safe around a controller of a rig; None where there is no rig."""
        if self.rig is None:
            return None
        return Guard(controller, self.rig.readings, on_fault or "end", turntable)

    def gather(self, *sources: Source | Eventful | None) -> None:
        """Make the rows of a run, which `record` writes; they derive their signals without it."""
        given = (*sources, self.shadow, self._ledger)
        self.rows = Rows(self.plant, *given, readings=self.readings)

    def record(
        self,
        *sources: Source | Eventful | None,
        serve: int | None = None,
        drain_ns: int | None = None,
    ) -> Sink:
        """Open the recording.

        Parameters
        ----------
        sources : parts of the run whose signals and events are recorded too; None is skipped
        serve : port of a live viewer on this machine
        drain_ns : time between two writes; by the clock if omitted

        Raises
        ------
        TwinError : the file cannot be written, or the port is taken
        """
        self.gather(*sources)
        recorder = make_recorder(
            self.config, self.verb, self.plant, self.rows, real_time=self.real_time,
            serve=serve, drain_ns=drain_ns, rig=self.rig, origin=self._origin, shadow=self.shadow,
        )  # fmt: skip
        self._stack.callback(point_latest, recorder.path)  # once it is closed
        self.recorder = self._stack.enter_context(recorder)
        self.rows.bind(self.recorder)
        for note in self.notes:
            self.recorder.event(self.plant.time_ns, note)
        return self.recorder

    @property
    def notes(self) -> tuple[str, ...]:
        """What is worth knowing about the rig, one line each."""
        return (self.rig.note,) if self.rig is not None and self.rig.note else ()

    def rehearse(self, controller: Controller) -> None:
        """Go through what a tick does and back to the start, where it would make a tick late.

        Parameters
        ----------
        controller : one that nothing else uses, since it may have a state
        """
        if not self.real_time:
            return
        plant = self.plant
        for _ in range(REHEARSALS):
            time_ns = plant.time_ns
            controller.update(time_ns * 1e-9, GimbalState(time_ns, (0.0, 0.0)))
            if isinstance(self.gimbal, SimulatedGimbal):  # a rig would move
                self.gimbal.send(GimbalCommand(time_ns, (0.0, 0.0)))
            self.rows.derive(time_ns)
            plant.advance(self.steps)
            if self.shadow is not None:
                self.shadow.advance(self.rows.command)
        plant.reset()
        plant.computing_s = 0.0
        if self.shadow is not None:
            self.shadow.reset()

    def run(
        self,
        controller: Controller,
        duration_ns: int,
        *,
        each_tick: Sequence[Callable[[int], None]] | None = None,
        stop: Callable[[], str | None] = lambda: None,
        doing: status.Text | None = None,
    ) -> Outcome:
        """Run the loop to its end and release the rig.

        Parameters
        ----------
        each_tick : called with the time of each tick [ns]; the rows of the recording if omitted
        stop : gives the reason to end, or None
        doing : status line; the experiment time if omitted

        Raises
        ------
        DivergenceError : the physics left the finite numbers; the recording up to there is kept
        """
        plant, of = (
            self.plant,
            "" if duration_ns > LONGEST_SHOWN_NS else f" of {duration_ns * 1e-9:.0f} s",
        )
        status.say(doing or (lambda: f"running, experiment time {plant.time_ns * 1e-9:.1f} s{of}"))
        seat: Clock = Wall() if self.real_time else Lockstep()
        clock = self._live.enter_context(seat)
        self._clock = clock if isinstance(clock, Wall) else None
        if self._playback is not None:  # it ends with its last tick, also where its run was cut off
            last_ns = int(self._playback["gimbal/command"].time_ns[-1])
            duration_ns = min(duration_ns, last_ns + 1)
        outcome = run(
            Seats(self.plant, self.gimbal, controller, clock),
            steps_per_tick=self.steps,
            duration_ns=duration_ns,
            command=self.rows.command,
            each_tick=(self.rows.write,) if each_tick is None else each_tick,
            stop=self.beside(stop),
            ledger=self._ledger,
        )
        status.say("writing the recording")
        self._live.close()
        return outcome

    def beside(self, stop: Callable[[], str | None]) -> Callable[[], str | None]:
        """The same end of a run, asked for before the model beside its rig takes the tick."""
        if (shadow := self.shadow) is None:
            return stop

        def ended() -> str | None:
            reason = stop()
            shadow.advance(self.rows.command)
            return reason

        return ended

    def verdict(self) -> "Verdict | None":
        """Whether real time left the run valid; None in lockstep. It becomes part of the recording.

        Call after `run`, before the block ends.
        """
        if self._clock is None:
            return None
        from analysis.recording import read
        from twin.experiments.timing import verdict

        rights = self._clock.rights
        judged = verdict(
            read(self.recorder.flush(), growing=True),
            overruns=self._clock.overruns,
            rights={"SCHED_FIFO": rights.scheduling, "locked memory": rights.memory},
            stolen=self._clock.stolen,
        )
        self.recorder.attach(schema.TIMING, judged.as_dict())
        level = "INFO" if judged.word == "valid" else "WARN"
        self.recorder.event(self.plant.time_ns, f"timing {judged.text()}", level)
        return judged
