"""Signs of printed numbers."""

import re

# a minus before nothing but zeros, not the hyphen of a name, an exponent or a path
_NEGATIVE_ZERO = re.compile(r"(?<![\w.)/\-\u2212])[-\u2212](0+(?:\.0+)?)(?!\d|\.\w|\w*[\d/])")


def unsigned_zeros(text: str) -> str:
    """A text whose numbers that are rounded to zero have no sign: -0.004 as `%.2f` is `0.00`."""
    return _NEGATIVE_ZERO.sub(r"\1", text)
