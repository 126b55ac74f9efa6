"""Reading and writing the JSON file of an identified model; what strangers send is checked here."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from analysis.files import FileError, content
from analysis.schema import AnalysisError

SCHEMA = "tvc-twin/transfer-function/1"
LARGEST_FILE = 1 << 20  # bytes; a 4×4 model of order 20 with its report takes under 20 kB
LARGEST_ORDER = 20
LARGEST_SIZE = 8  # inputs or outputs
LONGEST_DELAY = 10.0  # s; the longest that an identification searches


class ModelFileError(AnalysisError):
    """A transfer-function file or value that cannot be used, reported in one line."""


def _constant(name: str) -> NoReturn:
    raise ModelFileError(f"the number {name} is not finite; every number must be")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ModelFileError(f"the key {twice[:60]!r} stands twice; give every key once")
    return found


def load(path: Path) -> Any:  # noqa: ANN401 - JSON is any until it has been checked
    """Content of a JSON file of limited size.

    Raises
    ------
    ModelFileError : the file cannot be read, is too large, or is not JSON
    """
    try:
        data = content(path, LARGEST_FILE)
    except FileError as error:
        raise ModelFileError(str(error)) from None
    try:
        return json.loads(data, parse_constant=_constant, object_pairs_hook=_object)
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from error
    except (ValueError, RecursionError) as error:
        reason = str(error).splitlines()[0]
        raise ModelFileError(f"{path} is not a JSON file: {reason}") from error


def mapping(value: object, where: str) -> Mapping[str, Any]:
    """Value of `where` as an object."""
    if not isinstance(value, Mapping):
        raise ModelFileError(f"{where} must be an object, not {_kind(value)}")
    return value


def sequence(value: object, where: str, longest: int) -> Sequence[Any]:
    """Value of `where` as a list of 1 to `longest` elements."""
    if not isinstance(value, list | tuple):
        raise ModelFileError(f"{where} must be a list, not {_kind(value)}")
    if not 1 <= len(value) <= longest:
        raise ModelFileError(f"{where} has {len(value)} elements; 1 to {longest} are possible")
    return value


def number(value: object, where: str) -> float:
    """Value of `where` as a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ModelFileError(f"{where} must be a number, not {_kind(value)}")
    try:
        converted = float(value)
    except OverflowError:
        converted = math.inf
    if not math.isfinite(converted):
        raise ModelFileError(f"{where} is {converted}; it must be finite")
    return converted


def keys(value: Mapping[str, Any], where: str, needed: set[str], optional: set[str]) -> None:
    """Check that an object has the keys it needs and none that nobody knows."""
    missing = sorted(needed - value.keys())
    if missing:
        raise ModelFileError(f"{where} lacks {', '.join(map(repr, missing))}")
    unknown = sorted(str(k) for k in value.keys() - needed - optional)
    if unknown:
        raise ModelFileError(
            f"{where} has the unknown key {unknown[0]!r}; known are"
            f" {', '.join(sorted(needed | optional))}"
        )


def free(value: object, where: str, depth: int = 0) -> object:
    """Value of `where` as any JSON of finite numbers, limited in depth (notes of the author)."""
    if depth > 8:
        raise ModelFileError(f"{where} is nested deeper than 8 levels")
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, int | float):
        return value if isinstance(value, int) else number(value, where)
    if isinstance(value, list | tuple):
        return [free(v, f"{where}[{i}]", depth + 1) for i, v in enumerate(value)]
    if isinstance(value, Mapping):
        return {str(k): free(v, f"{where}.{k}", depth + 1) for k, v in value.items()}
    raise ModelFileError(f"{where} holds {_kind(value)}, which JSON does not know")


def _kind(value: object) -> str:
    names = {dict: "an object", list: "a list", str: "a string", bool: "a truth value"}
    if value is None:
        return "null"
    return names.get(type(value), f"a {type(value).__name__}")
