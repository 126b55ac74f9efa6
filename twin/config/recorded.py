"""The settings of a recorded run, read back as untrusted input."""

from collections.abc import Mapping
from typing import Any

from analysis.recording import Recording
from twin.config.base import hints
from twin.config.options import Run
from twin.config.runs import Fly, Step
from twin.config.values import SettingError, converted, shown
from twin.errors import TwinError

KINDS: Mapping[str, type[Run]] = {"fly": Fly, "step": Step}


def configuration_of(recording: Recording) -> Run:
    """Return the settings that a recording carries.

    Raises
    ------
    TwinError : it carries none, or some that this version does not understand
    """
    command = recording.properties.get("command")
    if command is None:
        raise TwinError("the recording carries no settings of a run; a .csv cannot be repeated")
    if command not in KINDS:
        raise TwinError(
            f"the recording is of {command!r}; only {' and '.join(KINDS)} can be repeated"
        )
    settings = recording.properties.get("configuration")
    if not isinstance(settings, dict):
        raise TwinError("the recording carries no configuration")
    kind = KINDS[str(command)]
    if strange := sorted(set(settings) - set(hints(kind))):
        raise TwinError(
            f"the recording's configuration has {', '.join(map(repr, strange[:5]))}, which"
            " this version does not know"
        )
    try:
        return kind(**settings)
    except TwinError as error:
        raise TwinError(f"the recording's configuration: {error}") from None


def typed(name: str, value: object, hint: Any) -> Any:  # noqa: ANN401  a type, and a value of it
    """Return a JSON value as what an annotation asks for.

    Raises
    ------
    TwinError : it is something else
    """
    try:
        return converted(value, hint)
    except SettingError as error:
        raise TwinError(
            f"the recording says {name} = {shown(error.value)}: must be {error.right}"
        ) from None
