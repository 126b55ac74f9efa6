"""One delayed transfer function and its exact responses."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.transfer_function import file
from analysis.transfer_function.file import ModelFileError

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, slots=True)
class Channel:
    """One transfer function, num(s)/den(s)·exp(−delay·s).

    Attributes
    ----------
    num, den : coefficients in descending powers of s, no more in `num` than in `den`
    delay : transport delay [s]

    Raises
    ------
    ModelFileError : coefficients that are not finite, improper, or without a denominator
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    delay: float = 0.0

    def __post_init__(self) -> None:
        num, den = _trimmed(self.num), _trimmed(self.den)
        object.__setattr__(self, "num", num)
        object.__setattr__(self, "den", den)
        if not np.all(np.isfinite([*num, *den, self.delay])):
            raise ModelFileError("num, den and delay_s must be finite")
        if den == (0.0,):
            raise ModelFileError("den is zero; it must hold a polynomial in s")
        with np.errstate(over="ignore"):
            if not np.isfinite(np.divide([*num, *den], den[0])).all():
                raise ModelFileError("num and den must be finite also where den begins with 1")
        if len(num) > len(den):
            raise ModelFileError(
                f"num has degree {len(num) - 1} and den {len(den) - 1}: the channel is improper,"
                " num must not have the higher degree"
            )
        if len(den) > file.LARGEST_ORDER + 1:
            raise ModelFileError(f"order {len(den) - 1} exceeds {file.LARGEST_ORDER}")
        if not 0.0 <= self.delay <= file.LONGEST_DELAY:
            raise ModelFileError(
                f"delay_s is {self.delay:g}; it must lie in 0 … {file.LONGEST_DELAY:g} s"
            )

    @property
    def zero(self) -> bool:
        """Whether nothing passes through this channel."""
        return self.num == (0.0,)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of the denominator, (n,) [rad/s]."""
        return np.roots(self.den).astype(np.complex128)

    @property
    def stable(self) -> bool:
        """Whether every pole lies in the open left half-plane."""
        return bool(np.all(self.poles.real < 0.0))

    def system(self) -> "control.TransferFunction":
        """The rational part as python-control's transfer function; the delay is left out."""
        import control  # costs a second, and most runs need no response

        return control.tf(list(self.num), list(self.den))

    def frequency_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Complex gain at angular frequencies (n,) [rad/s], delay included."""
        s = 1j * np.asarray(omega, dtype=np.float64)
        rational = np.polyval(self.num, s) / np.polyval(self.den, s)
        return np.asarray(rational * np.exp(-s * self.delay), dtype=np.complex128)


def _trimmed(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    """Coefficients as floats without leading zeros."""
    values = tuple(float(c) for c in coefficients)
    while len(values) > 1 and values[0] == 0.0:
        values = values[1:]
    if not values:
        raise ModelFileError("num and den must not be empty")
    return values
