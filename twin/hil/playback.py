"""A recording in the gimbal seat: the joints follow what was measured then."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.recording import Recording
from analysis.recording import reader as recordings
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


class Tape:
    """Plays the readings of a recorded run at the pace of the plant.

    Parameters
    ----------
    path : recording of any run with a rig in it
    plant : of a model whose gimbal is `follow`

    Attributes
    ----------
    duration_ns : until the last reading [ns]
    readings : what the latest poll brought

    Raises
    ------
    AnalysisError : no sound recording
    TwinError : a recording without measured angles
    """

    def __init__(self, path: Path, plant: Plant) -> None:
        tape = recordings.read(path)
        if "gimbal/measured" not in tape.series:
            held = ", ".join(tape.series) or "nothing"
            raise TwinError(f"{path} holds no measured angles to mirror; it holds {held}")
        self._plant = plant
        self._times = tape["gimbal/measured"].time_ns
        self._states, self._frames = _states(tape), recorded_frames(tape, self._times)
        self._health = [(round(e.time * 1e9), e.text) for e in tape.health]
        self._command = _series(tape, "gimbal/command", 2)
        self._command_time = tape.series["gimbal/command"].time_ns if self._command.size else None
        self._next, self._begun = 0, False
        self._last = GimbalState(0, (0.0, 0.0), healthy=False)
        self.readings = Readings()
        self.duration_ns = int(self._times[-1]) if len(self._times) else 0

    def send(self, command: GimbalCommand) -> None:
        """Do nothing; what was commanded then is on the tape."""

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Angle commanded then [rad]; the tape sits in the controller's seat too."""
        if self._command_time is None:
            return 0.0, 0.0
        k = int(np.searchsorted(self._command_time, round(time * 1e9), side="right")) - 1
        x, y = self._command[max(k, 0)].tolist()
        return x, y

    def poll(self) -> GimbalState:
        """The readings up to the plant's time."""
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
        self._plant.follow(self._last.angle)
        return self._last


def _series(tape: Recording, name: str, width: int) -> Array:
    """Values (m, width) of a signal, (0, width) where it was not recorded."""
    found = tape.series.get(name)
    return np.empty((0, width)) if found is None else np.asarray(found.values)


def _beside(tape: Recording, name: str, width: int, times: Stamps) -> Array:
    """A signal at some stamps [ns]: the value last before each, else NaN."""
    out = np.full((len(times), width), np.nan)
    found = tape.series.get(name)
    if found is None or found.values.shape[1] != width or not len(found.time):
        return out
    at = np.searchsorted(found.time_ns, times, side="right") - 1
    out[at >= 0] = found.values[at[at >= 0]]
    return out


def _states(tape: Recording) -> list[GimbalState]:
    times = tape["gimbal/measured"].time_ns
    angle = np.asarray(tape["gimbal/measured"].values)
    rate, sigma = (_beside(tape, n, 2, times) for n in ("gimbal/rate/measured", "gimbal/sigma"))
    rows = zip(times.tolist(), angle.tolist(), rate.tolist(), sigma.tolist(), strict=True)
    return [GimbalState(t, _two(a), _two(r), _two(s)) for t, a, r, s in rows]


def recorded_frames(tape: Recording, times: Stamps) -> list[SensorFrame]:
    """The readings of a recorded run at these stamps [ns]; NaN what was not recorded."""
    columns = [_beside(tape, name, width, times).tolist() for name, width in WIDTHS.items()]
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
