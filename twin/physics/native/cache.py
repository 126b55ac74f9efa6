"""Compiling with numba: with types kept, and with a cache that sees every source file.

numba keys its cache by the file of the outermost function alone, so an edited formula or a new
MuJoCo would go unnoticed. Compiled callbacks therefore close over this fingerprint, which enters
the key.
"""

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import mujoco
import numba
import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parents[1]


def jit(function: F) -> F:
    """`numba.njit` that keeps the function's type for whoever calls it.

    A division by zero gives inf or NaN as in NumPy: a callback cannot raise, and what it leaves
    undone on an exception would pass for a flight without forces.
    """
    return cast(F, numba.njit(error_model="numpy")(function))


@functools.cache
def fingerprint() -> str:
    """Digest of the sources of `native` and `aerodynamics`, and of the versions of libraries."""
    digest = hashlib.sha256(f"{mujoco.__version__} {numba.__version__} {np.__version__}".encode())
    for folder in ("native", "aerodynamics"):
        for path in sorted((_PACKAGE / folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()
