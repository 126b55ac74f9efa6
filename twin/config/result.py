"""Base of every verb's result: numbers for machines, rows for people."""

import html

from analysis.signs import unsigned_zeros

Rows = list[tuple[str, str]]
NARROWEST = 18  # characters of the first column
FILES = ("file", "replayed", "recording", "page")  # attributes that name what was written


class Result:
    """What a verb returns; subclasses are frozen dataclasses."""

    @property
    def passed(self) -> bool:
        """Whether every check that was asked for passed."""
        return True

    @property
    def status(self) -> int:
        """Exit code: 0 where every check passed, 1 otherwise."""
        return 0 if self.passed else 1

    def as_dict(self) -> dict[str, object]:
        """The result as JSON values, in SI units unless a name gives another."""
        raise NotImplementedError

    def rows(self) -> Rows:
        """The result as a table of two columns; a row with an empty name continues the last."""
        raise NotImplementedError

    def __fspath__(self) -> str:
        """The file that was written, so that a result can be given wherever a file is expected.

        Raises
        ------
        TypeError : a result without a file
        """
        for name in FILES:
            if hasattr(self, name):
                return str(getattr(self, name))
        raise TypeError(f"{type(self).__name__}: has no file that it could stand for")

    def text(self) -> str:
        """The table as aligned lines."""
        rows = self.rows()
        width = max(NARROWEST, 2 + max((len(name) for name, _ in rows), default=0))
        return unsigned_zeros("\n".join(f"{name:<{width}}{value}".rstrip() for name, value in rows))

    def __str__(self) -> str:
        """The table as aligned lines."""
        return self.text()

    def _repr_html_(self) -> str:
        """The table in a notebook."""
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left'><pre style='margin:0'>{html.escape(value)}</pre></td>"
            "</tr>"
            for name, value in ((n, unsigned_zeros(v)) for n, v in self.rows())
        )
        return f"<table>{cells}</table>"
