"""Compiled functions whose disk cache follows every source they are compiled from.

numba keys its disk cache by the file of the outer function alone: after an edit of a helper in
another file it would load the old machine code. These decorators put a digest of everything the
function reaches into the name of its cache files.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import numba
import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

_VERSIONED = {"numba", "numpy"}  # their versions stand for their sources


def njit(**options: Any) -> Callable[[F], F]:  # noqa: ANN401 - numba's own options
    """`numba.njit(cache=True, **options)` that keeps the type of the function."""
    return lambda function: _keyed(function, lambda cache: numba.njit(cache=cache, **options))


def cfunc(signature: Any, **options: Any) -> Callable[[F], Any]:  # noqa: ANN401 - numba's types
    """`numba.cfunc(signature, cache=True, **options)`."""
    return lambda function: _keyed(
        function, lambda cache: numba.cfunc(signature, cache=cache, **options)
    )


def _keyed(function: Any, build: Callable[[bool], Any]) -> Any:  # noqa: ANN401 - numba's own
    name = function.__qualname__
    function.__qualname__ = f"{name}-{fingerprint(function)}"  # names the cache files
    try:
        built = build(True)(function)
        _tolerate_full_disk(built)
        return built
    except (RuntimeError, OSError):  # nothing can be written: it is compiled in every process
        return build(False)(function)
    finally:
        function.__qualname__ = name


def _tolerate_full_disk(built: Any) -> None:  # noqa: ANN401 - numba's own
    """Let a function that was compiled run although it cannot be kept."""
    kept = built._cache
    save = kept.save_overload

    def save_overload(signature: Any, data: Any) -> None:  # noqa: ANN401 - numba's own
        with suppress(OSError):
            save(signature, data)

    kept.save_overload = save_overload


@cache
def cache_folder() -> Path | None:
    """Folder of the compiled functions of this module; None where numba can write none."""
    from numba.core.caching import FunctionCache

    try:
        return Path(FunctionCache(fingerprint).cache_path)
    except RuntimeError:
        return None


def fingerprint(function: FunctionType) -> str:
    """Digest of the sources and constants that `function` is compiled from.

    These are the files of the functions it calls, however deep, the values of the globals and
    closure variables they use, and the version of NumPy; numba itself keeps apart its own
    versions, processors and argument types.
    """
    parts = sorted(set(_reached(function, set())))
    return hashlib.sha256("\n".join([np.__version__, *parts]).encode()).hexdigest()[:16]


def _reached(function: FunctionType, seen: set[int]) -> Iterator[str]:
    if id(function) in seen or function.__module__.partition(".")[0] in _VERSIONED:
        return
    seen.add(id(function))
    yield _file(function.__code__.co_filename)
    for name, value in _variables(function):
        inner = _function(value)
        if inner is not None:
            yield from _reached(inner, seen)
        elif isinstance(value, numba.types.Type) or not callable(value):  # types can be called
            yield f"{function.__module__}.{function.__qualname__}.{name} = {_text(value)}"


def _function(value: Any) -> FunctionType | None:  # noqa: ANN401 - any global of a module
    """The Python function behind a plain function, a dispatcher, a cfunc or an intrinsic."""
    inner = getattr(value, "py_func", None) or getattr(value, "__wrapped__", value)
    return inner if isinstance(inner, FunctionType) else None


def _variables(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Closure variables and globals of a function, and the attributes it takes of modules."""
    names = sorted(set(_names(function.__code__)))
    held = {name: function.__globals__[name] for name in names if name in function.__globals__}
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    held |= {name: cell.cell_contents for name, cell in cells}
    for name, value in held.items():
        if _is_module(value):
            taken = {n: getattr(value, n) for n in names if hasattr(value, n)}
            yield from ((f"{name}.{n}", v) for n, v in taken.items() if not _is_module(v))
        else:
            yield name, value


def _is_module(value: Any) -> bool:  # noqa: ANN401 - any global of a module
    return isinstance(value, ModuleType)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _text(value: Any) -> str:  # noqa: ANN401 - any constant
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    return repr(value)


@cache
def _file(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
