"""A rig's readings into the recorder: one row a sensor frame at its own stamp, and its link."""

import numpy as np
from numpy.typing import NDArray

from analysis.schema import FRAME, RARE, TICK
from hardware.events import HealthChanged
from hardware.frames import GimbalState, SensorFrame
from twin.loop.readings import Readings
from twin.recorder import Sink


class RigRows:
    """Writes what a rig said since the last tick.

    A frame's row carries the time at which the device took it, not the tick that found it: the
    difference is the sensors' age, which would else go into every delay identified from the file.

    Parameters
    ----------
    readings : of the seat, renewed by its poll
    """

    signals = (*FRAME, *RARE, *TICK)

    def __init__(self, readings: Readings) -> None:
        self._readings = readings
        self._last_ns = -1
        self._counts: tuple[int, int, bool] | None = None
        self._trips = 0
        self._latest: list[tuple[float, ...]] = [()] * len(RARE)

    def bind(self, recorder: Sink) -> None:
        """Find the places in the recorder's row; the frame's signals lie side by side in it."""
        at = recorder.slices
        self._recorder = recorder
        self._frame: NDArray[np.float64] = recorder.row[at[FRAME[0]].start : at[FRAME[-1]].stop]
        self._rare = [recorder.row[at[name]] for name in RARE]
        self._tick: NDArray[np.float64] = recorder.row[at[TICK[0]].start : at[TICK[-1]].stop]

    def write(self, time_ns: int, wall_origin_ns: int) -> None:
        """Commit a row a frame, then leave the link's state in the row of this tick."""
        recorder, r = self._recorder, self._readings
        if r.snapshot is not None:
            recorder.estimator(time_ns, r.snapshot)
        if r.frames:
            recorder.row[:] = np.nan
            taken = time_ns * 1e-9
            for frame, state in zip(r.frames, r.states, strict=True):
                # Every frame that moved the estimate has its row, or a replay could not repeat it:
                # the first ones, sampled before time zero, are put just behind it. Later on a
                # better estimate of the device's clock may move a stamp back by microseconds.
                at = max(frame.time_ns, self._last_ns + 1)
                self._last_ns = at
                self._frame[:] = (*_values(frame, state), taken)
                self._note(_rare(frame, r))
                recorder.commit(at, wall_origin_ns + at)
        self._frame[:] = np.nan
        for view in self._rare:
            view[:] = np.nan
        self._tick[:] = np.nan
        if r.age_ns is not None:
            self._tick[0] = r.age_ns * 1e-9
        # every round trip counts once, and a count only where it changes
        if r.round_trip_ns is not None and r.round_trips != self._trips:
            self._trips = r.round_trips
            self._tick[1] = r.round_trip_ns * 1e-9
        counts = (r.lost, r.crc_errors, r.ready)
        if counts != self._counts:
            self._counts = counts
            self._tick[2:] = counts
        for event in r.events:
            if isinstance(event, HealthChanged):
                recorder.health(time_ns, event.health)
            else:
                recorder.event(time_ns, event.text, event.level)

    def _note(self, rare: tuple[tuple[float, ...], ...]) -> None:
        for k, values in enumerate(rare):
            self._rare[k][:] = np.nan if values == self._latest[k] else values
            self._latest[k] = values


def _rare(f: SensorFrame, r: Readings) -> tuple[tuple[float, ...], ...]:
    return f.switches, f.joystick, (f.flags,), (r.session,), (r.gyro_delay,)


def _values(f: SensorFrame, s: GimbalState) -> tuple[float, ...]:
    return (
        *s.angle,
        *s.sigma,
        *s.rate,
        *f.potentiometer,
        *f.gyro,
        *f.accelerometer,
        *f.base_gyro,
        *f.base_accelerometer,
        *f.pulse,
        f.device_us * 1e-6,
    )
