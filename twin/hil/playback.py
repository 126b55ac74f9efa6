"""A recording in the gimbal seat: the joints follow the recorded measurements."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Recording, reader
from hardware.events import HealthChanged
from hardware.frames import GimbalCommand, GimbalState, Pair, SensorFrame
from twin.errors import TwinError
from twin.loop.readings import Readings
from twin.plant.plant import Plant

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
WIDTHS = {
    "sensors/potentiometer": 4,
    "sensors/gyro": 3,
    "sensors/accelerometer": 3,
    "sensors/base_gyro": 3,
    "sensors/base_accelerometer": 3,
    "sensors/pulse": 3,
    "sensors/switches": 4,
    "sensors/joystick": 2,
    "sensors/device_time": 1,
    "sensors/flags": 1,
}


class Playback:
    """Gives the readings of a recorded run at the plant's time, in gimbal and controller seat.

    Parameters
    ----------
    path : recording of a run with a rig
    plant : of a model whose gimbal is `follow`

    Attributes
    ----------
    duration_ns : until the last reading [ns]
    readings : of the latest poll

    Raises
    ------
    AnalysisError : not a valid recording
    TwinError : a recording without measured angles
    """

    def __init__(self, path: Path, plant: Plant) -> None:
        recording = reader.read(path)
        if "gimbal/measured" not in recording.series:
            names = ", ".join(recording.series) or "nothing"
            raise TwinError(f"{path}: has no measured angles to mirror; it has {names}")
        self._plant = plant
        self._times = recording["gimbal/measured"].time_ns
        self._states, self._frames = _states(recording), recorded_frames(recording, self._times)
        self._health = [(round(e.time * 1e9), e.text) for e in recording.health]
        self._command = _series(recording, "gimbal/command", 2)
        self._command_time = (
            recording.series["gimbal/command"].time_ns if self._command.size else None
        )
        self._next, self._begun = 0, False
        self._last = GimbalState(0, (0.0, 0.0), healthy=False)
        self.readings = Readings()
        self.duration_ns = int(self._times[-1]) if len(self._times) else 0

    def send(self, command: GimbalCommand) -> None:
        """Do nothing: commands are recorded ones."""

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the recorded command at `time` [rad]."""
        if self._command_time is None:
            return 0.0, 0.0
        k = int(np.searchsorted(self._command_time, round(time * 1e9), side="right")) - 1
        x, y = self._command[max(k, 0)].tolist()
        return x, y

    def poll(self) -> GimbalState:
        """Take the readings up to the plant's time."""
        now = self._plant.time_ns
        end = int(np.searchsorted(self._times, now, side="right"))
        r = self.readings
        r.states, r.frames = self._states[self._next : end], self._frames[self._next : end]
        self._next = max(end, self._next)
        if r.states:
            self._last = r.states[-1]
        r.age_ns = now - self._last.time_ns if r.states else None
        before, r.events = r.health if self._begun else "", []
        self._begun = True
        while self._health and self._health[0][0] <= now:
            r.health = self._health.pop(0)[1]
        if r.health != before:
            r.events.append(HealthChanged(r.health))
        if r.states:
            u, v = (rate if math.isfinite(rate) else 0.0 for rate in self._last.rate)
            self._plant.follow(self._last.angle, (u, v))
        return self._last


def _series(recording: Recording, name: str, width: int) -> Array:
    """Values (m, width) of a signal, (0, width) where it was not recorded."""
    series = recording.series.get(name)
    return np.empty((0, width)) if series is None else np.asarray(series.values)


def _beside(recording: Recording, name: str, width: int, times: Stamps) -> Array:
    """A signal at time stamps [ns]: the last value before each, NaN without one."""
    out = np.full((len(times), width), np.nan)
    series = recording.series.get(name)
    if series is None or series.values.shape[1] != width or not len(series.time):
        return out
    at = np.searchsorted(series.time_ns, times, side="right") - 1
    out[at >= 0] = series.values[at[at >= 0]]
    return out


def _states(recording: Recording) -> list[GimbalState]:
    times = recording["gimbal/measured"].time_ns
    angle = np.asarray(recording["gimbal/measured"].values)
    rate, sigma = (
        _beside(recording, n, 2, times) for n in ("gimbal/rate/measured", "gimbal/sigma")
    )
    rows = zip(times.tolist(), angle.tolist(), rate.tolist(), sigma.tolist(), strict=True)
    return [GimbalState(t, _two(a), _two(r), _two(s)) for t, a, r, s in rows]


def recorded_frames(recording: Recording, times: Stamps) -> list[SensorFrame]:
    """Frames of a recorded run at time stamps [ns]; NaN where something was not recorded."""
    columns = [_beside(recording, name, width, times).tolist() for name, width in WIDTHS.items()]
    frames = []
    for time, pot, g, a, bg, ba, pulse, sw, joy, dev, flags in zip(
        times.tolist(), *columns, strict=True
    ):
        frames.append(
            SensorFrame(
                time_ns=time,
                device_us=round(np.nan_to_num(dev[0]) * 1e6),
                potentiometer=(pot[0], pot[1], pot[2], pot[3]),
                gyro=(g[0], g[1], g[2]),
                accelerometer=(a[0], a[1], a[2]),
                base_gyro=(bg[0], bg[1], bg[2]),
                base_accelerometer=(ba[0], ba[1], ba[2]),
                pulse=(pulse[0], pulse[1], pulse[2]),
                switches=(sw[0] > 0, sw[1] > 0, sw[2] > 0, sw[3] > 0),
                joystick=(joy[0], joy[1]),
                flags=int(np.nan_to_num(flags[0])),
            )
        )
    return frames


def _two(values: list[float]) -> Pair:
    return values[0], values[1]
