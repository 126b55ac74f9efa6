"""XML of unknown origin: no document type, no entities, bounded in size, depth and elements."""

import xml.etree.ElementTree as ET
from typing import Final, NoReturn
from xml.parsers import expat

DEEPEST: Final = 64
MOST_ELEMENTS: Final = 400_000


class XmlError(ValueError):
    """A document that is not well-formed or exceeds a bound; the text says which."""


class _Builder:
    """Builds the tree and counts; expat's handlers."""

    def __init__(self) -> None:
        self._tree = ET.TreeBuilder()
        self._depth = self._elements = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._elements += 1
        if self._depth > DEEPEST:
            raise XmlError(f"its elements are nested more than {DEEPEST} deep")
        if self._elements > MOST_ELEMENTS:
            raise XmlError(f"it has more than {MOST_ELEMENTS} elements")
        self._tree.start(tag, attributes)

    def end(self, tag: str) -> None:
        self._depth -= 1
        self._tree.end(tag)

    def text(self, text: str) -> None:
        self._tree.data(text)

    def close(self) -> ET.Element:
        return self._tree.close()


def _refuse(*_: object) -> NoReturn:
    raise XmlError("it declares a document type or entities, which are not accepted")


def parsed(content: bytes, largest: int) -> ET.Element:
    """Root element of an XML document of at most `largest` bytes.

    Raises
    ------
    XmlError : too large, not well-formed, with a document type or entities, or nested too deeply
    """
    if len(content) > largest:
        raise XmlError(f"it is larger than {largest} bytes")
    builder = _Builder()
    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.text
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, XmlError):
            raise
        raise XmlError(f"it is not well-formed XML: {error}") from None
    return builder.close()
