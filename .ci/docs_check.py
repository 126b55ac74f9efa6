"""Checks the documentation against the project: links, commands, files and names.

Whatever stands in code quotes must exist: files and folders, modules and names in them, flags,
signals, make targets. Commands must be ones that the settings of their verb accept.
"""

import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path
from typing import get_args, get_origin

from source_names import FOLDERS, PACKAGES, ROOT, exists, imports, words

from analysis.schema import SIGNALS
from twin.config.base import hints
from twin.config.types import FLAG, POSITIONAL, Overrides
from twin.config.verbs import BY_NAME, VERBS, Verb
from twin.errors import TwinError

PAGES = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    ROOT / "hardware" / "simavr" / "NOTICE.md",
    *sorted((ROOT / "docs").rglob("*.md")),
)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)[^)]*\)")
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"(?:^|(?<=\n\n))((?:    .*\n)+)")
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
EXAMPLES = re.compile(r"<!-- examples: (.*) -->")  # names of a page that need not exist
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
COMMAND = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?(twin [a-z]+[^#|>\n]*)", re.MULTILINE)
TARGET = re.compile(r"\bmake ((?:[a-z-]+ ?)+)")
MODULE = re.compile(r"python3? -m ([\w.]+)")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?:\(.*\))?$")
SHELL = ("sh", "bash", "console")
# flags of other programs that the documentation names
FOREIGN = {
    "--flag",
    "--help",
    "--mjcf",
    "--version",
    "--unordered",
    "--ignore-timeline",
    "--check",
    "--bind",
    "--key-file",
    "--first",
    "--only",
    "--quick",
}
FOREIGN_NAMES = {"Batch", "analogWrite", "cyclictest", "eval", "fork", "multiprocessing", "tone"}
SIGNAL_ROOTS = {name.partition("/")[0] for name in SIGNALS}
FILE_SUFFIXES = {".rrd", ".json", ".html", ".eng", ".xml", ".csv", ".py", ".stl", ".partial"}


def main() -> int:
    """Print what is wrong; the exit code is 1 where something is."""
    wrong = [
        f"{page.relative_to(ROOT)}: {fault}"
        for page in PAGES
        if page.exists()
        for fault in dict.fromkeys(faults(page))
    ]
    page = ROOT / "docs" / "architecture.md"
    wrong += [f"docs/architecture.md does not list {name}" for name in unlisted(page.read_text())]
    print("\n".join(wrong) or f"{len(PAGES)} pages: links, commands, files and names exist")
    return int(bool(wrong))


def unlisted(architecture: str) -> list[str]:
    """Folders of the packages that the page on the architecture does not list."""
    packages = (ROOT / name for name in ("twin", "hardware", "analysis"))
    folders = (f.parent for package in packages for f in package.glob("*/__init__.py"))
    names = (str(f.relative_to(ROOT)) + "/" for f in folders)
    return sorted(name for name in names if f"`{name}`" not in architecture)


def faults(page: Path) -> Iterator[str]:
    """What a page names that does not exist."""
    text = page.read_text(encoding="utf-8")
    for examples in EXAMPLES.findall(text):
        for name in examples.split(", "):
            text = text.replace(f"`{name}`", "")
    yield from dead_links(page, text)
    yield from wrong_commands(text)
    if page.name == "CHANGELOG.md":  # it may name what has gone
        return
    for kind, code in FENCE.findall(text):
        if kind == "python":
            yield from (f"no {name}" for name in imports(code) if not exists(name))
    prose = FENCE.sub("", text)
    for token in CODE.findall(prose):
        yield from wrong_token(token.strip())


def dead_links(page: Path, text: str) -> Iterator[str]:
    """Link targets that are not files of the project, or not headings in them."""
    for link in LINK.findall(FENCE.sub("", text)):
        if "://" in link or link.startswith("mailto:"):
            continue
        target, _, anchor = link.partition("#")
        file = page.parent / target if target else page
        if not file.exists():
            yield f"dead link {link}"
        elif anchor and anchor not in _anchors(file):
            yield f"link {link}: {file.name} has no such heading"


def _anchors(file: Path) -> set[str]:
    """Headings of a page as GitHub links to them."""
    titles = HEADING.findall(FENCE.sub("", file.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w\- ]", "", t.lower()).strip().replace(" ", "-") for t in titles}


def wrong_commands(text: str) -> Iterator[str]:
    """Commands that the program refuses: whole ones of blocks, verbs and flags of quoted ones."""
    blocks = [code for kind, code in FENCE.findall(text) if kind in SHELL]
    blocks += INDENTED.findall(text)
    for command in dict.fromkeys(c.strip() for block in blocks for c in COMMAND.findall(block)):
        if fault := refusal(command):
            yield f"{command!r}: {fault}"
    for token in CODE.findall(FENCE.sub("", text)):
        for command in COMMAND.findall(token):
            verb = command.split()[1]
            known = verb in BY_NAME
            flags = _flags_of(BY_NAME[verb]) | FOREIGN if known else set()
            yield from [] if known else [f"no verb {verb!r}"]
            yield from (f"{command!r}: no {f}" for f in OPTION.findall(command) if f not in flags)


def refusal(command: str) -> str | None:
    """Why the settings of a verb refuse a command; None where they take it."""
    verb, *rest = shlex.split(command.replace("...", ""))[1:]
    if verb not in BY_NAME:
        return f"no verb {verb!r}"
    known = hints(BY_NAME[verb].settings)
    given: dict[str, list[str]] = {}
    places = [n for n, h in known.items() if _marked(h, POSITIONAL)]
    name = files = next(iter(places), "")
    for word in rest:
        if word.startswith("--"):
            name = word[2:].replace("-", "_")
            name = name if name in known else f"{name}_"  # a name that Python reserves
            given.setdefault(name, [])
        else:
            given.setdefault(name, []).append(word)
            if name in places[:-1] and get_origin(get_args(known[name])[0]) is not tuple:
                name = places[places.index(name) + 1]
        if _marked(known.get(name), FLAG):  # it takes no value
            name = files
    values = {n: _value(v, known.get(n)) for n, v in given.items() if n != "help"}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("set.json").write_text("{}", encoding="utf-8")
        try:
            BY_NAME[verb].settings.of(values)
        except (TwinError, TypeError) as error:  # the second: a file is missing
            return str(error)
    return None


def _marked(hint: object, marker: object) -> bool:
    return marker in getattr(hint, "__metadata__", ())


def _value(words: list[str], hint: object) -> object:
    """The values of a flag as Python would give them."""
    if not words:
        return True
    numbers = "float" in str(hint) or "int" in str(hint)
    if not numbers or hint == Overrides:
        return words if "tuple" in str(hint) else words[0]
    values = [int(w) if w.lstrip("-").isdigit() else _float(w) for w in words]
    return values if len(values) > 1 else values[0]


def _float(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


def wrong_token(token: str) -> Iterator[str]:
    """What a piece of code in a sentence names that does not exist."""
    for match in TARGET.findall(token if token.startswith("make") else ""):
        yield from (f"no make target {t}" for t in match.split() if t not in _targets())
    for module in MODULE.findall(token):
        if module.partition(".")[0] in PACKAGES and not exists(module):
            yield f"no module {module}"
    if not COMMAND.match(token):  # those are checked against their verb
        yield from (f"no flag {f}" for f in OPTION.findall(token) if f not in _flags() | FOREIGN)
    for applies, check in KINDS:
        if applies(token):
            if not check(token):
                yield f"no `{token}`"
            return


def _targets() -> set[str]:
    return set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def _flags() -> set[str]:
    return {flag for verb in VERBS for flag in _flags_of(verb)}


def _flags_of(verb: Verb) -> set[str]:
    return {"--" + name.rstrip("_").replace("_", "-") for name in hints(verb.settings)}


def _is_path(token: str) -> bool:
    return token.partition("/")[0] in FOLDERS and "/" in token and not re.search(r"[\s<>]", token)


def _path_exists(token: str) -> bool:
    path = token.partition(":")[0].rstrip("/")
    return any(ROOT.glob(path)) if "*" in path else (ROOT / path).exists()


def _is_dotted(token: str) -> bool:
    return bool(NAME.match(token)) and "." in token and token.partition(".")[0] in PACKAGES


def _is_signal(token: str) -> bool:
    root, slash, _ = token.removeprefix("/").partition("/")
    return bool(slash) and root in SIGNAL_ROOTS


def _signal_exists(token: str) -> bool:
    name = token.removeprefix("/").rstrip("*…/")
    return any(s == name or s.startswith(name) for s in SIGNALS)


def _is_name(token: str) -> bool:
    return bool(NAME.match(token)) and Path(token).suffix not in FILE_SUFFIXES


def _name_exists(token: str) -> bool:
    names = re.findall(r"\w+", token.partition("(")[0])
    return all(_is_word(name) or name in FOREIGN_NAMES for name in names)


def _is_word(name: str) -> bool:
    if name.startswith("_"):  # the end of a name whose beginning stands before it
        return any(word.endswith(name) for word in words())
    # a scene attaches the mechanism under the prefix
    return name in words() or name == "gimbal_" or name.removeprefix("gimbal_") in words()


Check = Callable[[str], bool]
KINDS: tuple[tuple[Check, Check], ...] = (
    (_is_path, _path_exists),
    (_is_signal, _signal_exists),
    (_is_dotted, exists),
    (_is_name, _name_exists),
)

if __name__ == "__main__":
    sys.exit(main())
