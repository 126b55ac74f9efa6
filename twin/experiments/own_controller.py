"""A user's own object in the controller seat: loading it, calling it, reporting its errors."""

import importlib.util
import math
import sys
import traceback
from pathlib import Path
from types import ModuleType

import mujoco

from hardware.frames import GimbalState, Pair
from twin.errors import TwinError
from twin.loop.loop import Controller
from twin.plant.plant import Plant


class ControllerError(TwinError):
    """An own controller that failed; the message names its file and line."""


def load(place: str) -> object:
    """Return the object that FILE.py:NAME names; a class is called without arguments.

    The file is executed.

    Raises
    ------
    ControllerError : there is no such file or name, or executing it fails
    """
    file, _, name = place.rpartition(":")
    path = Path(file)
    if not path.is_file() or path.suffix != ".py":
        raise ControllerError(f"--controller {place}: {file} is not a Python file")
    module = _executed(path, place)
    found = getattr(module, name, None)
    if found is None:
        names = [n for n, v in vars(module).items() if hasattr(v, "update") and n[0] != "_"]
        listed = f"; it has {', '.join(names)}" if names else ""
        raise ControllerError(f"--controller {place}: {file} has no {name!r}{listed}")
    try:
        return found() if isinstance(found, type) else found
    except Exception as error:
        raise ControllerError(f"--controller {place}: {_where(error, str(path))}") from error


def _executed(path: Path, place: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"own_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up by name
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ControllerError(f"--controller {place}: {_where(error, str(path))}") from error
    return module


class OwnController:
    """Adapter from the loop to an object with `update(time, gimbal, vehicle) -> (x, y)`.

    Parameters
    ----------
    own : the object; `time` is in seconds, `gimbal` a `GimbalState`, `vehicle` a `VehicleState`.
        Where it has `start(model, period)`, that is called once with the MjModel and the time
        between two updates [s].
    plant : gives the vehicle's state
    shadow : updated too, since it gives the recording setpoint and error; its command is not used
    period : time between two updates [s]

    Raises
    ------
    ControllerError : no `update`, or `start` fails
    """

    def __init__(self, own: object, plant: Plant, shadow: Controller, period: float) -> None:
        update = getattr(own, "update", None)
        if not callable(update):
            raise ControllerError(
                f"controller {type(own).__name__}: has no update(time, gimbal, vehicle)"
            )
        self._update, self._plant, self._shadow = update, plant, shadow
        start = getattr(own, "start", None)
        if callable(start):
            self._start(start, plant.model, period)

    @staticmethod
    def _start(start: object, model: mujoco.MjModel, period: float) -> None:
        assert callable(start)
        try:
            start(model, period)
        except Exception as error:
            raise ControllerError(f"controller: {_where(error)}") from error

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Gimbal angle that the own controller commands [rad].

        Raises
        ------
        ControllerError : it raised an exception, or returned something else than two finite numbers
        """
        self._shadow.update(time, gimbal)
        try:
            x, y = self._update(time, gimbal, self._plant.vehicle())
            command = float(x), float(y)
        except Exception as error:
            raise ControllerError(f"controller at {time:.4f} s: {_where(error)}") from error
        if not (math.isfinite(command[0]) and math.isfinite(command[1])):
            raise ControllerError(
                f"controller at {time:.4f} s: update returned {command}; both must be finite"
            )
        return command


def _where(error: BaseException, file: str | None = None) -> str:
    """An exception with the place of its own code where it arose, in one line."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}: {error.msg}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f.filename != __file__ and (file is None or f.filename == file)]
    text = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return f"{own[-1].filename}, line {own[-1].lineno}: {text}" if own else text
