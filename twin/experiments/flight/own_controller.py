"""A user's own object in the controller seat: loading it, calling it, reporting its errors."""

import inspect
import math
import sys
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Any

import mujoco

from hardware.frames import GimbalState, Pair
from twin.errors import TwinError
from twin.loop.seats import Pilot

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST = 300  # characters of an exception's text or of a value in a message
LARGEST_ANGLE = math.pi / 2  # rad; far past every gimbal's stops, so more is a mistake of units
FAILURES = (Exception, SystemExit)  # a file that calls sys.exit must not end the twin


class ControllerError(TwinError):
    """An own controller that failed; the message names its file and line."""


def load(place: str) -> object:
    """Return the object that FILE.py:NAME names; a class is called without arguments.

    The file is executed. It may import modules from its own folder.

    Raises
    ------
    ControllerError : there is no such file or name, or executing it fails
    """
    file, _, name = place.rpartition(":")
    path = Path(file)
    if path.suffix == ".py" and not path.exists():
        raise ControllerError(f"--controller {place}: there is no file {file}")
    if not path.is_file() or path.suffix != ".py":
        raise ControllerError(f"--controller {place}: {file or 'it'} is not a Python file")
    path = path.resolve()
    with _reported(f"--controller {place}", str(path)):
        module = _executed(path)
        attributes = vars(module)
        if name in attributes:
            named = attributes[name]
            own: object = named() if isinstance(named, type) else named
            _check(own, f"--controller {place}")
            return own
    names = [n for n, v in attributes.items() if n[0] != "_" and _is_controller(v)]
    listed = f"; it has {', '.join(names)}" if names else ""
    raise ControllerError(f"--controller {place}: {file} has no {name!r}{listed}")


def _is_controller(value: object) -> bool:
    kind = value if isinstance(value, type) else type(value)
    return hasattr(value, "update") and kind.__module__ != "builtins"


class _Source(SourceFileLoader):
    """A loader that neither reads nor writes compiled files: an edit always counts."""

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002  the base's signature
        return self.source_to_code(self.get_data(self.path), self.path)


def _executed(path: Path) -> ModuleType:
    name = f"own_controller_{path.stem}"
    spec = spec_from_file_location(name, path, loader=_Source(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up by name
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


class OwnController:
    """Adapter from the loop to an object with `update(time, gimbal, vehicle) -> (x, y)`.

    Parameters
    ----------
    own : the object. `time` is in seconds, `gimbal` a `GimbalState`, `vehicle` a `VehicleState`
        with the attitude and rate that the attitude seat shows. Where `update` has a parameter
        `setpoint`, it is given the wanted nose direction (3,), a unit vector in the world. Where
        the object has `start(model, period)`, that is called once with the MjModel and the time
        between two updates [s].
    model : of the plant
    pilot : gives vehicle, setpoint and error; its command is not used
    period : time between two updates [s]

    Raises
    ------
    ControllerError : no `update`, or `start` fails
    """

    def __init__(self, own: object, model: mujoco.MjModel, pilot: Pilot, period: float) -> None:
        self._update = _check(own, "controller")
        self._with_setpoint = _takes(self._update, "setpoint")
        self._pilot = pilot
        start = getattr(own, "start", None)
        if callable(start):
            with _reported("controller", _file(start)):
                start(model, period)

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Gimbal angle that the own controller commands [rad].

        Raises
        ------
        ControllerError : it raised an exception, or returned something else than two angles
        """
        pilot = self._pilot
        pilot.update(time, gimbal)
        vehicle = pilot.vehicle()
        try:
            if self._with_setpoint:
                command = self._update(time, gimbal, vehicle, setpoint=pilot.direction.copy())
            else:
                command = self._update(time, gimbal, vehicle)
        except FAILURES as error:
            text = _where(error, _file(self._update))
            raise ControllerError(f"controller at {time:.4f} s: {text}") from error
        try:
            x, y = command
            x, y = float(x), float(y)
        except FAILURES:
            raise self._wrong(time, command) from None
        if not (abs(x) <= LARGEST_ANGLE and abs(y) <= LARGEST_ANGLE):  # also where one is NaN
            raise self._wrong(time, command)
        return x, y

    def _wrong(self, time: float, command: object) -> ControllerError:
        code = getattr(self._update, "__code__", None)
        place = f"{code.co_filename}, line {code.co_firstlineno}: " if code is not None else ""
        return ControllerError(
            f"controller at {time:.4f} s: {place}update returned {_shown(command)}; must be two"
            f" angles (x, y) from -{LARGEST_ANGLE:.4g} to {LARGEST_ANGLE:.4g} rad"
        )


def _check(own: object, what: str) -> Callable[..., Any]:
    """Return the object's `update`, or say what is wrong with the object."""
    update = getattr(own, "update", None)
    if isinstance(own, type):
        raise ControllerError(
            f"{what}: {own.__name__} is a class; give an object, {own.__name__}()"
        )
    if not callable(update):
        raise ControllerError(
            f"{what}: {type(own).__name__} has no update(time, gimbal, vehicle) -> (x, y)"
        )
    return update  # type: ignore[no-any-return]


def _takes(function: Callable[..., Any], name: str) -> bool:
    try:
        return name in inspect.signature(function).parameters
    except (TypeError, ValueError):  # some callables written in C have no signature
        return False


def _file(function: object) -> str | None:
    """File of a function as tracebacks name it, if it has one."""
    code = getattr(function, "__code__", None)
    return None if code is None else str(code.co_filename)


def _shown(value: object) -> str:
    try:
        text = " ".join(repr(value).split())
    except FAILURES:
        text = f"an object of type {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} …"


@contextmanager
def _reported(what: str, file: str | None) -> "Iterator[None]":
    """Turn any failure of the user's code into one line."""
    try:
        yield
    except ControllerError:
        raise
    except FAILURES as error:
        raise ControllerError(f"{what}: {_where(error, file)}") from error


def _where(error: BaseException, file: str | None) -> str:
    """An exception with the last line of the user's file that led to it, in one line."""
    if isinstance(error, SyntaxError) and error.lineno is not None:
        return f"{error.filename}, line {error.lineno}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename == file] or [f for f in frames if f.filename != __file__]
    text = " ".join(f"{type(error).__name__}: {error}".split())[:LONGEST]
    if own:
        return f"{own[-1].filename}, line {own[-1].lineno}: {text}"
    return f"{file}: {text}" if file else text
