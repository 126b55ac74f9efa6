"""A word for how well a model's motion fits the measured one."""

from typing import Literal

Grade = Literal["good", "fair", "poor"]

GOOD_FIT, FAIR_FIT = 95.0, 85.0  # %; a difference of 5 and 15 % of the motion's own deviation


def grade(fit: float) -> Grade:
    """Grade of a fit 100 (1 - |difference| / |reference - mean|) [%]; poor if it is NaN."""
    return "good" if fit >= GOOD_FIT else "fair" if fit >= FAIR_FIT else "poor"
