"""What `twin compare` prints of two tables."""

import re

import numpy as np

from tests.analysis.test_compare import steps
from tests.twin.cli.test_cli import run


def test_gain_and_phase_have_an_interval_or_are_not_printed(capsys, tmp_path):
    """Steps held for 0.5 s have no power at 2 Hz."""
    t, y = steps()
    rng = np.random.default_rng(1)
    for name in ("a", "b"):
        columns = [t, np.round(y), y + 0.05 * rng.standard_normal(len(t))]
        np.savetxt(tmp_path / f"{name}.csv", np.array(columns).T, "%.6f", ",", header="t,u,p",
                   comments="")  # fmt: skip
    line = "--time t --input u --angle p --angle-unit deg"
    files = [str(tmp_path / f"{n}.csv") for n in ("a", "b")]
    code, out, _ = run(capsys, "compare", *files, *line.split(), "--out", f"{tmp_path}/c.rrd")
    assert code == 0
    rows = dict(re.findall(r"^at ([\d.]+) Hz +(.*)$", out, re.MULTILINE))
    assert rows["2"] == "no power"
    for hertz in ("0.5", "1", "5"):
        gain, phase = re.fullmatch(r"\S+ ± (\S+) dB, \S+ ± (\S+)°", rows[hertz]).groups()
        assert 0.0 <= float(gain) < 2.0
        assert 0.0 <= float(phase) < 10.0
