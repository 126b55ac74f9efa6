"""States of a run over time: health, link and mode of a rig, phase of a flight, saturation."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from hardware.protocol.messages import Flags
from twin.recorder import columns

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Codes = NDArray[np.intp]

STATES = "/state"
HEALTH = f"{STATES}/health"
GOOD, WARN, BAD, IDLE = (60, 150, 90), (210, 150, 40), (200, 60, 60), (90, 95, 105)
MODES = ("disarmed", "armed", "driving", "timed out")
LINKS = ("lost", "connected")
PHASES = ("before ignition", "thrust", "coast", "descent")
LIMITS = ("", "x at its limit", "y at its limit", "x and y at their limits")
_COLORS: Mapping[str, Sequence[tuple[str, tuple[int, int, int]]]] = {
    "health": (("ok", GOOD),),
    "mode": tuple(zip(MODES, (IDLE, WARN, GOOD, BAD), strict=True)),
    "link": (("lost", BAD), ("connected", GOOD)),
    "flight": tuple(zip(PHASES, (IDLE, (200, 120, 40), (60, 120, 190), IDLE), strict=True)),
    "saturation": tuple((text, BAD) for text in LIMITS[1:]),
}


class States:
    """Turns rows of signals into changes of state.

    Parameters
    ----------
    signals : that are recorded
    limit : of the commanded angle [rad]; None where nothing limits it
    """

    def __init__(self, signals: Sequence[str], limit: float | None) -> None:
        recorded = set(signals)
        self._limit = limit
        self._latest: dict[str, int] = {}
        self._ignited = False
        lanes: dict[str, tuple[tuple[str, ...], tuple[str, ...], Callable[..., Codes]]] = {
            "link": (("link/connected",), LINKS, _connected),
            "mode": (("sensors/flags",), MODES, _mode),
            "flight": (("vehicle/thrust", "vehicle/velocity"), PHASES, self._phase),
            "saturation": (("gimbal/command", "vehicle/thrust"), LIMITS, self._limited),
        }
        self._lanes = {k: v for k, v in lanes.items() if recorded.issuperset(v[0])}
        if limit is None:
            self._lanes.pop("saturation", None)
        self.any = bool(self._lanes)

    def start(self, stream: rr.RecordingStream) -> None:
        """Write the colours."""
        for lane in ("health", *self._lanes):
            values, colors = zip(*_COLORS[lane], strict=True)
            look = rr.StateConfiguration(values=values, colors=colors)
            stream.log(f"{STATES}/{lane}", look, static=True)

    def drain(
        self, stream: rr.RecordingStream, time: Stamps, wall: Stamps, rows: Mapping[str, Floats]
    ) -> None:
        """Write what changes within rows (n, k) of signals by name, in SI."""
        for lane, (needed, texts, judge) in self._lanes.items():
            values = [rows[name] for name in needed]
            there = np.isfinite(np.hstack(values)).all(axis=1)
            if not there.any():
                continue
            codes = judge(*(v[there] for v in values))
            before = self._latest.get(lane, -1)
            changed = np.flatnonzero(np.diff(codes, prepend=before))
            self._latest[lane] = int(codes[-1])
            if changed.size:
                stamps = columns.times(time[there][changed], wall[there][changed])
                names = [texts[k] for k in codes[changed]]
                stream.send_columns(f"{STATES}/{lane}", stamps, columns.states(names))

    def _phase(self, thrust: Floats, velocity: Floats) -> Codes:
        burning = thrust[:, 0] > 0.0
        lit = np.logical_or.accumulate(burning) | self._ignited
        self._ignited = bool(lit[-1])
        after = np.where(velocity[:, 2] > 0.0, 2, 3)
        return np.where(burning, 1, np.where(lit, after, 0))

    def _limited(self, command: Floats, thrust: Floats) -> Codes:
        assert self._limit is not None
        at = (np.abs(command) > self._limit * (1.0 - 1e-6)) & (thrust > 0.0)
        return np.asarray(at[:, 0] + 2 * at[:, 1], np.intp)


def _connected(values: Floats) -> Codes:
    return np.asarray(values[:, 0] > 0.0, np.intp)


def _mode(values: Floats) -> Codes:
    flags = values[:, 0].astype(np.int64)
    mode = np.where(flags & Flags.ARMED, 1, 0)
    mode = np.where(flags & Flags.DRIVING, 2, mode)
    return np.where(flags & Flags.TIMED_OUT, 3, mode)
