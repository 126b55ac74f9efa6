"""Steps of a search over the rough residual of a `LinkageProblem`."""

import io

import numpy as np

from analysis.array import Array
from analysis.linkage.problem import LinkageProblem, sysid_module

# Relative. Stick, play and dead band make the loss rough: slopes between near neighbours are of the
# dents, not of the valley, and promise deviations several times too small. So the search takes its
# slopes across a wide difference, and ends with planes laid through many places around it.
_DIFFERENCE = 0.1
_PLACES = 32
_WIDTH = 0.35  # standard deviation of their logarithms; servos of one kind differ by half
_DAMPING = (1e-3, 1e3)  # of a search step, over the slopes' own curvature; a stall costs its ratio


def best(problem: LinkageProblem) -> Array:
    """The best of the start and places around it."""
    low, high = (b[:, None] for b in problem.parameters.get_bounds())
    places = problem.start[:, None] + _WIDTH * _draws(problem, 0)
    tried = np.clip(np.hstack([problem.start[:, None], places]), low, high)
    left = problem.residuals(tried, problem.parameters.copy())[0][0]
    return np.asarray(tried[:, int(np.argmin(np.sum(left**2, axis=0)))])


def slope(problem: LinkageProblem, x: Array) -> Array:
    """∂residual/∂x (rows, knobs) across a wide difference, in one batch of rollouts."""
    low, high = problem.parameters.get_bounds()
    ahead, behind = np.minimum(x + _DIFFERENCE, high), np.maximum(x - _DIFFERENCE, low)
    both = np.hstack([x[:, None] + np.diag(ahead - x), x[:, None] + np.diag(behind - x)])
    found = problem.residuals(both, problem.parameters.copy())[0][0]
    n = len(x)
    return np.asarray((found[:, :n] - found[:, n:]) / (ahead - behind))


def plane(
    problem: LinkageProblem, x: Array, jacobian: Array, across: tuple[float, float], seed: int
) -> tuple[Array, Array]:
    """Residual at x (rows,) and slopes (rows, knobs) of the plane through places around it.

    Parameters
    ----------
    jacobian : slopes as known so far; they say how far the fit tells each direction
    across : where the places lie: deviations, and a distance that is added
    """
    width, least = across
    residual = problem.residuals(x, problem.parameters.copy())[0][0]
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * np.var(residual)
    spread = np.linalg.cholesky(width**2 * covariance + least**2 * np.eye(len(x)))
    low, high = (b[:, None] for b in problem.parameters.get_bounds())
    places = np.clip(x[:, None] + spread @ _draws(problem, seed), low, high)
    found = problem.residuals(places, problem.parameters.copy())[0][0]
    design = np.vstack([np.ones(places.shape[1]), places - x[:, None]]).T
    fitted = np.linalg.lstsq(design, found.T, rcond=1e-9)[0]
    return np.asarray(fitted[0]), np.asarray(fitted[1:].T)


def lowest(problem: LinkageProblem, x: Array, residual: Array, jacobian: Array) -> Array:
    """Where a plane says that the loss is least, within the bounds."""
    from scipy.optimize import lsq_linear

    low, high = problem.parameters.get_bounds()
    tiny = 1e-9 * (high - low)  # SciPy wants room between the bounds and where it starts
    found = lsq_linear(jacobian, -residual, (low - x - tiny, high - x + tiny))
    return np.asarray(np.clip(x + found.x, low, high))


def descended(problem: LinkageProblem, x: Array, most: int) -> Array:
    """Where `mujoco.sysid` gets from x with wide slopes."""
    problem.parameters.update_from_vector(x)
    least, largest = _DAMPING
    _, found = sysid_module().optimize(
        problem.parameters,
        problem.residuals,
        optimizer="mujoco",
        verbose=False,
        output=io.StringIO(),  # of the search's own log, which nothing else silences
        jacobian=lambda at, _: slope(problem, at.ravel()),
        mu_min=least,
        mu_max=largest,
        mu_factor=10.0**0.5,
        xtol=1e-3,
        max_iters=most,
        x_scale="jac",
    )
    return np.asarray(found.x, dtype=np.float64).ravel()


def _draws(problem: LinkageProblem, seed: int) -> Array:
    """Evenly spread normal draws (knobs, places), several for each knob."""
    from scipy.stats import qmc

    size = max(_PLACES, 1 << (4 * len(problem.knobs)).bit_length())
    engine = qmc.MultivariateNormalQMC(np.zeros(len(problem.knobs)), seed=seed)
    return np.asarray(engine.random(size).T)
