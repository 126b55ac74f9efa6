"""Adams–Bashforth methods of order 1 to 4, which never evaluate a future state.

A step evaluates the derivative once, at the present instant, and reuses past values, so the
simulation does not run ahead of a clock or a rig.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.errors import TwinError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

# The first step is divided into increasing parts, the shortest 2⁻ᵏ of it, so that the error of the
# low orders at the start is negligible: an Euler step of 2⁻¹⁴·dt errs 4e-9 as much as one of dt.
_STARTUP: Final = {1: 0, 2: 0, 3: 14, 4: 14}

_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
# Activations with a smooth state; the rates of others are updates over one step.
_SMOOTH_ACTIVATIONS: Final = (
    mujoco.mjtDyn.mjDYN_INTEGRATOR,
    mujoco.mjtDyn.mjDYN_FILTER,
    mujoco.mjtDyn.mjDYN_MUSCLE,
)


@njit(nogil=True)
def coefficients(ages: Array, dt: float, out: Array) -> None:
    """Weights (s,) of s past derivatives for a step of `dt`, for any spacing.

    The integral of the Lagrange polynomial through the derivatives at `ages` (s,) before now,
    ages[0] = 0 [s]: two-point Gauss quadrature, which is exact up to the cubic of order 4
    (E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, §III.5).
    """
    half = 0.5 / np.sqrt(3.0)
    for i in range(len(out)):
        first, second = 1.0, 1.0
        for j in range(len(out)):
            if j != i:
                first *= ((0.5 + half) * dt + ages[j]) / (ages[j] - ages[i])
                second *= ((0.5 - half) * dt + ages[j]) / (ages[j] - ages[i])
        out[i] = 0.5 * dt * (first + second)


@njit(nogil=True)
def _position_rate(qpos: Array, qvel: Array, joints: Integers, out: Array) -> None:
    """dqpos/dt (nq,), quaternions in their four components: q̇ = ½ q ⊗ ω, ω in the body frame."""
    for kind, q, v in joints:
        if kind == _FREE:
            out[q], out[q + 1], out[q + 2] = qvel[v], qvel[v + 1], qvel[v + 2]
            q, v = q + 3, v + 3
        elif kind != _BALL:
            out[q] = qvel[v]
            continue
        w, x, y, z = qpos[q], qpos[q + 1], qpos[q + 2], qpos[q + 3]
        a, b, c = 0.5 * qvel[v], 0.5 * qvel[v + 1], 0.5 * qvel[v + 2]
        out[q] = -x * a - y * b - z * c
        out[q + 1] = w * a + y * c - z * b
        out[q + 2] = w * b + z * a - x * c
        out[q + 3] = w * c + x * b - y * a


@njit(nogil=True)
def _normalise(qpos: Array, joints: Integers) -> None:
    for kind, q, _ in joints:
        start = q + 3 if kind == _FREE else q
        if kind in (_FREE, _BALL):
            part = qpos[start : start + 4]
            part /= np.sqrt(part @ part)


@njit(nogil=True)
def _advance(
    qpos: Array, qvel: Array, act: Array, qacc: Array, act_dot: Array,
    joints: Integers, smooth: NDArray[np.bool_], history: Array, ages: Array,
    known: int, dt: float, variable: bool,
) -> None:  # fmt: skip
    """One step of order `known` + 1 at most; `history` (s, nq+nv+na), newest first."""
    order = min(known + 1, len(ages))
    nq, nv = len(qpos), len(qvel)
    for k in range(len(ages) - 1, 0, -1):
        history[k] = history[k - 1]
    now = history[0]
    _position_rate(qpos, qvel, joints, now[:nq])
    now[nq : nq + nv] = qacc
    now[nq + nv :] = act_dot
    weights = np.empty(order)
    # fixed coefficients assume past steps as long as the next one
    past = ages[:order].copy()
    if not variable:
        for k in range(order):
            past[k] = k * dt
    coefficients(past, dt, weights)
    for k in range(order):
        qpos += weights[k] * history[k, :nq]
        qvel += weights[k] * history[k, nq : nq + nv]
        for a in range(len(act)):
            if smooth[a]:
                act[a] += weights[k] * history[k, nq + nv + a]
    _normalise(qpos, joints)
    for k in range(len(ages) - 1, 0, -1):
        ages[k] = ages[k - 1] + dt
    ages[0] = 0.0


class AdamsBashforth:
    """Adams–Bashforth of order 1 to 4 with one `mj_forward` per step.

    Quaternions are integrated in their four components and normalised, which keeps the order. The
    model's integrator is set to `MULTISTEP`, by which compiled callbacks recognise the method. The
    history restarts when `data.time` was changed from outside; call `fresh` after a jump in the
    forces.

    Parameters
    ----------
    order : 1 to 4
    variable : coefficients for the actual spacing of the steps; False takes those of equal steps
    """

    def __init__(self, order: int, variable: bool = True) -> None:
        if order not in _STARTUP:
            raise TwinError(f"Adams–Bashforth of order {order}: must be 1 to 4")
        self.order, self.variable = order, variable
        self._owner: tuple[object, object] | None = None
        self._known, self._time = 0, np.nan

    def fresh(self) -> "AdamsBashforth":
        """Return the same method without history."""
        return AdamsBashforth(self.order, self.variable)

    def restart(self) -> None:
        """Discard the history; the next step is a first step."""
        self._known = 0

    def step(
        self, model: mujoco.MjModel, data: mujoco.MjData, n: int = 1, dt: float | None = None
    ) -> None:
        """Take `n` steps of `dt` [s], the model's own time step by default.

        Raises
        ------
        TwinError
            The model has delay buffers or plugins, which only `mj_step` can advance, or `dt`
            differs from the step its transfer-function actuators were made for.
        """
        if self._owner is None or self._owner[0] is not model or self._owner[1] is not data:
            self._bind(model, data)
        h = float(model.opt.timestep) if dt is None else dt
        if len(self._phases) and abs(h - model.opt.timestep) > 1e-12:
            raise TwinError(
                f"step {h:g} s: the transfer-function actuator of this model is exact for steps of"
                f" {model.opt.timestep:g} s only"
            )
        for _ in range(n):
            if self._known == 0 or data.time != self._time:
                self._start(model, data, h)
            else:
                self._forward(model, data)
                self._move(data, h)
                self._updates(model, data, h, data.act_dot)
            self._time = data.time

    def _bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        from twin.physics.native.actuator import phases
        from twin.physics.native.layout import MULTISTEP

        if model.nhistory or model.nplugin:
            raise TwinError("Adams–Bashforth cannot advance delay buffers or plugins of a model")
        model.opt.integrator = MULTISTEP
        self._owner, self._known = (model, data), 0
        self._joints = np.stack(
            [model.jnt_type, model.jnt_qposadr, model.jnt_dofadr], axis=1
        ).astype(np.int64)
        kinds = np.repeat(model.actuator_dyntype, np.maximum(model.actuator_actnum, 0))
        self._smooth = np.isin(kinds, _SMOOTH_ACTIVATIONS)
        self._lag = _lags(model)
        self._phases = phases(model)
        self._history = np.zeros((self.order, model.nq + model.nv + model.na))
        self._ages = np.zeros(self.order)

    def _start(self, model: mujoco.MjModel, data: mujoco.MjData, h: float) -> None:
        """First step, in parts of h·2⁻ᵏ, h·2⁻ᵏ, h·2¹⁻ᵏ … h/2: forward only, no part repeated."""
        self._known = 0
        self._ages[:] = 0.0
        parts = _STARTUP[self.order]
        begin = data.time
        rates = np.zeros(model.na)
        for k in range(parts + 1):
            self._forward(model, data)
            if k == 0:
                rates[:] = data.act_dot
            self._move(data, h * 2.0 ** -(parts - max(k - 1, 0)) if parts else h)
        data.time = begin + h
        self._updates(model, data, h, rates)

    def _forward(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_forward(model, data)
        data.qacc_warmstart[:] = data.qacc

    def _move(self, data: mujoco.MjData, h: float) -> None:
        # right after the start past parts are not equally long, whatever the steps are
        variable = self.variable or self._known < _STARTUP[self.order] + self.order
        _advance(
            data.qpos, data.qvel, data.act, data.qacc, data.act_dot, self._joints, self._smooth,
            self._history, self._ages, self._known, h, variable,
        )  # fmt: skip
        self._known += 1
        data.time += h

    def _updates(self, model: mujoco.MjModel, data: mujoco.MjData, h: float, rates: Array) -> None:
        """Advance the activations whose rates are updates over one whole step."""
        if not model.na:
            return
        lag = np.where(self._lag > 0.0, self._lag, 1.0)
        span = np.where(self._lag > 0.0, -lag * np.expm1(-h / lag), h)
        data.act[~self._smooth] += (span * rates)[~self._smooth]
        data.act[self._phases] = 0.0


def _lags(model: mujoco.MjModel) -> Array:
    """Time constants (na,) of activations that MuJoCo integrates as exponentials [s], else 0.

    Of `filterexact`, and of the current of a `dcmotor` with inductance, its last activation.
    """
    lags = np.zeros(model.na)
    exact = mujoco.mjtDyn.mjDYN_FILTEREXACT, mujoco.mjtDyn.mjDYN_DCMOTOR
    for k in np.flatnonzero(np.isin(model.actuator_dyntype, exact)):
        if model.actuator_actnum[k] > 0:
            last = model.actuator_actadr[k] + model.actuator_actnum[k] - 1
            lags[last] = model.actuator_dynprm[k, 0]
    return lags
