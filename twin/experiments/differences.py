"""Differences between two recordings, signal by signal, to the last bit."""

from dataclasses import dataclass

import numpy as np

from analysis.recording import Recording

CLOCKED = "timing/"  # signals that the wall clock alone decides


@dataclass(frozen=True)
class Difference:
    """One signal of both recordings.

    Attributes
    ----------
    equal : every stamp and value the same, to the last bit
    largest : difference at common stamps, in `unit`; None where there are none
    at : when [s]
    """

    signal: str
    unit: str
    equal: bool
    largest: float | None
    at: float | None

    def text(self) -> str:
        """The difference in words."""
        if self.largest is None:
            return "no common time stamps"
        if self.largest == 0.0:
            return "equal at common time stamps, but of another length or rate"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"up to {self.largest:.3g}{unit} at {self.at:.3f} s"


def differences(old: Recording, new: Recording) -> tuple[Difference, ...]:
    """Compare every signal of both that does not depend on the wall clock."""
    return tuple(
        _difference(name, old, new)
        for name in sorted(set(old.series) & set(new.series))
        if counted(name)
    )


def counted(name: str) -> bool:
    """Whether a signal does not depend on the wall clock alone."""
    return not name.startswith(CLOCKED)


def _difference(name: str, old: Recording, new: Recording) -> Difference:
    a, b = old[name], new[name]
    # bits, not values: NaN is to equal itself, and 0 is not to equal -0
    same = a.values.shape == b.values.shape and (
        a.time.tobytes() == b.time.tobytes() and a.values.tobytes() == b.values.tobytes()
    )
    if same:
        return Difference(name, a.unit, True, 0.0, None)
    _, left, right = np.intersect1d(a.time_ns, b.time_ns, return_indices=True)
    gap = np.linalg.norm(a.values[left] - b.values[right], axis=1)
    if not len(gap) or np.isnan(gap).all():
        return Difference(name, a.unit, False, None, None)
    k = int(np.nanargmax(gap))
    return Difference(name, a.unit, False, float(gap[k]), float(a.time[left[k]]))
