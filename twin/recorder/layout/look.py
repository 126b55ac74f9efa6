"""How a recording looks in the viewer: its layout, and what is written for the viewer only."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from twin.plant.authority import command_limit
from twin.recorder import columns, lifetime, style
from twin.recorder.layout import blueprint, profile
from twin.recorder.layout.display import Display
from twin.recorder.layout.states import HEALTH, States
from twin.recorder.scene.poses import Poses, gimballed

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

POSITION = "vehicle/position"


class Look:
    """Writes styles, states, residual, bands, events and blueprints of a recording.

    Parameters
    ----------
    signals : that are recorded
    poses : of the 3D scene, None without one
    model : of the scene
    live : whether a viewer is open, which keeps its first layout

    Attributes
    ----------
    content : what the recording may hold; after `drain` see `final`
    """

    def __init__(
        self,
        signals: Sequence[str],
        poses: Poses | None,
        model: mujoco.MjModel | None,
        *,
        live: bool,
    ) -> None:
        self._signals = signals
        plotted = _plotted(signals, model)
        steered = model is not None and "gimbal/command" in plotted
        self._states = States(signals, command_limit(model) if steered else None)
        self._display = Display(signals, poses.ghost.stops if poses else ())
        self._profile = profile.Profile() if POSITION in signals else None
        self.content = blueprint.Content(
            signals=plotted,
            poses=poses,
            residual=self._display.residual,
            lanes=self._states.any,
            profile=profile.view() if self._profile else None,
            live=live,
        )

    def start(self, stream: rr.RecordingStream) -> None:
        """Write what does not change."""
        for name in self._signals:
            entity = schema.SIGNALS[name].entity
            stream.log(entity, style.lines(name).archetype(), static=True)
        for part in (self._states, self._display, self._profile):
            if part is not None:
                part.start(stream)

    def text(
        self, stream: rr.RecordingStream, when: list[rr.TimeColumn], line: tuple[str, int, str, str]
    ) -> None:
        """Take a text: entity, time [ns], text, level."""
        entity, time_ns, text, level = line
        if entity == schema.HEALTH:
            stream.send_columns(HEALTH, when, columns.states([text]))
        elif entity == schema.EVENTS:
            self._display.text(time_ns, text, level)

    def drain(
        self,
        stream: rr.RecordingStream,
        later: columns.Columns,
        time: Stamps,
        wall: Stamps,
        rows: Mapping[str, Floats],
    ) -> None:
        """Take rows (n, k) of signals by name, in SI; `later` gets what has many rows."""
        self._display.send_events(stream)
        if not time.size:
            return
        self._states.drain(stream, time, wall, rows)
        if self._profile is not None:
            self._profile.drain(later, time, wall, rows[POSITION])
        stored = {name: schema.SIGNALS[name].to_stored(values) for name, values in rows.items()}
        self._display.drain(later, time, wall, stored)

    def finish(self, stream: rr.RecordingStream) -> None:
        """Write the blueprint of what was really recorded."""
        final = self.final(stream)
        if not self.content.live:
            lifetime.show(stream, blueprint.build(final))

    def final(self, stream: rr.RecordingStream) -> blueprint.Content:
        """Write what needs the whole run; returns what has been recorded."""
        known = self._display.finish(stream)
        residual = self._display.residual
        return replace(
            self.content,
            signals=[s for s in self.content.signals if schema.SIGNALS[s].entity in known.ranges],
            residual=residual if residual in known.ranges else None,
            known=known,
            profile=self._profile.finish(stream) if self._profile else None,
        )


def _plotted(signals: Sequence[str], model: mujoco.MjModel | None) -> list[str]:
    """Signals without those of the gimbal, which stay zero, where the motor is fixed."""
    if model is None or gimballed(model):
        return list(signals)
    return [s for s in signals if not s.startswith("gimbal/") and s != "control/error"]
