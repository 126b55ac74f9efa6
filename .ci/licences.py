"""Writes docs/licences.md: every package that the project needs, with the licence it declares.

Read from the metadata of the installed packages, so run it in an environment from the lock.
"""

import re
import tomllib
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

REPOSITORY = Path(__file__).resolve().parents[1]
PAGE = REPOSITORY / "docs" / "licences.md"
ROOT = "tvc-twin"
EXTRAS = ("", "report", "sysid", "gym", "notebook", "pi", "cluster")
HEAD = """# Licences of the dependencies

The project itself is under the [MIT licence](../LICENSE), but for `hardware/simavr/shim.c`
([notice](../hardware/simavr/NOTICE.md)). None of these packages is part of it: pip installs
them beside it. Written by `python .ci/licences.py` from what each package declares; extras that
were not installed then are marked.

| package | licence it declares | needed by |
|---|---|---|
"""


def main() -> None:
    """Write the page."""
    rows: dict[str, tuple[str, str]] = {}
    for extra in EXTRAS:
        for name in sorted(needed(ROOT, extra)):
            if name not in rows:
                rows[name] = (licence(name), f"extra `{extra}`" if extra else "all")
    del rows[ROOT]
    text = "".join(f"| {name} | {kind} | {of} |\n" for name, (kind, of) in sorted(rows.items()))
    PAGE.write_text(HEAD + text, encoding="utf-8")


def needed(name: str, extra: str = "", seen: set[tuple[str, str]] | None = None) -> set[str]:
    """Names of a package and of everything that it needs here."""
    seen = set() if seen is None else seen
    if (name, extra) in seen:
        return set()
    seen.add((name, extra))
    found = {name}
    for requirement in requirements(name, extra):
        for inner in ("", *requirement.extras):
            found |= needed(canonical(requirement.name), inner, seen)
    return found


def requirements(name: str, extra: str) -> Iterator[Requirement]:
    """What a package needs on this system, with an extra."""
    for text in declared(name, extra):
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            yield requirement


def declared(name: str, extra: str) -> list[str]:
    """What a package lists; the project itself in its pyproject.toml."""
    if name != ROOT:
        package = installed(name)
        return list((package.requires if package else None) or ())
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    return list(project["optional-dependencies"][extra] if extra else project["dependencies"])


def installed(name: str) -> Distribution | None:
    """A package of this environment."""
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def canonical(name: str) -> str:
    """A package's name as the index has it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licence(name: str) -> str:
    """What a package declares: the expression, its classifiers, or the first line of the text."""
    package = installed(name)
    if package is None:
        return "(not installed when this was written)"
    metadata = package.metadata
    classified = [
        c.rpartition(" :: ")[2]
        for c in metadata.get_all("Classifier") or ()
        if c.startswith("License ::") and not c.endswith("OSI Approved")
    ]
    text = (metadata.get("License") or "").strip()
    first = text.splitlines()[0] if text else ""
    return metadata.get("License-Expression") or ", ".join(classified) or first or "not declared"


if __name__ == "__main__":
    main()
