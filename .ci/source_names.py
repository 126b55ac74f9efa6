"""Names of the project, read from its sources without importing them."""

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("twin", "hardware", "analysis", "meshes", "mjcf", "tests")
FOLDERS = (*PACKAGES, "docs", ".ci", ".github")
SOURCES = (".py", ".pyi", ".xml", ".cpp", ".h", ".c", ".ino", ".js", ".toml", ".json")
CALL = re.compile(r"\([^()]*\)")

Tree = ast.Module | ast.ClassDef


@functools.cache
def words() -> frozenset[str]:
    """Every identifier of the product's sources, definitions of the tests, names of all files."""
    files = [f for folder in FOLDERS for f in (ROOT / folder).rglob("*") if f.suffix in SOURCES]
    found = {part for f in files for part in re.findall(r"\w+", str(f.relative_to(ROOT)))}
    for file in (*files, ROOT / "pyproject.toml", ROOT / "Makefile"):
        tests = file.relative_to(ROOT).parts[0] == "tests"
        pattern = r"\b(?:def|class) (\w+)" if tests else r"\w+"
        found.update(re.findall(pattern, file.read_text(encoding="utf-8")))
    return frozenset(found)


def exists(dotted: str) -> bool:
    """Whether `twin.plant.plant.Plant.advance` or the like is a module or a name in one.

    Parameters
    ----------
    dotted : begins with a package of the project; arguments of calls are ignored
    """
    while CALL.search(dotted):
        dotted = CALL.sub("", dotted)
    parts = [p for p in dotted.split(".") if p]
    for n in range(len(parts), 0, -1):
        file = _file(tuple(parts[:n]))
        if file is not None:
            return _has(file, parts[n:])
    return False


def _file(parts: tuple[str, ...]) -> Path | None:
    """The source of a module; a stub where there is one, since it lists lazy names."""
    base = ROOT.joinpath(*parts)
    stub, package = base / "__init__.pyi", base / "__init__.py"
    for file in (stub, package, base.with_suffix(".py")):
        if file.is_file():
            return file
    return None


def _has(file: Path, names: list[str]) -> bool:
    tree: Tree = _tree(file)
    for k, name in enumerate(names):
        found = dict(_members(tree)).get(name)
        if found is None:
            return False
        if isinstance(found, str):  # imported from elsewhere
            inside = found.partition(".")[0] in PACKAGES
            return not inside or exists(".".join([found, *names[k + 1 :]]))
        if not isinstance(found, ast.ClassDef):
            return True
        tree = found
    return True


@functools.cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def _members(tree: Tree) -> Iterator[tuple[str, ast.AST | str]]:
    """Names that a module or class defines; of an imported one, where it comes from."""
    for node in ast.walk(tree) if isinstance(tree, ast.ClassDef) else _outermost(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in (t for group in targets for t in ast.walk(group)):
                name = getattr(target, "id", getattr(target, "attr", None))
                if name is not None:
                    yield name, node
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                yield alias.asname or alias.name, f"{node.module}.{alias.name}"
        elif isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.asname or alias.name, alias.name


def _outermost(tree: ast.Module) -> Iterator[ast.stmt]:
    """Statements of a module, also those that depend on type checking or on a missing package."""
    for node in tree.body:
        yield node
        if isinstance(node, ast.If | ast.Try):
            yield from node.body


def imports(code: str) -> list[str]:
    """Dotted names of the project that a piece of Python imports.

    Raises
    ------
    SyntaxError : it is not Python
    """
    names = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and node.module:
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    return [name for name in names if name.partition(".")[0] in PACKAGES]
