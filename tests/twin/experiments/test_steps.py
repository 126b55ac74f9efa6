"""`twin step`: figures from the recording against closed forms, on every signal and seat."""

import json
import math

import pytest

from analysis.transfer_function import TransferFunctionModel
from tests.twin.cli.test_cli import run
from twin.config import Step
from twin.experiments.step import step

OMEGA, ZETA, DELAY = 40.0, 0.5, 0.012
BAND, DURATION = {"band_hz": (0.5, 10.0)}, {"duration_s": 4.0}
SHORT = {
    "staircase": {"smallest_deg": 1.0}, "chirp": BAND | DURATION, "prbs": BAND, "multisine": BAND,
    "triangle": DURATION, "dog-leg": DURATION,
}  # fmt: skip


@pytest.fixture(scope="module")
def second_order(tmp_path_factory):
    """Model file of ωn²/(s² + 2ζωn s + ωn²)·exp(−delay·s) on both axes."""
    path = tmp_path_factory.mktemp("model") / "model.json"
    TransferFunctionModel.second_order(OMEGA, ZETA, DELAY).write(path)
    return path


def told(result) -> dict[str, dict]:
    """Figures of axis x by name, of the largest steps where there are several sizes."""
    rows = sorted(result.as_dict()["figures"], key=lambda r: abs(r.get("amplitude") or 0.0))
    return {r["name"]: r for r in rows if r["axis"] == "x"}


def test_step_figures_are_those_of_the_second_order_textbook(second_order, tmp_path):
    """Rows come every 2 ms, so times are good to 1 ms; the joint follows within 0.01°."""
    result = step(Step(gimbal="transfer-function", model=second_order, out=tmp_path / "a.rrd"))
    found = told(result)
    overshoot = 100.0 * math.exp(-math.pi * ZETA / math.sqrt(1.0 - ZETA**2))
    peak = math.pi / (OMEGA * math.sqrt(1.0 - ZETA**2)) + DELAY
    for way in ("up", "down"):
        assert found[f"overshoot {way}"]["value"] == pytest.approx(overshoot, abs=0.5)
        assert found[f"peak_time {way}"]["value"] == pytest.approx(peak, abs=2e-3)
        assert found[f"static_error {way}"]["value"] == pytest.approx(0.0, abs=2e-4)
        assert found[f"dead_time {way}"]["value"] > DELAY
        assert found[f"rise_time {way}"]["n"] == 6
        assert abs(found[f"rise_time {way}"]["amplitude"]) == pytest.approx(math.radians(5.0))
    assert found["gain"]["value"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("signal", ["multisine", "prbs", "chirp"])
def test_frequency_figures_are_those_of_the_second_order_textbook(second_order, tmp_path, signal):
    """Phase at 1 Hz in closed form; 1°: sampling, held commands and 15 averages."""
    result = step(
        Step(
            gimbal="transfer-function",
            model=second_order,
            signal=signal,
            axis="x",
            repeats=2,
            out=tmp_path / "a.rrd",
        )
    )
    w = 2.0 * math.pi
    lag = math.degrees(math.atan2(2 * ZETA * OMEGA * w, OMEGA**2 - w**2) + DELAY * w)
    found = told(result)["phase lag at 1 Hz"]
    assert found["value"] == pytest.approx(lag, abs=1.0)
    low, high = found["interval"]
    assert low <= found["value"] <= high


@pytest.mark.parametrize(
    "signal", ["staircase", "chirp", "prbs", "multisine", "triangle", "dog-leg"]
)
def test_every_signal_runs_on_the_linkage_and_tells_finite_figures_or_why_not(tmp_path, signal):
    result = step(Step(signal=signal, out=tmp_path / "a.rrd", axis="x", repeats=1, **SHORT[signal]))
    content = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert content["figures"]
    missing = [f["name"] for f in content["figures"] if f["value"] is None]
    assert all(any(name in note for note in content["notes"]) for name in missing)
    assert result.text().count("\n") < 24  # one screen
    assert {f["axis"] for f in content["figures"]} <= {"x", "x/y"}  # x/y: what y did meanwhile


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("step --signal sine", "multisine"),
        ("step --signal chirp --band-hz 1 400", "at most 125"),
        ("step --signal chirp --band-hz 5 1", "lower frequency first"),
        ("step --signal staircase --smallest-deg 0", "--smallest-deg 0"),
        ("step --rate-limit-deg-s -1", "from 0.001"),
        ("step --signal triangle --duration-s 1e9", "0.1 to 600"),
        ("step --repeats 10000", "at most 3600 s"),
        ("step --amplitude-deg nan", "finite"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(capsys, tmp_path, monkeypatch, command, says):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *command.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert list(tmp_path.iterdir()) == []
