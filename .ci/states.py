"""Writes the state diagrams of docs/states.md from the transition tables of the code.

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
    new = BLOCK.sub(lambda m: f"{m[1]}{diagram(table(m[2]))}{m[3]}", text)
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


def diagram(transitions: Table) -> str:
    """A table as a Mermaid state diagram; the first member of the states is the initial one."""
    states = list(type(next(iter(transitions.values()))))
    arrows: dict[tuple[StrEnum, StrEnum], list[StrEnum]] = {}
    for (old, sign), new in transitions.items():
        arrows.setdefault((old, new), []).append(sign)
    order = sorted(arrows, key=lambda a: (states.index(a[0]), states.index(a[1])))
    lines = ["stateDiagram-v2", f"    [*] --> {states[0]}"]
    lines += [f"    {old} --> {new}: {' or '.join(arrows[old, new])}" for old, new in order]
    return "```mermaid\n" + "\n".join(lines) + "\n```\n"


if __name__ == "__main__":
    sys.exit(main())
