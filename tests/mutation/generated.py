"""Mutants made by rule: another operator, sign, constant or comparison, a few for each file."""

import ast
import random
import re
from collections.abc import Iterator
from pathlib import Path

from tests.mutation.runner import ROOT, Mutant, compiles

SEED = 9
Edit = tuple[int, str, str]  # character, text there, what replaces it

ARITHMETIC = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
}  # fmt: skip
COMPARED = {
    ast.Lt: ("<", ">="), ast.Gt: (">", "<="), ast.LtE: ("<=", ">"), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
}  # fmt: skip
CALLED = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "any": "all", "all": "any"}
VIEWS = ("floats", "integers", "characters")  # of twin/physics/native/layout.py
C_OPERATORS = re.compile(r" (\+|-|<|>|<=|>=|==|!=|&&|\|\||\*|&|\|) (?=[\w(!])")
C_OTHER = {
    "+": "-", "-": "+", "<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&", "*": "/", "&": "|", "|": "&",
}  # fmt: skip


def mutants(file: str, tests: tuple[str, ...], count: int) -> list[Mutant]:
    """A fixed random choice of mutants of one file."""
    text = (ROOT / file).read_text()
    edits = sorted(set(_c_edits(text) if file.endswith(".cpp") else _edits(text)))
    random.Random(f"{SEED} {file}").shuffle(edits)
    chosen: list[Mutant] = []
    for at, before, after in edits:
        if len(chosen) == count:
            break
        line = text.count("\n", 0, at) + 1
        name = f"{file}:{line} {before} → {after}"
        mutant = Mutant(name, file, before, after, tests, at)
        if not file.endswith(".cpp") or compiles((ROOT / file).parent, mutant.applied(text)):
            chosen.append(mutant)
    return chosen


def _edits(text: str) -> Iterator[Edit]:
    lines = [0]
    for line in text.splitlines(keepends=True):
        lines.append(lines[-1] + len(line.encode()))
    data = text.encode()

    def place(row: int, column: int) -> int:
        return len(data[: lines[row - 1] + column].decode())

    def span(node: ast.expr) -> tuple[int, int]:
        end_row, end_column = node.end_lineno or 0, node.end_col_offset or 0
        return place(node.lineno, node.col_offset), place(end_row, end_column)

    def between(left: ast.expr, right: ast.expr, pair: tuple[str, str]) -> Iterator[Edit]:
        begin, end = span(left)[1], span(right)[0]
        at = text.find(pair[0], begin, end)
        if at >= 0:
            yield at, pair[0], pair[1]

    for node in _meant(ast.parse(text)):
        if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            yield from between(node.left, node.right, ARITHMETIC[type(node.op)])
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARED:
            yield from between(node.left, node.comparators[0], COMPARED[type(node.ops[0])])
        elif isinstance(node, ast.BoolOp):
            pair = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            yield from between(node.values[0], node.values[1], pair)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield span(node)[0], "-", ""
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield span(node)[0], "not ", ""
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            begin, end = span(node)
            yield begin, text[begin:end], _other(node.value)
        elif isinstance(node, ast.Call):
            begin, end = span(node.func)
            name = text[begin:end].rpartition(".")[2]
            if name in CALLED:
                yield end - len(name), name, CALLED[name]


def _other(value: float) -> str:
    if isinstance(value, int):
        return str(value + 1)
    return repr(value * 1.3) if value else "1.0"


def _meant(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes that compute: no annotations, no messages of errors, no sizes of dataclasses' slots.

    Nor the length of a view of MuJoCo's arrays: a longer one holds the same values.
    """
    children = list(ast.iter_child_nodes(tree))
    if isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name) and tree.func.id in VIEWS:
        children.pop()
    for node in children:
        if isinstance(node, (ast.Raise, ast.JoinedStr, ast.Assert)):
            continue
        if isinstance(node, ast.AnnAssign):
            if node.value is not None:
                yield node.value
                yield from _meant(node.value)
            continue
        if isinstance(node, ast.arguments):
            continue
        if isinstance(node, ast.FunctionDef):
            for inner in node.body:
                yield from _meant(inner)
            continue
        yield node
        yield from _meant(node)


def _c_edits(text: str) -> Iterator[Edit]:
    begin = 0
    for line in text.splitlines(keepends=True):
        code = line.partition("//")[0]
        if not code.lstrip().startswith("#") and "static_assert" not in code:
            for match in C_OPERATORS.finditer(code):
                operator = match[1]
                yield begin + match.start(1), operator, C_OTHER[operator]
        begin += len(line)


def files(folder: str) -> list[Path]:
    """Python files of a folder that compute something."""
    return sorted(p for p in (ROOT / folder).rglob("*.py") if p.name != "__init__.py")
