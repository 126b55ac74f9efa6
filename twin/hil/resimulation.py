"""The model beside a rig once more, from the recorded commands, with other parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from analysis.recording import Recording
from hardware.frames import AXES
from twin.config.recorded import typed
from twin.errors import TwinError
from twin.hil.shadow import FIRST_NS, FRAME_NS, WIRE_NS, frame_after, rested, steps_of
from twin.plant.model.model import ModelConfig, load
from twin.plant.model.overrides import value
from twin.plant.plant import Plant

Array = NDArray[np.float64]
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
THREADS = 2
LONGEST_S = 3600.0
NEEDED = ("gimbal/command", "gimbal/measured", "gimbal/simulated", "sensors/device_time",
          "sensors/taken")  # fmt: skip


@dataclass(frozen=True)
class Variant:
    """One way to simulate the run again.

    Attributes
    ----------
    parameters : named parameters of the mechanism beside those of the recorded model
    shaft : added to the commanded shaft angles x, y [rad]
    late : added to the instant of every command [s]
    at_once : whether commands act at their stamps, without the wait for a pulse frame
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    shaft: float = 0.0
    late: float = 0.0
    at_once: bool = False


class Resimulation:
    """Servos, rods and gimbal under the commands of a recorded run; needs `compiled()`.

    Parameters
    ----------
    recording : of a run with a rig and the linkage beside it
    mechanism : MJCF file in place of the reference mechanism
    parameters : of the mechanism, in place of those of the recorded model
    longest : of the run, from its first command on [s]

    Attributes
    ----------
    time : of the motions: the beginnings of the ticks (n,) [s]

    Raises
    ------
    TwinError : a recording that lacks what this needs
    """

    def __init__(
        self,
        recording: Recording,
        mechanism: Path | None = None,
        parameters: Mapping[str, float] | None = None,
        longest: float = LONGEST_S,
    ) -> None:
        self._parameters = {**_recorded_parameters(recording, mechanism), **(parameters or {})}
        self._mechanism = mechanism
        command = recording["gimbal/command"]
        if len(command.time) < 2 or command.time[-1] - command.time[0] > LONGEST_S:
            raise TwinError(f"the recording has {len(command.time)} commands, or more than an hour")
        command = command.rows(command.time <= command.time[0] + longest)
        self._ticks = np.asarray(command.time_ns)
        self._tick_ns = int(np.median(np.diff(self._ticks)))
        self._steps = steps_of(self._tick_ns)
        self._dt_ns = self._tick_ns // self._steps
        self.time = np.asarray(command.time)
        self._angles = np.asarray(command.values)
        self._frames = _Frames(recording)
        self._in_force = self._latches()
        self._shafts: Array | None = None

    def motions(self, variants: Sequence[Variant]) -> Array:
        """Gimbal angles (variants, n, 2) at `time`; simulated side by side on threads [rad]."""
        plants = [self._plant(v) for v in variants]
        controls = np.array([self._controls(p, v) for p, v in zip(plants, variants, strict=True)])
        model = plants[0].model
        begin = np.empty((len(plants), mujoco.mj_stateSize(model, STATE)))
        for row, plant in zip(begin, plants, strict=True):
            mujoco.mj_getState(plant.model, plant.data, row, STATE)
        states, _ = rollout.rollout(
            [p.model for p in plants],
            [mujoco.MjData(model) for _ in range(min(THREADS, len(plants)))],
            begin,
            controls,
        )
        places = [1 + int(model.joint(f"gimbal_{a}").qposadr[0]) for a in AXES]
        angles = np.concatenate([begin[:, None, places], states[:, :, places]], axis=1)
        at = (self._ticks - self._ticks[0]) // self._dt_ns
        return np.asarray(angles[:, np.minimum(at, angles.shape[1] - 1)])

    def value(self, name: str) -> float:
        """Value of a parameter of the model.

        Raises
        ------
        TwinError : it has none of that name
        """
        return value(self._plant(Variant()).model, name)

    def _plant(self, variant: Variant) -> Plant:
        overrides = {**self._parameters, **variant.parameters}
        config = ModelConfig(
            scene="bench", mechanism=self._mechanism, overrides=overrides, dt=self._dt_ns * 1e-9
        )
        return rested(Plant(load(config)))

    def _controls(self, plant: Plant, variant: Variant) -> Array:
        """Commanded shaft angles of every step (m, 2)."""
        count = int((self._ticks[-1] - self._ticks[0]) // self._dt_ns)
        steps, rows = self._at_once() if variant.at_once else self._in_force
        late = round(variant.late * 1e9 / self._dt_ns)
        out = np.empty((count, plant.model.nu))
        begin = np.array(plant.data.ctrl)
        shafts = self._commanded(plant)[rows]
        edges = np.clip(np.append(steps + late, count), 0, count)
        out[: edges[0]] = begin
        out[edges[0] :] = np.repeat(shafts, np.diff(edges), axis=0)
        return out + variant.shaft

    def _commanded(self, plant: Plant) -> Array:
        """Shaft angles of every commanded gimbal angle; the same for all parameters of servos."""
        if self._shafts is None:
            known: dict[tuple[float, ...], Array] = {}
            rest = np.array(plant.data.ctrl)
            for angle in map(tuple, self._angles.tolist()):
                if angle not in known:
                    plant.drive((angle[0], angle[1]))
                    known[angle] = np.array(plant.data.ctrl)
            plant.data.ctrl[:] = rest
            self._shafts = np.array([known[a] for a in map(tuple, self._angles.tolist())])
        return self._shafts

    def _at_once(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows = np.arange(len(self._ticks))
        return (self._ticks - self._ticks[0]) // self._dt_ns, rows

    def _latches(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Steps at which commands come into force, as in `Shadow`, and their rows."""
        arrived = self._ticks + WIRE_NS
        found: list[tuple[int, int]] = []
        latched, newest = -FRAME_NS, -1
        for begin, clock in zip(self._ticks.tolist(), self._frames.at(self._ticks), strict=True):
            end = begin + self._tick_ns
            while clock is not None and (frame := frame_after(begin, latched, clock)) < end:
                latched = frame
                row = int(np.searchsorted(arrived, frame, side="right")) - 1
                if row > newest:
                    newest = row
                    ahead = min(max(round((frame - begin) / self._dt_ns), 0), self._steps)
                    found.append(((begin - int(self._ticks[0])) // self._dt_ns + ahead, row))
        steps, rows = np.array(found, np.int64).reshape(-1, 2).T
        return steps, rows


class _Frames:
    """The device's clock at the ticks of a recorded run."""

    def __init__(self, recording: Recording) -> None:
        device, taken = recording["sensors/device_time"], recording["sensors/taken"]
        self._stamps = np.asarray(device.time_ns)
        self._device = np.rint(device.values[:, 0] * 1e9).astype(np.int64)
        self._taken = np.rint(taken.values[:, 0] * 1e9).astype(np.int64)
        if len(self._taken) != len(self._stamps):
            raise TwinError("the recording's sensor signals have different lengths")

    def at(self, ticks: NDArray[np.int64]) -> list[tuple[int, int] | None]:
        """Stamp and device time of the newest frame that each tick had taken [ns]."""
        rows = np.searchsorted(self._taken, ticks, side="right") - 1
        known = self._stamps[rows] >= FIRST_NS
        return [
            (int(self._stamps[k]), int(self._device[k])) if k >= 0 and there else None
            for k, there in zip(rows, known, strict=True)
        ]


def _recorded_parameters(recording: Recording, mechanism: Path | None) -> dict[str, float]:
    """Parameters of the linkage beside the rig of a run."""
    missing = [n for n in NEEDED if n not in recording.series]
    shadow = recording.properties.get("shadow")
    if missing or not isinstance(shadow, dict) or shadow.get("gimbal") != "linkage":
        lacks = f"no {missing[0]}" if missing else "no linkage beside a rig"
        raise TwinError(f"the recording has {lacks}; record it with a rig and --shadow linkage")
    if recording.setting("mechanism") is not None and mechanism is None:
        raise TwinError("the run had a mechanism of its own; give its file as --mechanism FILE")
    given = shadow.get("set")
    given = given if isinstance(given, dict) else {}
    return {str(k): typed(f"shadow.set.{k}", v, float) for k, v in given.items()}
