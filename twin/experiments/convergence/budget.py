"""The finest time step that real time allows on this machine, measured."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hardware.frames import GimbalCommand
from twin.config import Converge
from twin.experiments.convergence.flights import Loop, tick_of
from twin.plant.model.model import TwinModel

TICKS = 150
WARM = 20
IN_TIME = 99.0  # percent of the ticks that must be done within their period
MOST_STEPS = 500  # to a tick; finer steps have no effect but cost memory


@dataclass(frozen=True)
class Budget:
    """The finest step of one integrator.

    Attributes
    ----------
    step : finest time step whose control ticks were done in time [s]; NaN if none was
    tick_cost : 99th percentile of a tick's computing, controller included [s]
    step_cost : mean of one physics step [s]
    """

    integrator: str
    step: float
    tick_cost: float
    step_cost: float


def budget(models: Callable[[float], TwinModel], integrator: str, config: Converge) -> Budget:
    """Search the divisors of the control period from a first guess on, coarser until in time.

    Returns the step at which 99 of 100 ticks of a real flight took less than the control period.
    """
    period = tick_of(config)
    divisors = [n for n in range(1, MOST_STEPS + 1) if period % n == 0]
    first = divisors[min(3, len(divisors) - 1)]
    cost = _tick_costs(models, integrator, config, period, first)
    # as if the whole tick were steps: the guess is too fine, the search goes on to coarser ones
    guess = period * 1e-9 * first / float(np.percentile(cost, IN_TIME))
    for n in reversed([d for d in divisors if d <= max(1.0, guess)]):
        cost = _tick_costs(models, integrator, config, period, n)
        worst = float(np.percentile(cost, IN_TIME))
        if worst <= period * 1e-9:
            return Budget(integrator, period * 1e-9 / n, worst, float(cost.mean()) / n)
    return Budget(integrator, float("nan"), worst, float(cost.mean()) / n)


def _tick_costs(
    models: Callable[[float], TwinModel], integrator: str, config: Converge, period: int, n: int
) -> np.ndarray:
    """Processor seconds of each tick of a flight from the launch on, (TICKS,).

    Processor time, since a run in real time has its processor to itself (SCHED_FIFO) and this
    measurement may have not.
    """
    loop = Loop(models(period // n * 1e-9), integrator, config, period)
    seats, spent = loop.seats, np.empty(TICKS + WARM)
    for k in range(TICKS + WARM):
        began = time.thread_time()
        time_ns = seats.plant.time_ns
        angle = seats.controller.update(time_ns * 1e-9, seats.gimbal.poll())
        seats.gimbal.send(GimbalCommand(time_ns, angle))
        seats.plant.advance(n)
        spent[k] = time.thread_time() - began
        if spent[: k + 1].sum() > 4.0 * TICKS * period * 1e-9:
            return spent[: k + 1]  # far too slow already
    return spent[WARM:]
