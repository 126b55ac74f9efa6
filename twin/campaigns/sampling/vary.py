"""What varies in a study: distributions that turn numbers from 0 to 1 into values."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # its part `stats` takes half a second and is loaded where it is used
from numpy.typing import NDArray
from scipy.special import ndtri

from analysis.files import FileError, content
from analysis.transfer_function import ModelFileError, TransferFunctionModel, distribution
from hardware.frames import AXES
from twin.config.base import unknown
from twin.errors import TwinError

Array = NDArray[np.float64]
LARGEST_TABLE = 10_000_000  # bytes
MOST_VALUES = 100_000
JOINT = ("covariance", "model")  # distributions of several parameters together


@dataclass(frozen=True)
class Varied:
    """One `[vary.NAME]` of a study.

    Attributes
    ----------
    name : of the table
    kind : its distribution
    columns : names that a sample of it gives values for
    streams : independent uniform numbers that one sample takes
    values : of a grid or choice, in order; empty for continuous distributions
    relative : whether the values multiply the nominal one
    spec : its table in the study
    density : logarithm of the probability density at values (n,); None where there is none
    support : ends of the values that have a density
    make : gives one list of values a column, from uniform numbers (streams, n)
    model : identified model whose figures vary; None for all other kinds
    """

    name: str
    kind: str
    columns: tuple[str, ...]
    streams: int
    values: tuple[object, ...]
    relative: bool
    make: Callable[[Array], list[list[Any]]]
    spec: Mapping[str, object] = field(default_factory=dict)
    density: Callable[[Array], Array] | None = None
    support: tuple[float, float] = (-math.inf, math.inf)
    model: TransferFunctionModel | None = None


def varied(name: str, table: object, folder: Path) -> Varied:
    """Read one `[vary.NAME]`.

    Raises
    ------
    TwinError : in one line, what is wrong
    """
    where = f"[vary.{name}]"
    if not isinstance(table, dict):
        raise TwinError(f"{where}: must be a table with a distribution")
    given = dict(table)
    nominal = given.pop("nominal", 0.0)
    if not (isinstance(nominal, list) and all(isinstance(n, str) for n in nominal)):
        number(f"{where} nominal", nominal)
    kind, relative = given.pop("distribution", None), given.pop("relative", False)
    if not isinstance(kind, str) or kind not in _KINDS:
        raise TwinError(f"{where} distribution {kind!r}: must be one of {', '.join(_KINDS)}")
    if not isinstance(relative, bool):
        raise TwinError(f"{where} relative {relative!r}: must be true or false")
    needed, optional, make = _KINDS[kind]
    keys = (*needed, *optional)
    if odd := sorted(set(given) - set(keys)):
        raise TwinError(f"{where}: {unknown(odd[0], keys, f'key of {kind}')}")
    if missing := [k for k in needed if k not in given]:
        raise TwinError(f"{where} distribution {kind!r}: needs {', '.join(missing)}")
    return replace(
        make(where, name, given, relative, folder),
        spec={"kind": kind, "relative": relative, **given},
    )


def shown(value: object) -> object:
    """A value as a row has it: a set by its name."""
    if isinstance(value, Mapping):
        return str(value.get("name", dict(value)))
    return value


def number(where: str, value: object, *, positive: bool = False) -> float:
    """A finite number of a study.

    Raises
    ------
    TwinError : it is not one
    """
    given = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
        given = float(value)
    if not math.isfinite(given) or (positive and given <= 0):
        what = "a positive number" if positive else "a number"
        raise TwinError(f"{where} {str(value)[:40]!r}: must be {what}")
    return given


def _one(
    name: str, kind: str, relative: bool, inverse: Callable[[Array], Array], of: Callable[[], Any],
    support: tuple[float, float] = (-math.inf, math.inf),
) -> Varied:  # fmt: skip
    """One parameter whose values have a density; `of` gives its distribution."""

    def make(u: Array) -> list[list[Any]]:
        return [inverse(u[0]).tolist()]

    def density(values: Array) -> Array:
        return of().logpdf(values)  # type: ignore[no-any-return]

    return Varied(name, kind, (name,), 1, (), relative, make, density=density, support=support)


def _normal(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    mean = number(f"{where} mean", given["mean"])
    sd = number(f"{where} sd", given["sd"], positive=True)
    return _one(
        name, "normal", relative, lambda u: mean + sd * ndtri(u), lambda: scipy.stats.norm(mean, sd)
    )


def _uniform(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    low, high = (number(f"{where} {k}", given[k]) for k in ("low", "high"))
    if not low < high:
        raise TwinError(f"{where} low {low:g}: must be less than high {high:g}")
    return _one(
        name, "uniform", relative, lambda u: low + (high - low) * u,
        lambda: scipy.stats.uniform(low, high - low), (low, high),
    )  # fmt: skip


def _lognormal(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    median = number(f"{where} median", given["median"], positive=True)
    sigma = number(f"{where} sigma", given["sigma"], positive=True)
    return _one(
        name, "lognormal", relative, lambda u: median * np.exp(sigma * ndtri(u)),
        lambda: scipy.stats.lognorm(sigma, scale=median), (0.0, math.inf),
    )  # fmt: skip


def _picked(name: str, kind: str, relative: bool, values: list[Any], edges: Array) -> Varied:
    def make(u: Array) -> list[list[Any]]:
        return [[values[k] for k in np.searchsorted(edges, u[0], side="right").tolist()]]

    return Varied(name, kind, (name,), 1, tuple(values), relative, make)


def _choice(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    values = _list(where, given["values"])
    weights = given.get("weights", [1.0] * len(values))
    if not isinstance(weights, list) or len(weights) != len(values):
        raise TwinError(f"{where} weights: must be {len(values)} numbers, one for each value")
    share = np.cumsum([number(f"{where} weights", w, positive=True) for w in weights])
    return _picked(name, "choice", relative, values, share[:-1] / share[-1])


def _grid(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    if "values" in given:
        if len(given) > 1:
            raise TwinError(f"{where}: values and low, high, count exclude each other")
        values = _list(where, given["values"])
    elif not {"low", "high", "count"} <= given.keys():
        raise TwinError(f"{where} distribution 'grid': needs values, or low, high and count")
    else:
        low, high = (number(f"{where} {k}", given[k]) for k in ("low", "high"))
        count = given["count"]
        if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= MOST_VALUES:
            raise TwinError(f"{where} count {count!r}: must be a whole number from 2")
        values = np.linspace(low, high, count).tolist()
    return _picked(name, "grid", relative, values, np.arange(1, len(values)) / len(values))


def _table(where: str, name: str, given: dict[str, Any], relative: bool, folder: Path) -> Varied:
    file, column = folder / str(given["file"]), str(given["column"])
    try:
        lines = content(file, LARGEST_TABLE).decode("utf-8", "replace").splitlines()
    except FileError as error:
        raise TwinError(f"{where} {error}") from None
    head = [c.strip() for c in lines[0].split(",")] if lines else []
    if column not in head:
        raise TwinError(f"{where} column {column!r}: {file} has {', '.join(head)[:200]}")
    at = head.index(column)
    cells = [line.split(",") for line in lines[1:] if line.strip()]
    try:
        values = [float(row[at]) for row in cells]
    except (ValueError, IndexError):
        raise TwinError(
            f"{where} column {column!r}: {file} has cells that are no numbers"
        ) from None
    values = [number(f"{where} {file}", v) for v in values]
    _list(where, values)
    return _picked(name, "table", relative, values, np.arange(1, len(values)) / len(values))


def _covariance(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    names = [str(n) for n in _list(where, given["names"])]
    mean = np.array([number(f"{where} mean", m) for m in _list(where, given["mean"])])
    rows = _list(where, given["covariance"])
    size = len(names)
    if len(mean) != size or any(not isinstance(r, list) or len(r) != size for r in rows):
        raise TwinError(f"{where}: {size} names need {size} means and a covariance {size} × {size}")
    matrix = np.array([[number(f"{where} covariance", c) for c in row] for row in rows])
    try:
        if matrix.shape != (size, size) or not np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0):
            raise np.linalg.LinAlgError
        root = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise TwinError(f"{where} covariance: must be symmetric and positive definite") from None

    return _joint(name, "covariance", tuple(names), mean, root, relative)


def _joint(
    name: str, kind: str, columns: tuple[str, ...], mean: Array, root: Array, relative: bool = False
) -> Varied:  # fmt: skip
    """Jointly normal columns of a mean (n,) and a root (n, n) of the covariance."""

    def make(u: Array) -> list[list[Any]]:
        return (mean[:, None] + root @ ndtri(u)).tolist()  # type: ignore[no-any-return]

    return Varied(name, kind, columns, len(mean), (), relative, make)


def _model(where: str, name: str, given: dict[str, Any], relative: bool, folder: Path) -> Varied:
    if name != "model" or relative:
        raise TwinError(f"{where} distribution 'model': is for [vary.model], without relative")
    file = folder / str(given["file"])
    try:
        model = TransferFunctionModel.read(file)
        known, root = distribution(model)
    except ModelFileError as error:
        text = str(error)
        raise TwinError(f"{where} {'' if str(file) in text else f'{file}: '}{text}") from None
    if len(model.inputs) != len(AXES):
        raise TwinError(f"{where} {file}: has {len(model.inputs)} axis; a flight needs two")
    columns = tuple(f"model.{n}" for n in known.names)
    return replace(_joint(name, "model", columns, np.array(known.values), root), model=model)


def _unit(where: str, name: str, given: dict[str, Any], relative: bool, _: Path) -> Varied:
    count = number(f"{where} count", given["count"], positive=True)
    if name != "unit" or relative:
        raise TwinError(f"{where} distribution 'unit': is for [vary.unit], serial numbers of rigs")
    return Varied(
        name, "unit", (name,), 1, (), False, lambda u: [np.floor(u[0] * count).astype(int).tolist()]
    )


def _list(where: str, values: object) -> list[Any]:
    if not isinstance(values, list) or not 1 <= len(values) <= MOST_VALUES:
        raise TwinError(f"{where}: must be a list of 1 to {MOST_VALUES} values")
    return values


_Maker = Callable[[str, str, dict[str, Any], bool, Path], Varied]
# distribution → keys that it needs, keys that it may have, reader
_KINDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...], _Maker]] = {
    "normal": (("mean", "sd"), (), _normal),
    "uniform": (("low", "high"), (), _uniform),
    "lognormal": (("median", "sigma"), (), _lognormal),
    "choice": (("values",), ("weights",), _choice),
    "grid": ((), ("values", "low", "high", "count"), _grid),
    "table": (("file", "column"), (), _table),
    "covariance": (("names", "mean", "covariance"), (), _covariance),
    "model": (("file",), (), _model),
    "unit": (("count",), (), _unit),
}
