"""Compiled MuJoCo callbacks: the forces of flight and the transfer-function actuator.

Callbacks belong to the process, so they are installed for the length of a `with` block and act
on every model stepped meanwhile, on any thread; they change only models that carry their
numerics (`twin.physics.native.names`).
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from twin.errors import TwinError
from twin.physics.native.index import bind
from twin.physics.native.layout import LayoutError, verify

__all__ = ["LayoutError", "TwinError", "bind", "installed", "verify"]

_lock = threading.Lock()
_depth = 0
_previous: tuple[object, object] = (None, None)


@contextmanager
def installed() -> Iterator[None]:
    """Install the callbacks for a block; blocks may nest and overlap on several threads.

    The outermost one restores the previous callbacks.

    Raises
    ------
    LayoutError : this MuJoCo lays out its structs differently
    """
    _enter()
    try:
        yield
    finally:
        _leave()


def _enter() -> None:
    global _depth, _previous
    with _lock:
        if _depth == 0:
            _previous = (mujoco.get_mjcb_passive(), mujoco.get_mjcb_act_dyn())
            _set(None, None)  # no callback may run while `verify` compiles its model
            try:
                _set(*_compiled())
            except BaseException:
                _set(*_previous)
                raise
        _depth += 1


def _compiled() -> tuple[object, object]:
    """Both callbacks, compiled or from numba's cache; imported late, since that takes long."""
    verify()
    from twin.physics.native.actuator import act_dyn
    from twin.physics.native.forces import passive

    return passive.ctypes, act_dyn.ctypes


def _set(passive: object, act_dyn: object) -> None:
    mujoco.set_mjcb_passive(passive)
    mujoco.set_mjcb_act_dyn(act_dyn)


def _leave() -> None:
    global _depth
    with _lock:
        _depth -= 1
        if _depth == 0:
            _set(*_previous)
