"""Estimates as text."""

import numpy as np

from analysis.identify import Estimate

_READ_AS = {"s": (1e3, " ms"), "rad/rad": (1.0, ""), "1": (1.0, ""), "rad": (180.0 / np.pi, "°")}


def estimated(e: Estimate) -> str:
    """An estimate with its 95 % interval, as people read it."""
    if e.at_least:
        scale, unit = _READ_AS.get(e.unit, (1.0, f" {e.unit}"))
        return f"at least {scale * e.value:.3g}{unit} (never reached in this record)"
    if e.determined and e.value == 0.0 and e.name.endswith(("dead band", "backlash")):
        return below(1.96 * e.std, e.unit)
    return quantity(e.value, 1.96 * e.std, e.unit, determined=e.determined)


def below(value: float, unit: str) -> str:
    """The upper end of an interval that begins at zero, as people read it."""
    scale, unit = _READ_AS.get(unit, (1.0, f" {unit}"))
    return f"below {scale * value:.2g}{unit}"


def quantity(value: float, half: float, unit: str, *, determined: bool = True) -> str:
    """A value with its 95 % interval, as people read it."""
    if not determined:
        return "not determined by these readings"
    half = abs(half)
    scale, unit = _READ_AS.get(unit, (1.0, f" {unit}"))
    value, half = scale * value, scale * half
    if not np.isfinite(half):
        return f"{value:.4g}{unit}, interval unknown"
    if half == 0.0:
        return f"{value:.5g}{unit}, as given"
    digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 9))
    return f"{value:.{digits}f} ± {half:.{digits}f}{unit}"
