"""Recording of a rig: one row per sensor frame at its time stamp, and link statistics."""

import numpy as np
from numpy.typing import NDArray

from analysis.schema import FRAME, RARE, TICK
from hardware.events import HealthChanged
from hardware.frames import GimbalState, SensorFrame
from twin.loop.readings import Readings
from twin.recorder import Sink


class RigRows:
    """Writes the frames and events of a rig since the last tick.

    The row of a frame has the time at which the device sampled it, not the time of the tick: their
    difference is the age of the reading, which would otherwise add to every identified delay.

    Parameters
    ----------
    readings : of the gimbal seat
    """

    signals = (*FRAME, *RARE, *TICK)

    def __init__(self, readings: Readings) -> None:
        self._readings = readings
        self._last_ns = -1
        self._counts: tuple[int, int, bool] | None = None
        self._trips = 0
        self._latest: list[tuple[float, ...]] = [()] * len(RARE)

    def bind(self, recorder: Sink) -> None:
        """Make views of the recorder's row; the signals of a frame are contiguous in it."""
        at = recorder.slices
        self._recorder = recorder
        self._frame: NDArray[np.float64] = recorder.row[at[FRAME[0]].start : at[FRAME[-1]].stop]
        self._rare = [recorder.row[at[name]] for name in RARE]
        self._tick: NDArray[np.float64] = recorder.row[at[TICK[0]].start : at[TICK[-1]].stop]

    def write(self, time_ns: int, wall_origin_ns: int) -> None:
        """Commit one row per frame, then put the link statistics into the row of this tick."""
        recorder, r = self._recorder, self._readings
        if r.snapshot is not None:
            recorder.estimator(time_ns, r.snapshot)
        if r.frames:
            recorder.row[:] = np.nan
            taken = time_ns * 1e-9
            for frame, state in zip(r.frames, r.states, strict=True):
                # A replay needs every frame that the estimate used: those sampled before time zero
                # are put just after it. Later, a better estimate of the device clock may move a
                # stamp back by microseconds.
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
        # a round trip is recorded once, a count where it changes
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
