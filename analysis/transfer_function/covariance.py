"""The covariance of an identified model's figures, as model files hold it."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from analysis.array import Array
from analysis.transfer_function import file
from analysis.transfer_function.file import ModelFileError

MOST_FIGURES = 64
_ROUNDING = 1e-6  # of correlations, of which a file may keep seven digits


@dataclass(frozen=True, slots=True)
class Covariance:
    """Figures of a model and their covariance.

    Attributes
    ----------
    names : `x/x gain`, `delay`, `natural frequency`, `damping`, `time constant`, `zero` of a
        channel OUTPUT/INPUT, numbered where it has several; `x rate limit`, `dead band`,
        `backlash` and so on of the servo of an axis
    values : (n,), in SI and radians
    matrix : (n, n)
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]

    @classmethod
    def from_dict(cls, value: object) -> Self:
        """Covariance from the content of a file.

        Raises
        ------
        ModelFileError : sizes that do not fit, a name twice, numbers that are none, a matrix that
            is not symmetric and positive semidefinite
        """
        content = file.mapping(value, "covariance")
        file.keys(content, "covariance", {"names", "values", "matrix"}, set())
        names, values, matrix = (
            file.sequence(content[key], f"covariance.{key}", MOST_FIGURES)
            for key in ("names", "values", "matrix")
        )
        size = len(names)
        if len({str(n) for n in names}) < size:
            raise ModelFileError("covariance.names repeats a name")
        rows = [file.sequence(r, f"covariance.matrix[{i}]", size) for i, r in enumerate(matrix)]
        if {len(values), len(rows), *(len(r) for r in rows)} != {size}:
            raise ModelFileError(f"covariance: {size} names need {size} values and a square matrix")
        figures = tuple(file.number(v, "covariance.values") for v in values)
        numbers = tuple(tuple(file.number(v, "covariance.matrix") for v in row) for row in rows)
        _check(tuple(map(str, names)), np.array(numbers))
        return cls(tuple(map(str, names)), figures, numbers)

    def to_dict(self) -> dict[str, object]:
        """Content of the file, ready for JSON."""
        return {"names": list(self.names), "values": list(self.values),
                "matrix": [list(row) for row in self.matrix]}  # fmt: skip


def _check(names: tuple[str, ...], matrix: Array) -> None:
    """Refuse a matrix (n, n) that is no covariance; of correlations, whose units are alike."""
    variances = np.diag(matrix)
    for name, variance in zip(names, variances, strict=True):
        if variance < 0.0:
            raise ModelFileError(
                f"covariance.matrix has the variance {variance:g} for '{name}'; it must be ≥ 0"
            )
    scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    one = matrix / scale[:, None] / scale
    if not np.allclose(one, one.T, rtol=0.0, atol=_ROUNDING):
        raise ModelFileError("covariance.matrix is not symmetric")
    if not np.isfinite(one).all() or np.linalg.eigvalsh(one)[0] < -_ROUNDING * len(names):
        raise ModelFileError(
            "covariance.matrix is not positive semidefinite: some combination of its figures has a"
            " negative variance"
        )
