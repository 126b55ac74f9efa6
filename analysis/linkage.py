"""Physical parameters of a simulated gimbal, fitted to a recording with `mujoco.sysid`.

The model is injected: whoever calls says how a set of parameters becomes a compiled model. Every
trial flies the recording's own commands from rest, and its angles are compared where the gimbal was
read; a sensor's offset and a transport delay are no property of the model and are fitted beside it.
"""

import importlib
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.identify.model import Estimate
from analysis.identify.prediction import nrmse_fit
from analysis.identify.uncertainty import bootstrap
from analysis.schema import AnalysisError

Array = NDArray[np.float64]
Build = Callable[[Mapping[str, float]], mujoco.MjModel]

DELAY = "delay"
# Of a parameter's scale. Stick, play and dead band make the loss rough and full of small minima:
# the search begins at the best of many places, with slopes taken wide enough to see past them, and
# looks around once more between its stages.
_DIFFERENCES = (0.07, 0.02)
_DIFFERENCE = 5e-3
_PLACES = 64
_WIDE = 20.0  # deviations; of the places looked at between the stages
_WIDTH = 0.35  # standard deviation of their logarithms; servos of one kind differ by half
_THREADS = 2
_SPREAD = 1.5  # bootstrap over Jacobian: beyond, the Jacobian is wrong
_VAGUE = 0.5  # deviation over value: beyond, the recording does not tell the parameter
_POOR = 80.0  # percent of fit
_HELD_OUT = 3  # every third move
_LONGEST_DELAY = 0.06  # s


class LinkageError(AnalysisError):
    """A recording or parameter no physics can be fitted with, told in one line."""


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
    """What a gimbal was told and what was read of it.

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
        return np.asarray((move % _HELD_OUT == 0) & (move > 0))


@dataclass(frozen=True, slots=True)
class LinkageFit:
    """Fitted parameters and how far to trust them.

    Attributes
    ----------
    estimates : one per knob
    fit, held_out : NRMSE fit [%] per axis, of the moves fitted and of those held out
    start : the same of all moves before anything was fitted
    spread : bootstrap over moves over the Jacobian's deviation, median; NaN if unknown
    warnings : everything a reader must know before using a value
    """

    estimates: tuple[Estimate, ...]
    fit: tuple[float, ...]
    held_out: tuple[float, ...]
    start: tuple[float, ...]
    spread: float
    warnings: tuple[str, ...]

    def value(self, name: str) -> float:
        """One fitted value by name."""
        return next(e.value for e in self.estimates if e.name == name)


def fit_linkage(
    moves: Moves,
    knobs: Sequence[Knob],
    build: Build,
    joints: Sequence[str] = ("gimbal_x", "gimbal_y"),
    *,
    most: int = 8,
) -> LinkageFit:
    """Fit physical parameters to a recording.

    Parameters
    ----------
    moves : commands and readings
    knobs : parameters; one called `delay` shifts the answer instead of changing the model
    build : a compiled model with the given values; called on one thread, models may share nothing
    joints : whose angles were read
    most : iterations of each stage of the search

    Raises
    ------
    LinkageError
        for no parameters, too few moves, or a model without such joints.
    """
    if not knobs:
        raise LinkageError("no parameter to fit")
    if len(moves.changes) < _HELD_OUT:
        raise LinkageError(
            f"{len(moves.changes)} moves; {_HELD_OUT} or more are needed, one is held out"
        )
    problem = _Problem(moves, tuple(knobs), build, tuple(joints))
    start = problem.start
    before = problem.fits(start, np.ones(len(moves.time), dtype=bool))
    x = problem.best(start[:, None] * np.exp(_WIDTH * problem.draws))
    ends = []
    for difference in _DIFFERENCES:
        x, jacobian = problem.descended(x, difference, most)
        ends.append(x)
        x = problem.best(x[:, None] + problem.along(jacobian, x))
    x, _ = problem.descended(x, _DIFFERENCE, most)
    estimates, spread = _estimates(problem, x, x - ends[-1])
    train = ~moves.held_out
    fits = problem.fits(x, train), problem.fits(x, ~train)
    notes = _warnings(problem, x, estimates, fits[1], spread)
    return LinkageFit(estimates, *fits, before, spread, notes)


class _Problem:
    """The residual as `mujoco.sysid` wants it; parameters are in units of their scale."""

    def __init__(
        self, moves: Moves, knobs: tuple[Knob, ...], build: Build, joints: tuple[str, ...]
    ) -> None:
        sysid = _sysid()
        self.moves, self.knobs, self._build, self.joints = moves, knobs, build, joints
        self.scale = np.array([abs(k.start) or k.high - k.low for k in knobs])
        self.start: Array = np.array([k.start for k in knobs]) / self.scale
        self.parameters = sysid.ParameterDict()
        for k, scale in zip(knobs, self.scale, strict=True):
            self.parameters.add(
                sysid.Parameter(k.name, k.start / scale, k.low / scale, k.high / scale)
            )
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
        sysid = _sysid()
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

    def values(self, x: Array) -> dict[str, float]:
        """Parameters by name, in their own units."""
        return {k.name: float(v) for k, v in zip(self.knobs, x * self.scale, strict=True)}

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
        """Model minus reading (n, 2, candidates), the sensors' offsets taken out."""
        columns = x.reshape(len(self.knobs), -1)
        parameters = self.parameters.copy() if parameters is None else parameters
        found, _, _ = _sysid().model_residual(
            columns, parameters, self._model, [self._trajectory],
            modify_residual=self._compare, n_threads=_THREADS, resample_true=False,
        )  # fmt: skip
        shaped = np.asarray(found).reshape(len(self.moves.time), len(self.joints), -1)
        seen = np.where((self.read & self.train[:, None])[:, :, None], shaped, np.nan)
        return np.asarray(shaped - np.nanmean(seen, axis=0))

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

    @property
    def draws(self) -> Array:
        """Evenly spread normal draws (knobs, places); the first is zero."""
        from scipy.stats import qmc

        found = qmc.MultivariateNormalQMC(np.zeros(len(self.knobs)), seed=0).random(_PLACES).T
        found[:, 0] = 0.0
        return np.asarray(found)

    def best(self, places: Array) -> Array:
        """The best of several places (knobs, places)."""
        low, high = (b[:, None] for b in self.parameters.get_bounds())
        tried = np.clip(places, low, high)
        left = self.residuals(tried, self.parameters.copy())[0][0]
        return np.asarray(tried[:, int(np.argmin(np.sum(left**2, axis=0)))])

    def along(self, jacobian: Array, x: Array) -> Array:
        """Draws around x as the fit would scatter, but wide (knobs, places)."""
        left = self.residuals(x, self.parameters.copy())[0][0]
        covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * np.var(left)
        value, vector = np.linalg.eigh(covariance)
        return np.asarray(_WIDE * (vector * np.sqrt(np.clip(value, 0.0, None))) @ self.draws)

    def descended(self, x: Array, difference: float, most: int) -> tuple[Array, Array]:
        """Where `mujoco.sysid` gets from x, and the slope there."""
        self.parameters.update_from_vector(x)
        _, found = _sysid().optimize(
            self.parameters,
            self.residuals,
            optimizer="mujoco",
            verbose=False,
            output=io.StringIO(),  # of the search's own log, which nothing else silences
            eps=difference,
            xtol=1e-4,
            max_iters=most,
            x_scale="jac",
        )
        return np.asarray(found.x, dtype=np.float64).ravel(), np.asarray(found.jac)

    def fits(self, x: Array, rows: NDArray[np.bool_]) -> tuple[float, ...]:
        """NRMSE fit [%] of each axis over some readings."""
        left = self.left(x)[:, :, 0]
        found = []
        for j in range(left.shape[1]):
            good = rows & self.read[:, j]
            y = self.moves.angle[good, j]
            found.append(nrmse_fit(y, y + left[good, j]) if good.sum() > 2 else math.nan)
        return tuple(found)


def _sysid() -> Any:  # noqa: ANN401
    """`mujoco.sysid`, by name: its types would drag in those of mujoco, which has none.

    Raises
    ------
    LinkageError
        if it is not installed.
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


def _estimates(problem: _Problem, x: Array, last: Array) -> tuple[tuple[Estimate, ...], float]:
    """Values with deviations: from the Jacobian or, where moves disagree more, the bootstrap.

    A rough loss leaves the search somewhere near the minimum: how far it moved at `last` is added.
    """
    low, high = problem.parameters.get_bounds()
    step = _DIFFERENCE * np.maximum(1.0, np.abs(x))
    ahead, behind = np.minimum(x + step, high), np.maximum(x - step, low)
    candidates = np.hstack([x[:, None] + np.diag(ahead - x), x[:, None] + np.diag(behind - x)])
    both = problem.residuals(candidates, problem.parameters.copy())[0][0]
    n = len(x)
    jacobian = (both[:, :n] - both[:, n:]) / (ahead - behind)
    residual = problem.residuals(x, problem.parameters.copy())[0][0]
    covariance, _ = _sysid().calculate_intervals([residual], jacobian)
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    moves = np.repeat(problem.moves.move[:, None], len(problem.joints), axis=1)
    drawn = bootstrap(jacobian, residual, moves[problem.train][problem.read[problem.train]])
    spread = math.nan
    if drawn is not None:
        other = np.sqrt(np.clip(np.diag(np.atleast_2d(drawn)), 0.0, None))
        spread = float(np.median(other / np.maximum(std, 1e-300)))
        std = np.where(other > _SPREAD * std, other, std)
    std = np.hypot(std, last)
    return tuple(
        Estimate(k.name, float(v), float(s), k.unit)
        for k, v, s in zip(problem.knobs, x * problem.scale, std * problem.scale, strict=True)
    ), spread


def _warnings(
    problem: _Problem,
    x: Array,
    estimates: Sequence[Estimate],
    held_out: Sequence[float],
    spread: float,
) -> tuple[str, ...]:
    found = []
    for k, v, e in zip(problem.knobs, x * problem.scale, estimates, strict=True):
        if min(v - k.low, k.high - v) < 1e-3 * (k.high - k.low):
            found.append(f"{k.name}: ended at its bound, {v:.4g}; the recording asks for more")
        elif not e.std <= _VAGUE * abs(e.value) and k.name != DELAY:
            found.append(f"{k.name}: the recording hardly tells it; take the value as a guess")
    for name, value in zip(problem.joints, held_out, strict=True):
        if not value >= _POOR:
            found.append(f"{name}: poor fit of {value:.0f} % on moves held out")
    if spread > _SPREAD:
        found.append(
            f"moves disagree {spread:.1f} times more than their noise; intervals are from the"
            " bootstrap"
        )
    return tuple(found)
