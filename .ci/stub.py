"""Writes twin/__init__.pyi, the typed signatures of the verbs, from their settings.

python .ci/stub.py          write it
python .ci/stub.py --check  exit 1 where it is out of date
"""

import ast
import inspect
import re
import sys
import types
from pathlib import Path
from typing import Any

from twin.cli.python import signature
from twin.config.verbs import VERBS

STUB = Path(__file__).resolve().parents[1] / "twin" / "__init__.pyi"
HEAD = """# Written by .ci/stub.py from the settings of the verbs; do not edit.
from os import PathLike
from typing import Any, Literal

from analysis.recording import Recording
from analysis.schema import AnalysisError as AnalysisError
from hardware.frames import HardwareError as HardwareError
from twin.errors import DivergenceError as DivergenceError
from twin.errors import TwinError as TwinError
"""
FILE = "str | PathLike[str]"


def main() -> int:
    """Write or check the stub."""
    text = written()
    if "--check" in sys.argv:
        old = STUB.read_text(encoding="utf-8") != text
        print(
            f"{STUB.name}: out of date; run python .ci/stub.py"
            if old
            else f"{STUB.name}: up to date"
        )
        return int(old)
    STUB.write_text(text, encoding="utf-8")
    return 0


def written() -> str:
    """The stub's text."""
    results: dict[str, str] = {}
    functions = []
    for verb in sorted(VERBS, key=lambda v: v.name):
        returns = inspect.signature(verb.function).return_annotation
        names = re.findall(r"[A-Za-z]+", inspect.formatannotation(returns))
        module = inspect.getmodule(verb.function)
        kinds = [n for n in names if n.endswith("Result")]
        results |= {n: _home(module, n) for n in kinds}
        functions.append(_function(verb.name, verb, " | ".join(kinds) or str(_simple(returns))))
    imports = "".join(
        f"from {m} import {n}\n" for n, m in sorted(results.items(), key=lambda r: r[::-1])
    )
    others = f"\ndef read(path: {FILE}) -> Recording: ...\ndef load(path: {FILE}) -> Any: ...\n"
    return HEAD + imports + "\n" + "".join(functions) + others


def _home(module: Any, name: str) -> str:  # noqa: ANN401  a module
    """The module that defines a name which a module uses, perhaps only for type checkers."""
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and name in (a.name for a in node.names):
            return str(node.module)
    return str(module.__name__)


def _simple(annotation: Any) -> str:  # noqa: ANN401  a type
    return "None" if annotation is None else inspect.formatannotation(annotation)


def _function(name: str, verb: Any, returns: str) -> str:  # noqa: ANN401  twin.config.verbs.Verb
    lines = []
    starred = False
    for p in signature(verb).parameters.values():
        kind = _type(p.annotation)
        if p.name == "set":
            kind = "dict[str, float] | tuple[str, ...]"
        if p.name == "controller":
            kind = "object"
        if p.kind is not p.KEYWORD_ONLY:
            many = kind.startswith("tuple")
            lines.append(f"    *{p.name}: {FILE}," if many else f"    {p.name}: {kind},")
            starred = many
            continue
        if not starred:
            lines.append("    *,")
            starred = True
        default = "" if p.default is p.empty else " = ..."
        lines.append(f"    {p.name}: {kind}{default},")
    body = "\n".join(lines)
    return f"def {name}(\n{body}\n) -> {returns}: ...\n"


def _type(annotation: Any) -> str:  # noqa: ANN401  a type
    text = inspect.formatannotation(annotation)
    text = text.replace("pathlib.Path", FILE).replace("typing.", "")
    if isinstance(annotation, types.UnionType) or "Optional" in text:
        text = re.sub(r"Optional\[(.*)\]", r"\1 | None", text)
    return text.replace(FILE + ", ...", FILE + ", ...")


if __name__ == "__main__":
    sys.exit(main())
