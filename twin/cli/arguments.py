"""From arguments to a verb's settings; the flags are derived from the settings classes (tyro)."""

import ast
import contextlib
import inspect
import io
import math
import re
import textwrap
from collections.abc import Callable
from dataclasses import MISSING, field, fields, make_dataclass
from difflib import get_close_matches
from functools import cache
from importlib.metadata import version
from itertools import pairwise
from typing import Annotated, Any, get_args, get_origin

import tyro

from analysis.units import is_number
from twin.config.base import Settings, hints
from twin.config.types import FLAG, POSITIONAL, REPEATABLE, Flag, Overrides, Range
from twin.config.verbs import BY_NAME, VERBS, Verb
from twin.errors import TwinError

DESCRIPTION = "Digital twin of a thrust-vector-control gimbal and its vehicle."
GROUPS = ("common", "table", "rig", "model", "time")  # the verb's own come after the common ones
TYRO = {
    POSITIONAL: tyro.conf.Positional,
    REPEATABLE: tyro.conf.UseAppendAction,
    FLAG: tyro.conf.FlagCreatePairsOff,
}
ELSEWHERE = {  # options that are expected where there is none
    "--minimal": "only for calibrate and rig; other runs read it from --calibration",
    "--potentiometer-deg": "only for calibrate and rig; other runs read it from --calibration",
    "--baud": "the line is fixed at 500000 baud",
}
_NUMERIC = re.compile(r"\b(int|float)\b")
MISTAKE = 2  # tyro's exit code for arguments that it cannot use
CONFIG = (
    tyro.conf.OmitArgPrefixes,
    tyro.conf.DisallowNone,
    tyro.conf.HelptextFromCommentsOff,  # else tyro parses the source of every class
)
# tyro's messages, and the same in the words of this program
PLAINER: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (
        r"no type matching \{?FLOAT(?: FLOAT)+\}? could be instantiated from \[(.*?)\]\.?",
        r"\1: must be as many numbers as the help shows",
    ),
    (r"no type matching FLOAT could be instantiated from \['(.*?)'\]\.?", r"'\1' is not a number"),
    (
        r"--unit: no type matching INT could be instantiated from \['(.*?)'\]\.?",
        r"--unit \1: must be the number of a simulated rig; columns have --angle-unit",
    ),
    (
        r"no type matching INT could be instantiated from \['(.*?)'\]\.?",
        r"'\1' is not a whole number",
    ),
    (r"\[INT\]: ('.*?') is not a whole number", r"\1: must be a whole number"),  # not named
    (r"could not convert string to float: '(.*?)'", r"'\1' is not a number"),
    (r"invalid literal for int\(\) with base 10: '(.*?)'", r"'\1' is not a whole number"),
    (r"Missing value for argument '(.*?)'\. Expected 1 values\.", r"\1: its value is missing"),
    (r"Missing value for argument '(.*?)'\. Expected (\d+) values\.", r"\1: \2 values are needed"),
    (
        r"Could not (?:parse arguments|find valid parse for arguments:) \[(.*?)\].*",
        r"\1: not understood",
    ),
    (
        r"invalid choice '(.*?)' for argument '(?:\w+\.)?(.*?)'\. Expected one of \((.*?)\)\.?",
        r"\2 \1: must be one of \3",
    ),
    (
        r"Missing from (twin [\w-]+): \{([\w,]+)\}.*",
        lambda missing: f"{missing[1]} needs one of {missing[2].replace(',', ', ')}",
    ),
    (r"Missing from (twin [\w-]+): [A-Z]+ (.*?)\.? \(required\).*", r"\1 needs an argument: \2"),
)


def parse(arguments: list[str]) -> tuple[Verb, Settings]:
    """Return the verb that the arguments name, and its settings.

    Raises
    ------
    TwinError : in one line, what was wrong and where the help is
    SystemExit : help was asked for and printed
    """
    if arguments and not arguments[0].startswith("-"):
        if arguments[0] not in BY_NAME:
            near = get_close_matches(arguments[0], BY_NAME, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(BY_NAME)}"
            raise TwinError(f"no verb {arguments[0]!r}; {hint}")
        verb = BY_NAME[arguments[0]]
        grouped = _grouped(verb.settings)  # type: ignore[arg-type]  # a class has a hash
        name = verb.name
        if "action" in hints(verb.settings) and not {"-h", "--help"}.isdisjoint(arguments):
            name += "".join(f" {word}" for word in arguments[1:2] if not word.startswith("-"))
        _check_paths(verb.settings, arguments)
        _check_words(verb.settings, arguments[1:])
        given = _parsed(grouped, verb.settings.__doc__, name, arguments[1:])
        flat = {k: v for group in vars(given).values() for k, v in vars(group).items()}
        return verb, verb.settings.of(flat)
    if arguments == ["--version"]:
        print(f"tvc-twin {version('tvc-twin')}")
        raise SystemExit(0)
    print(_overview())
    raise SystemExit(0 if arguments and arguments[0] in ("-h", "--help") else 2)


def _check_paths(kind: type[Settings], arguments: list[str]) -> None:
    """Refuse empty paths, which would be taken for the folder of this process."""
    files = [n for n, hint in hints(kind).items() if "Path" in str(hint)]
    flags = {f"--{name.rstrip('_').replace('_', '-')}" for name in files}
    takes = any(POSITIONAL in getattr(hints(kind)[name], "__metadata__", ()) for name in files)
    words = [w for a in arguments for w in (a.split("=", 1) if a.startswith("--") else (a,))]
    for before, value in pairwise(words):
        if value:
            continue
        if before in flags:
            raise TwinError(f"{before} '': must be a path; leave it out for the default")
        if takes and not before.startswith("--"):
            raise TwinError("'': must be a path, and is empty")


def _check_words(kind: type[Settings], arguments: list[str]) -> None:
    """Refuse options given twice, of which one would be lost, and numbers as Python writes them."""
    options = {f"--{n.rstrip('_').replace('_', '-')}": hint for n, hint in hints(kind).items()}
    seen: set[str] = set()
    flag, left = "", 0.0  # numbers that the option still takes; what follows them is positional
    for argument in arguments:
        word = argument
        if argument.startswith("--"):
            flag, equals, word = argument.partition("=")
            flag = flag.replace("_", "-")
            hint = options.get(flag)
            if flag in seen and hint not in (None, Flag, bool):
                raise TwinError(f"{flag}: given twice; give it once")
            if REPEATABLE not in getattr(hint, "__metadata__", ()):
                seen.add(flag)
            left = _numbers_of(hint)
            if not equals:
                continue
        if left > 0 and _is_foreign(word):
            raise TwinError(f"{flag} {word}: must be a number of the digits 0 to 9")
        left -= 1


def _numbers_of(hint: Any) -> float:  # noqa: ANN401  a type
    """How many numbers an option takes; 0 of all others."""
    if hint is None or hint == Overrides:
        return 0
    count = len(_NUMERIC.findall(str(hint)))
    return math.inf if count and "..." in str(hint) else count


def _is_foreign(word: str) -> bool:
    """Whether Python reads a number that nobody else does."""
    try:
        float(word)
    except ValueError:
        return False
    return not is_number(word)


def _suggested(advice: str, kind: type[Settings]) -> str:
    """The message about an unknown option, with the nearest option there is."""
    unknown = re.match(r"Unrecognized options: (--[\w-]+)", advice)
    if unknown is None:
        return advice
    if unknown[1] in ELSEWHERE:
        return f"unknown option {unknown[1]}: {ELSEWHERE[unknown[1]]}"
    names = [name.rstrip("_").replace("_", "-") for name in hints(kind)]
    typed = unknown[1].removeprefix("--")
    close = get_close_matches(typed, names, n=2) or [n for n in names if n.startswith(typed)]
    near = [f"--{name}" for name in close]
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    return f"unknown option {unknown[1]}{hint}"


def _overview() -> str:
    width = 2 + max(len(verb.name) for verb in VERBS)
    lines = [f"usage: twin VERB [OPTIONS]\n\n{DESCRIPTION}\n"]
    lines += [f"  {v.name:<{width}}{_first_line(v.settings)}" for v in VERBS]
    more = "`twin VERB --help` lists the options of a verb; `twin --version` prints the version."
    return "\n".join([*lines, f"\n{more}"])


def _first_line(kind: type[Settings]) -> str:
    return (kind.__doc__ or "").strip().partition("\n")[0]


def _parsed(kind: type, description: str | None, name: str, arguments: list[str]) -> Any:  # noqa: ANN401
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(
                kind,
                prog=f"twin {name}",
                description=description,
                args=arguments,
                config=CONFIG,
            )
    except SystemExit as end:
        if end.code != MISTAKE:  # help was printed, or a signal ends the process
            raise
        advice = _suggested(_advice(box.getvalue()), BY_NAME[name.partition(" ")[0]].settings)
        raise TwinError(f"{advice} (`twin {name} --help` lists the options)") from None


@cache
def _grouped(kind: type[Settings]) -> type:
    """A dataclass of dataclasses, one a group: tyro prints each under its own heading."""
    groups: dict[str, list[tuple[str, Any, Any]]] = {}
    for f in fields(kind):
        group, help_text = described(kind, f.name)
        help_text = help_text.replace("VERB", kind.__name__.lower())
        hint, default = _for_tyro(hints(kind)[f.name], f.default)
        # a name that Python reserves ends with an underscore, its flag does not
        flag = f.name.rstrip("_").replace("_", "-") if f.name.endswith("_") else None
        hint_text = _behaviour(f.default)
        argument = tyro.conf.arg(name=flag, help=help_text, help_behavior_hint=hint_text)
        marked = Annotated[hint, argument]  # type: ignore[valid-type]
        entry = field() if default is MISSING else field(default=default)
        groups.setdefault(group, []).append((f.name, marked, entry))
    own = [g for g in groups if g not in GROUPS]
    order = [g for g in ("common", *own, *GROUPS[1:]) if g in groups]
    made = {g: make_dataclass(g, groups[g], frozen=True, kw_only=True) for g in order}
    entries = []
    for g in order:
        made[g].__doc__ = None
        required = any(e.default is MISSING for _, _, e in groups[g])
        entry = field() if required else field(default_factory=made[g])
        entries.append((g, made[g], entry))
    return make_dataclass(kind.__name__, entries, frozen=True, kw_only=True)


def _for_tyro(hint: Any, default: Any) -> tuple[Any, Any]:  # noqa: ANN401
    """An annotation in tyro's markers, without the limits that the settings check themselves."""
    if hint == Overrides:
        return tyro.conf.UseAppendAction[tuple[str, ...]], ()
    if get_origin(hint) is not Annotated:
        return hint, default
    inner, *markers = get_args(hint)
    of_tyro = tuple(TYRO[m] for m in markers if not isinstance(m, Range))
    return (Annotated.__class_getitem__((inner, *of_tyro)) if of_tyro else inner), default


def _behaviour(default: object) -> str:
    """What follows the text: the default, where the text does not say what happens without it."""
    if default is MISSING:
        return ""
    if default is None or default is False or default == ():
        return ""
    shown = " ".join(map(str, default)) if isinstance(default, tuple) else str(default)
    return f"(default: {shown})"


def described(kind: type[Settings], name: str) -> tuple[str, str]:
    """Heading and text of a setting: of the first class of its family, and of the latest text."""
    owners = [(c, texts[name]) for c in kind.__mro__ if name in (texts := _texts(c))]
    family: type[Settings] = owners[-1][0]
    return family.group, owners[0][1]


@cache
def _texts(owner: type) -> dict[str, str]:
    """The text under each setting of a class, from its source; none for other classes."""
    if not issubclass(owner, Settings):
        return {}
    body = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0]
    assert isinstance(body, ast.ClassDef)
    texts = {}
    for entry, after in zip(body.body, body.body[1:], strict=False):
        if isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name):
            value = after.value if isinstance(after, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                texts[entry.target.id] = " ".join(value.value.split())
    return texts


def _advice(box: str) -> str:
    """The text under the title of a box that tyro prints, in Unicode or in ASCII, on one line."""
    paragraphs: list[list[str]] = [[]]
    for line in box.splitlines():
        text = line.strip("│| ")
        if text.startswith(("╭", "╰")) or not text.strip("─-"):
            paragraphs.append([])
        else:
            paragraphs[-1].append(text)
    first = next((p for p in paragraphs[1:] if p), ["the arguments were not understood"])
    text = " ".join(first).removeprefix("Error parsing ")
    for pattern, plain in PLAINER:
        text = re.sub(pattern, plain, text)
    return re.sub(r"'None', |, 'None'", "", text)
