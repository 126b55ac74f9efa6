"""The configuration of a recorded run, read back as untrusted input."""

import types
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from analysis.recording import Recording
from twin.config import Fly, Run, Step
from twin.errors import TwinError

KINDS: Mapping[str, type[Run]] = {"fly": Fly, "step": Step}
LONGEST = 1000  # entries of a tuple, characters of a text


def configuration_of(recording: Recording) -> Run:
    """Return the configuration that a recording carries.

    Raises
    ------
    TwinError : it carries none, or one that this version does not understand
    """
    command = recording.properties.get("command")
    if command not in KINDS:
        raise TwinError(
            f"the recording is of {command!r}; {' and '.join(KINDS)} can be flown again"
        )
    settings = recording.properties.get("configuration")
    if not isinstance(settings, dict):
        raise TwinError("the recording carries no configuration")
    kind = KINDS[str(command)]
    hints = get_type_hints(kind)
    known = {f.name for f in fields(kind)}
    if strange := sorted(set(settings) - known):
        raise TwinError(
            f"the recording's configuration has {', '.join(map(repr, strange[:5]))}, which"
            " this version does not know"
        )
    return kind(**{name: typed(name, value, hints[name]) for name, value in settings.items()})


def typed(name: str, value: object, hint: Any) -> Any:  # noqa: ANN401  a type, and a value of it
    """Return a JSON value as what a configuration's annotation asks for.

    Raises
    ------
    TwinError : it is something else
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return typed(name, value, arguments[0])
    if origin in (Union, types.UnionType):
        return _either(name, value, arguments)
    if origin is Literal:
        if value in arguments:
            return value
        raise _wrong(name, value, " or ".join(map(repr, arguments)))
    if origin is tuple:
        return _tuple(name, value, arguments)
    if hint is Path and isinstance(value, str) and len(value) <= LONGEST and "\0" not in value:
        return Path(value)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        if isinstance(value, int) and abs(value) > 2**1000:
            raise _wrong(name, value, "a number")
        return float(value)
    if hint is int and isinstance(value, bool):
        raise _wrong(name, value, "a whole number")
    if isinstance(hint, type) and isinstance(value, hint) and len(str(value)) <= LONGEST:
        return value
    raise _wrong(name, value, getattr(hint, "__name__", str(hint)))


def _either(name: str, value: object, options: tuple[Any, ...]) -> Any:  # noqa: ANN401
    if value is None and type(None) in options:
        return None
    for option in options:
        if option is not type(None):
            try:
                return typed(name, value, option)
            except TwinError:
                continue
    raise _wrong(name, value, " or ".join(str(getattr(o, "__name__", o)) for o in options))


def _tuple(name: str, value: object, inside: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple) or len(value) > LONGEST:
        raise _wrong(name, value, "a list")
    if len(inside) == 2 and inside[1] is Ellipsis:
        return tuple(typed(name, v, inside[0]) for v in value)
    if len(value) != len(inside):
        raise _wrong(name, value, f"a list of {len(inside)}")
    return tuple(typed(name, v, h) for v, h in zip(value, inside, strict=True))


def _wrong(name: str, value: object, right: str) -> TwinError:
    return TwinError(
        f"the recording's configuration says {name} = {str(value)[:60]!r}; {right} is right"
    )
