"""Compiling what a callback calls, with types kept."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def jit(function: F) -> F:
    """`numba.njit` that keeps the type of the function.

    A division by zero gives inf or NaN as in NumPy: a callback cannot raise, and an exception would
    leave forces out without notice. Not cached on disk: only the callbacks are, with all they
    call.
    """
    return cast(F, numba.njit(error_model="numpy")(function))
