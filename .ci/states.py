"""Writes the tables of transitions in docs/states.md from the transition tables of the code.

python .ci/states.py          write them
python .ci/states.py --check  exit 1 where they are out of date
"""

import re
import sys
from collections.abc import Mapping
from enum import StrEnum
from importlib import import_module

from source_names import ROOT

PAGE = ROOT / "docs" / "states.md"
PACKAGES = ("hardware", "analysis", "twin")
BLOCK = re.compile(r"(<!-- states: ([\w.]+) -->\n).*?(<!-- /states -->)", re.DOTALL)

Table = Mapping[tuple[StrEnum, StrEnum], StrEnum]


def main() -> int:
    """Write or check the page; a table without a place in it is an error."""
    text = PAGE.read_text(encoding="utf-8")
    missing = sorted(tables() - {module for _, module, _ in BLOCK.findall(text)})
    if missing:
        print(f"docs/states.md has no block for {', '.join(missing)}")
        return 1
    new = BLOCK.sub(lambda m: f"{m[1]}\n{rows(table(m[2]))}\n{m[3]}", text)
    if "--check" in sys.argv:
        if new != text:
            print("docs/states.md is out of date; run `python .ci/states.py`")
        return int(new != text)
    PAGE.write_text(new, encoding="utf-8")
    return 0


def tables() -> set[str]:
    """Modules that define a table `TRANSITIONS`."""
    files = (f for package in PACKAGES for f in (ROOT / package).rglob("*.py"))
    return {
        ".".join(f.relative_to(ROOT).with_suffix("").parts)
        for f in files
        if re.search(r"^TRANSITIONS\b.*=", f.read_text(encoding="utf-8"), re.MULTILINE)
    }


def table(module: str) -> Table:
    """The transition table of a module."""
    transitions: Table = import_module(module).TRANSITIONS
    return transitions


def rows(transitions: Table) -> str:
    """A table in Markdown: a row for each state, a column for each sign."""
    states, signs = (list(type(member)) for member in next(iter(transitions)))
    lines = [["state", *signs], ["---"] * (len(signs) + 1)]
    lines += [[old, *(transitions.get((old, sign), "") for sign in signs)] for old in states]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
