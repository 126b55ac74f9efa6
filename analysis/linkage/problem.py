"""The residual of a recording against a simulated gimbal, as `mujoco.sysid` takes it."""

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.prediction import nrmse_fit
from analysis.schema import AnalysisError

Build = Callable[[Mapping[str, float]], mujoco.MjModel]
DELAY = "delay"
_THREADS = 2
HELD_OUT = 3  # every third move


class LinkageError(AnalysisError):
    """A recording or parameter no physics can be fitted with, reported in one line."""


@dataclass(frozen=True, slots=True)
class Knob:
    """One parameter to fit.

    Attributes
    ----------
    name, unit : how reports call it
    start : where the search begins
    low, high : bounds, low < start < high
    """

    name: str
    start: float
    low: float
    high: float
    unit: str

    def __post_init__(self) -> None:
        if not (self.low < self.start < self.high and math.isfinite(self.high - self.low)):
            raise LinkageError(
                f"{self.name}: starts at {self.start:g}, which is not within {self.low:g} to "
                f"{self.high:g}"
            )


@dataclass(frozen=True, slots=True)
class Moves:
    """Commands and readings of a gimbal.

    Attributes
    ----------
    control : actuator commands (steps, nu), one a physics step of the model
    time : of the readings [s] (n,), from 0 where the control begins
    angle : readings [rad] (n, 2), NaN where there is none
    changes : when the command changes [s] (k,): each begins a move
    """

    control: Array
    time: Array
    angle: Array
    changes: Array

    @property
    def move(self) -> NDArray[np.intp]:
        """Number of the move each reading belongs to (n,)."""
        number: NDArray[np.intp] = np.searchsorted(self.changes, self.time, side="right")
        return number

    @property
    def held_out(self) -> NDArray[np.bool_]:
        """Readings of every third move (n,), which the fit does not see."""
        move = self.move
        return np.asarray((move % HELD_OUT == 0) & (move > 0))


class LinkageProblem:
    """The residual as `mujoco.sysid` wants it.

    Parameters are logarithms over their start; those that may be zero are in units of their start.
    """

    def __init__(
        self, moves: Moves, knobs: tuple[Knob, ...], build: Build, joints: tuple[str, ...]
    ) -> None:
        sysid = sysid_module()
        self.moves, self.knobs, self._build, self.joints = moves, knobs, build, joints
        self.scale = np.array([abs(k.start) or k.high - k.low for k in knobs])
        self.positive = np.array([k.low > 0.0 for k in knobs])
        self.start: Array = self._coordinates([k.start for k in knobs])
        low = self._coordinates([k.low for k in knobs])
        high = self._coordinates([k.high for k in knobs])
        self.parameters = sysid.ParameterDict()
        for k, at, least, most in zip(knobs, self.start, low, high, strict=True):
            self.parameters.add(sysid.Parameter(k.name, at, least, most))
        model = build({k.name: k.start for k in knobs if k.name != DELAY})
        self._trajectory = self._measured(model)
        self._address = [self._joint(model, name) for name in joints]
        self.read = np.isfinite(moves.angle)
        self.train = ~moves.held_out

    @staticmethod
    def _joint(model: mujoco.MjModel, name: str) -> int:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) < 0:
            raise LinkageError(f"the model has no joint '{name}'")
        return 1 + int(model.joint(name).qposadr[0])  # the state begins with the time

    def _measured(self, model: mujoco.MjModel) -> Any:  # noqa: ANN401  mujoco.sysid is untyped here
        sysid = sysid_module()
        dt = model.opt.timestep
        u = self.moves.control
        if u.shape[1] != model.nu:
            raise LinkageError(f"{u.shape[1]} commands for a model of {model.nu} actuators")
        times = dt * np.arange(len(u))
        names = [model.actuator(i).name for i in range(model.nu)]
        return sysid.SystemTrajectory(
            model=model,
            control=sysid.TimeSeries.from_control_names(times, u, model, names),
            sensordata=sysid.TimeSeries(times, np.zeros((len(u), model.nsensordata))),
            initial_state=_at_rest(model),
            state=None,
        )

    def _coordinates(self, values: Sequence[float]) -> Array:
        ratio = np.array(values) / self.scale
        return np.where(self.positive, np.log(np.where(self.positive, ratio, 1.0)), ratio)

    def amounts(self, x: Array) -> Array:
        """Parameters (knobs,) in their own units."""
        return np.asarray(self.scale * np.where(self.positive, np.exp(x), x))

    def values(self, x: Array) -> dict[str, float]:
        """Parameters by name, in their own units."""
        return {k.name: float(v) for k, v in zip(self.knobs, self.amounts(x), strict=True)}

    def _model(self, parameters: Any) -> mujoco.MjModel:  # noqa: ANN401
        values = self.values(parameters.as_vector())
        values.pop(DELAY, None)
        return self._build(values)

    def residuals(self, x: Array, parameters: Any) -> tuple[list[Array], Any, Any]:  # noqa: ANN401
        """Readings minus model over the moves fitted (rows,) or (rows, candidates)."""
        left = self.left(x, parameters)[self.train]  # (n, 2, candidates)
        left = left[self.read[self.train]]
        flat = left[:, 0] if x.ndim == 1 else left
        return [flat], None, None

    def left(self, x: Array, parameters: Any = None) -> Array:  # noqa: ANN401
        """Model minus reading (n, 2, candidates), through the sensor's own offset and scale.

        The scale of a potentiometer is known through a filter's estimate only, and 1 % of it looks
        like friction and dead band: each axis' model is laid on its readings by a straight line.
        """
        columns = x.reshape(len(self.knobs), -1)
        parameters = self.parameters.copy() if parameters is None else parameters
        found, _, _ = sysid_module().model_residual(
            columns, parameters, self._model, [self._trajectory],
            modify_residual=self._compare, n_threads=_THREADS, resample_true=False,
        )  # fmt: skip
        shaped = np.asarray(found).reshape(len(self.moves.time), len(self.joints), -1)
        counted = (self.read & self.train[:, None])[:, :, None]
        reading = np.where(self.read, self.moves.angle, 0.0)[:, :, None]
        model = shaped + self.moves.angle[:, :, None]
        total = counted.sum(axis=0)

        def centred(values: Array) -> Array:
            return np.asarray(values - np.sum(values, axis=0, where=counted) / total)

        model, reading = centred(model), centred(reading)
        power = np.sum(model**2, axis=0, where=counted)
        scale = np.sum(model * reading, axis=0, where=counted) / np.maximum(power, 1e-300)
        return np.asarray(scale * model - reading)

    def _compare(
        self,
        parameters: Any,  # noqa: ANN401
        predicted: Any,  # noqa: ANN401, ARG002
        measured: Any,  # noqa: ANN401
        model: mujoco.MjModel,  # noqa: ARG002  the hook's signature
        everything: bool,  # noqa: ARG002
        *,
        state: Array,
    ) -> tuple[Array, Any, Any]:
        late = self.values(parameters.as_vector()).get(DELAY, 0.0)
        t = np.concatenate([[0.0], state[:, 0]])
        columns = []
        for j, at in enumerate(self._address):
            y = np.concatenate([state[:1, at], state[:, at]])
            columns.append(np.interp(self.moves.time - late, t, y) - self.moves.angle[:, j])
        return np.stack(columns, axis=1), measured, measured

    def fits(self, x: Array, rows: NDArray[np.bool_]) -> tuple[float, ...]:
        """NRMSE fit [%] of each axis over some readings."""
        left = self.left(x)[:, :, 0]
        found = []
        for j in range(left.shape[1]):
            good = rows & self.read[:, j]
            y = self.moves.angle[good, j]
            found.append(nrmse_fit(y, y + left[good, j]) if good.sum() > 2 else math.nan)
        return tuple(found)


def sysid_module() -> Any:  # noqa: ANN401
    """`mujoco.sysid`, by name: its types would drag in those of mujoco, which has none.

    Raises
    ------
    LinkageError : it is not installed
    """
    found = importlib.import_module("mujoco.sysid")
    if not hasattr(found, "optimize"):
        raise LinkageError("mujoco.sysid lacks its own needs; install `mujoco[sysid]`")
    return found


def _at_rest(model: mujoco.MjModel) -> Array:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    return state
