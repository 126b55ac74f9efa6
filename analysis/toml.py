"""TOML of unknown origin."""

import re
import tomllib
from typing import Any, Final

DEEPEST: Final = 16  # names between dots
# one match attempt for each name, and possessive, so that no text takes longer than its length
_DOTTED = re.compile(rf"(?<![\w-])(?:(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')\s*+\.\s*+){{{DEEPEST},}}")


def parsed(text: str) -> dict[str, Any]:
    """Content of a TOML text.

    A key `a.a.a…` of 50 000 names takes Python's parser gigabytes, so it is refused before.

    Raises
    ------
    ValueError : not TOML, or keys or values nested too deeply
    """
    if found := _DOTTED.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise ValueError(f"line {line}: a key of more than {DEEPEST} names")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("values nested too deeply") from None
