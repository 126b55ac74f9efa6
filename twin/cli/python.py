"""The verbs as Python functions: keyword arguments named as the flags, results instead of rows."""

import inspect
import json
import os
import typing
from collections.abc import Callable
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from analysis.files import FileError, content
from twin.cli.arguments import described
from twin.cli.ready import ready
from twin.config.base import hints, without_markers
from twin.config.types import POSITIONAL
from twin.config.verbs import BY_NAME, Verb
from twin.errors import TwinError

LARGEST_FILE = 10_000_000  # bytes of a JSON file
KEYWORD_ONLY = inspect.Parameter.KEYWORD_ONLY
SCREEN_ONLY = ("json",)  # settings about printing, without meaning here


def function(name: str) -> Callable[..., Any]:
    """Return a verb as a function.

    Its positional arguments are the verb's files; its keyword arguments are the settings. Where
    there is a setting `controller`, it may also be an object with `update(time, gimbal, vehicle)`.
    """
    verb = BY_NAME[name]

    def call(*files: object, **settings: object) -> Any:  # noqa: ANN401  each verb has its result
        settings = _named(verb, files, settings)
        controller = settings.get("controller")
        if controller is not None and not isinstance(controller, str):
            given = verb.settings.of({**settings, "controller": None})
            return verb.function(given, controller)
        given = verb.settings.of(settings)
        ready(name, given)
        return verb.function(given)

    call.__name__ = call.__qualname__ = name
    call.__module__ = "twin"
    call.__doc__ = _documentation(verb)
    call.__signature__ = signature(verb)  # type: ignore[attr-defined]
    return call


def _named(verb: Verb, given: tuple[object, ...], settings: dict[str, object]) -> dict[str, object]:
    """Settings with the positional arguments by their names.

    Raises
    ------
    TwinError : too many or too few positional arguments
    """
    places = [name for name, hint in hints(verb.settings).items() if _is_positional(hint)]
    if given and not places:
        raise TwinError(f"twin.{verb.name}: takes keyword arguments only")
    if len(places) == 1 and given:
        hint = without_markers(hints(verb.settings)[places[0]])
        if typing.get_origin(hint) is tuple:  # any number of files, one by one or as a list
            given = (given[0],) if len(given) == 1 else (given,)
    if len(given) > len(places):
        what = "one file" if len(places) == 1 else " and ".join(places)
        raise TwinError(f"twin.{verb.name}: takes {what}, not {len(given)}")
    settings = {**settings, **dict(zip(places, given, strict=False))}
    needed = {f.name for f in fields(verb.settings) if f.default is MISSING}
    if missing := [name for name in places if name in needed and name not in settings]:
        raise TwinError(f"twin.{verb.name}: needs {' and '.join(missing)}")
    return settings


def signature(verb: Verb) -> inspect.Signature:
    """Parameters of a verb's function, with their defaults and types."""
    parameters = []
    for f in fields(verb.settings):
        if f.name in SCREEN_ONLY:
            continue
        hint = hints(verb.settings)[f.name]
        of_files = _is_positional(hint)
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if of_files else KEYWORD_ONLY
        default = inspect.Parameter.empty if f.default is MISSING else f.default
        plain = without_markers(hint)
        parameters.append(inspect.Parameter(f.name, kind, default=default, annotation=plain))
    parameters.sort(key=lambda p: p.kind)
    return inspect.Signature(parameters)


def _is_positional(hint: object) -> bool:
    return POSITIONAL in getattr(hint, "__metadata__", ())


def _documentation(verb: Verb) -> str:
    lines = [inspect.cleandoc(verb.settings.__doc__ or ""), "", "Parameters", "----------"]
    names = (f.name for f in fields(verb.settings) if f.name not in SCREEN_ONLY)
    return "\n".join([*lines, *(f"{n} : {described(verb.settings, n)[1]}" for n in names)])


def read(path: str | os.PathLike[str]) -> Any:  # noqa: ANN401  analysis.recording.Recording
    """Return a recording: signals by name, each with `time` [s] and `values` (n, k) in SI.

    Parameters
    ----------
    path : a .rrd file, or what `twin export` wrote as .csv, .parquet or .mat; or the result of a
        verb that wrote one

    Raises
    ------
    AnalysisError : it is not a valid recording
    """
    from analysis.recording import read as read_recording

    return read_recording(Path(path))


def load(path: str | os.PathLike[str]) -> Any:  # noqa: ANN401  depends on the file
    """Return what a JSON file of the twin describes: an identified model, or a calibration.

    Raises
    ------
    TwinError : it is neither
    AnalysisError, HardwareError : it is not valid
    """
    file = Path(path)
    try:
        held = json.loads(content(file, LARGEST_FILE))
    except FileError as error:
        raise TwinError(f"cannot read {error}") from None
    except (ValueError, RecursionError):
        raise TwinError(f"{file}: is not JSON; recordings are read with twin.read") from None
    schema = held.get("schema", "") if isinstance(held, dict) else ""
    if str(schema).startswith("tvc-twin/transfer-function/"):
        from analysis.transfer_function import TransferFunctionModel

        return TransferFunctionModel.read(file)
    if str(schema).startswith("tvc-twin/calibration/"):
        from hardware.calibration import read as read_calibration

        return read_calibration(file)
    raise TwinError(
        f"{file}: has the schema {schema!r}; must be an identified model or calibration"
    )
