"""Integrators by name, and the largest steps of the explicit ones.

docs/integrators.md has orders, stability limits and costs.
"""

from typing import Final, Protocol

import mujoco

from twin.errors import TwinError
from twin.plant.steps.adams_bashforth import AdamsBashforth

NATIVE: Final = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
ADAMS_BASHFORTH: Final = {"ab1": 1, "ab2": 2, "ab3": 3, "ab4": 4}
NAMES: Final = (*NATIVE, *ADAMS_BASHFORTH)

# Largest steps [s] of explicit methods; others take any. An eigenvalue λ must keep dt·λ inside the
# method's region of stability. The lugs of the reference vehicle on an elastic ramp, 15000 N/m and
# 60 N s/m each, have λ = −73 ± 177i /s while both hold, which limits dt to 4.0, 4.6, 3.3 and 1.9 ms
# for orders 1 to 4; rods closed with a time constant of 4 ms have λ = −250 /s twice: 8.0, 4.0, 2.2
# and 1.2 ms. In flight modes couple and less remains: these are the largest steps of a steered
# launch, in increments of 0.5 ms, that end within 0.4 m of the reference position after 6 s.
ON_RAMP: Final = {"ab1": 0.0035, "ab2": 0.004, "ab3": 0.0025, "ab4": 0.0015}
WITH_RODS: Final = {"ab1": 0.005, "ab2": 0.004, "ab3": 0.0015, "ab4": 0.0005}


class Stepper(Protocol):
    """Advances a model in time."""

    def step(
        self, model: mujoco.MjModel, data: mujoco.MjData, n: int = 1, dt: float | None = None
    ) -> None:
        """Take `n` steps of `dt` [s], the model's own time step by default."""

    def fresh(self) -> "Stepper":
        """Return the same method without history."""

    def restart(self) -> None:
        """Discard the history, as after a jump of the command; costs nothing."""


def make(name: str) -> Stepper:
    """Stepper by name.

    Raises
    ------
    TwinError
        No integrator has that name.
    """
    if name in NATIVE:
        return Native(NATIVE[name])
    if name in ADAMS_BASHFORTH:
        return AdamsBashforth(ADAMS_BASHFORTH[name])
    raise TwinError(f"no integrator {name!r}; valid: {', '.join(NAMES)}")


def check_step(name: str, dt: float, *, ramp: bool, rods: bool) -> None:
    """Refuse a step at which an integrator is unstable.

    Parameters
    ----------
    dt : physics step [s]
    ramp : whether a vehicle is held by the lugs of an elastic ramp
    rods : whether rods hold the gimbal

    Raises
    ------
    TwinError : gives the step and the largest stable one
    """
    holds = ((ramp, ON_RAMP, "lugs on an elastic ramp"), (rods, WITH_RODS, "rods"))
    limits = [(largest[name], what) for there, largest, what in holds if there and name in largest]
    if not limits:
        return
    largest, what = min(limits)
    if dt > largest * (1 + 1e-9):
        raise TwinError(
            f"--dt {dt:g}: --integrator {name} is unstable with {what} above {largest:g} s; give"
            " a smaller step, or --integrator implicitfast"
        )


class Native:
    """MuJoCo's own integration, `n` steps in one call."""

    def __init__(self, integrator: mujoco.mjtIntegrator) -> None:
        self.integrator = integrator

    def step(
        self, model: mujoco.MjModel, data: mujoco.MjData, n: int = 1, dt: float | None = None
    ) -> None:
        """Take `n` steps of `dt` [s], the model's own time step by default."""
        model.opt.integrator = self.integrator
        if dt is None:
            mujoco.mj_step(model, data, n)
            return
        own, model.opt.timestep = model.opt.timestep, dt
        try:
            mujoco.mj_step(model, data, n)
        finally:
            model.opt.timestep = own

    def fresh(self) -> "Native":
        """Return itself: there is no history."""
        return self

    def restart(self) -> None:
        """Do nothing: there is no history."""
