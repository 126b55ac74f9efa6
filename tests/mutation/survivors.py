"""Mutants that no test can or need notice, with the reason."""

from tests.mutation.runner import ROOT, Mutant

REASONS: dict[tuple[str, str, str], str] = {  # by file, line of code and change: numbers move
    (
        "hardware/fusion/estimator.py",
        "dt_us = 0 if self._last_us is None else frame.device_us - self._last_us", "0 → 1",
    ): "equal: no frame before the first",
    (
        "hardware/fusion/estimator.py", "angle=(x[ANGLE], x[STATES + ANGLE]),", "+ → -",
    ): "equal: the angle is state 0 of an axis",
    ("hardware/fusion/base.py", "move: float = 0.1", "0.1 → 0.13"):
        "an assumption about motions",
    (
        "twin/control/attitude.py",
        "self._gains, np.array(c.authority_time), np.array(c.authority), np.zeros((n, 6)),",
        "6 → 7",
    ): "equal: a column that nothing reads",
    (
        "twin/physics/mechanism/torque.py", "mujoco.mj_rne(trial, data, 0, data.qfrc_bias)",
        "0 → 1",
    ): "equal: accelerations are zero after a reset",
    ("twin/physics/mechanism/torque.py", "for axis in range(2):", "2 → 3"):
        "equal: a third direction is the place for the result of hypot",
}  # fmt: skip


def reason(mutant: Mutant) -> str:
    """Why a mutant made by rule is let live; empty where nothing says so."""
    if mutant.at < 0:
        return ""
    text = (ROOT / mutant.file).read_text()
    code = text.splitlines()[text.count("\n", 0, mutant.at)].strip()
    return REASONS.get((mutant.file, code, f"{mutant.before} → {mutant.after}"), "")
