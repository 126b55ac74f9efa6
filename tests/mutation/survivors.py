"""Mutants that no test can or need notice, with the reason."""

REASONS: dict[str, str] = {
    "hardware/fusion/estimator.py:131 0 → 1": "equal: no frame before the first",
    "hardware/fusion/estimator.py:223 + → -": "equal: the angle is state 0 of an axis",
    "hardware/fusion/base.py:105 0.1 → 0.13": "an assumption about motions",
}
