"""Compiling what a callback calls, with types kept."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def jit(function: F) -> F:
    """`numba.njit` that keeps the function's type for whoever calls it.

    A division by zero gives inf or NaN as in NumPy: a callback cannot raise, and what it leaves
    undone on an exception would pass for a flight without forces. Not cached on disk: only the
    callbacks are, with all they call.
    """
    return cast(F, numba.njit(error_model="numpy")(function))
