"""Building blocks of the message table: integers of fixed width with a unit."""

import struct
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, TypeVar, dataclass_transform, get_type_hints

T = TypeVar("T")

C_TYPES = {
    "B": "uint8_t",
    "H": "uint16_t",
    "h": "int16_t",
    "I": "uint32_t",
    "Q": "uint64_t",
}


@dataclass(frozen=True, slots=True)
class Wire:
    """Format of one field of a payload.

    Attributes
    ----------
    code : `struct` code of one element, a key of `C_TYPES`
    unit : unit of one least significant bit
    about : description for the generated header and the manual
    count : elements; more than one makes the field a tuple
    """

    code: str
    unit: str
    about: str
    count: int = 1


@dataclass(frozen=True, slots=True)
class Field:
    """A named field of a message."""

    name: str
    wire: Wire


@dataclass(frozen=True, slots=True)
class Layout:
    """Binary layout of a message, derived from its annotations.

    Attributes
    ----------
    type_id : first byte of the frame; 0x80 and above come from the device
    fields : in the order of the payload, little-endian, without padding
    packing : the whole payload as one `struct.Struct`
    """

    type_id: int
    fields: tuple[Field, ...]
    packing: struct.Struct

    @property
    def size(self) -> int:
        """Bytes of payload."""
        return self.packing.size


@dataclass_transform(frozen_default=True)
def message(type_id: int) -> Callable[[type[T]], type[T]]:
    """Turn an annotated class into a frozen message of the given type.

    Every annotation is `Annotated[int or tuple, Wire(...)]`; nothing else describes the layout.
    """

    def decorate(cls: type[T]) -> type[T]:
        frozen = dataclass(frozen=True, slots=True)(cls)
        frozen.TYPE_ID = type_id  # type: ignore[attr-defined]
        return frozen

    return decorate


_layouts: dict[type[Any], Layout] = {}


def layout(cls: type[Any]) -> Layout:
    """Return the binary layout of a message class."""
    if cls not in _layouts:
        hints = get_type_hints(cls, include_extras=True)
        members = tuple(Field(f.name, hints[f.name].__metadata__[0]) for f in fields(cls))
        codes = "".join(f"{member.wire.count}{member.wire.code}" for member in members)
        _layouts[cls] = Layout(cls.TYPE_ID, members, struct.Struct("<" + codes))
    return _layouts[cls]
