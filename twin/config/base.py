"""Base of every verb's settings: one conversion and validation, whatever the source."""

import functools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from types import MappingProxyType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Self,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from twin.config.values import SettingError, converted, refusal
from twin.errors import TwinError

_HINTS: dict[type, Mapping[str, Any]] = {}


def hints(kind: "type[Settings]") -> Mapping[str, Any]:
    """Annotations of a settings class by field name, with their markers."""
    if kind not in _HINTS:
        annotations = get_type_hints(kind, include_extras=True)
        _HINTS[kind] = {f.name: annotations[f.name] for f in fields(kind)}
    return _HINTS[kind]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a verb can be asked; immutable, converted and validated when it is made.

    Attributes
    ----------
    group : heading of a class' own fields in `--help`
    effective : of settings that act with some values of another setting only, that other setting
        and those values
    """

    group: ClassVar[str] = ""
    effective: ClassVar[Mapping[str, tuple[str, tuple[str, ...]]]] = MappingProxyType({})

    def __post_init__(self) -> None:
        """Convert and validate every field, then check that they fit each other.

        Raises
        ------
        TwinError : the flag, its value and what it must be
        """
        for name, hint in hints(type(self)).items():
            try:
                object.__setattr__(self, name, converted(getattr(self, name), hint))
            except SettingError as fault:
                raise refusal(name, fault) from None
            except TwinError as error:  # overrides of another name than --set
                raise TwinError(str(error).replace("--set ", f"{flag(name)} ", 1)) from None
        self.validate()

    def validate(self) -> None:
        """Refuse settings without effect and contradictions; extended by subclasses.

        Raises
        ------
        TwinError : the flags and why they exclude each other
        """
        defaults = {f.name: f.default for f in fields(self)}
        for name, (other, values) in self.effective.items():
            given, chosen = getattr(self, name), getattr(self, other)
            if given != defaults[name] and chosen not in values:
                shown = " ".join(map(str, given)) if isinstance(given, tuple) else f"{given}"
                kind = other if other == "action" else flag(other)
                raise TwinError(
                    f"{flag(name)} {shown}: has no effect with {kind} {chosen}; it is for"
                    f" {', '.join(values)}"
                )

    @property
    def extras(self) -> tuple[str, ...]:
        """Extras of the installation that these settings need, see `twin.cli.ready`."""
        return ()

    @classmethod
    def of(cls, settings: Mapping[str, object]) -> Self:
        """Settings from keyword arguments of any origin.

        Raises
        ------
        TwinError : a name that is not a setting, with the nearest valid ones
        """
        valid = hints(cls)
        for name in settings:
            if name not in valid:
                raise TwinError(unknown(name, tuple(valid)))
        return cls(**settings)

    def as_properties(self) -> dict[str, object]:
        """Settings as JSON values, for a recording."""
        values: dict[str, Any] = {
            k: str(v) if isinstance(v, Path) else v for k, v in asdict(self).items()
        }
        for field in ("set", "shadow_set"):
            if pairs := values.get(field):
                values[field] = [f"{name}={value!r}" for name, value in dict(pairs).items()]
        return values


def unknown(name: str, valid: Sequence[str], what: str = "setting") -> str:
    """Return the message about a name that is none of the valid ones, with the nearest of them."""
    from difflib import get_close_matches

    near = get_close_matches(name, valid, n=3)
    return f"unknown {what} {name!r}; " + (
        f"did you mean {' or '.join(near)}?" if near else f"valid: {', '.join(valid)}"
    )


def flag(name: str) -> str:
    """Return the command line's name of a setting."""
    return f"--{name.replace('_', '-')}"


def without_markers(hint: Any) -> Any:  # noqa: ANN401  a type
    """An annotation without markers and limits, at every level."""
    if get_origin(hint) is Annotated:
        return without_markers(get_args(hint)[0])
    if get_origin(hint) is UnionType or get_origin(hint) is Union:
        return functools.reduce(operator.or_, map(without_markers, get_args(hint)))
    if get_origin(hint) is tuple:
        return tuple.__class_getitem__(tuple(map(without_markers, get_args(hint))))
    return hint
