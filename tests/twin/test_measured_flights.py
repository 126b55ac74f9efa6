"""Public flights: apogee beside RocketPy's with the same inputs, and beside the measurement."""

from pathlib import Path

import pytest

from twin.config import Fly
from twin.experiments.fly import fly
from twin.plant.compose import MJCF

FLIGHTS = MJCF / "examples" / "flights"


@pytest.mark.parametrize(
    ("name", "seconds", "wind", "peer", "measured", "error"),
    [
        ("bella_lui", 11.5, 0.0, 460.54, 458.97, 0.01),
        # peer and measurement differ by 2.0, 5.2 and 7.3 %
        pytest.param("ndrt", 18.0, 5.66, 1293.43, 1320.29, 0.03, marks=pytest.mark.slow),
        pytest.param("valetudo", 15.0, 0.0, 815.26, 860.0, 0.06, marks=pytest.mark.slow),
        pytest.param("prometheus", 30.0, 0.0, 4188.81, 3903.77, 0.08, marks=pytest.mark.slow),
    ],
)
def test_the_apogee_is_the_peers_within_1_percent_and_near_the_measured_one(
    tmp_path: Path,
    name: str,
    seconds: float,
    wind: float,
    peer: float,
    measured: float,
    error: float,
) -> None:
    """RocketPy 1.13's figures are those in its documentation, docs/examples."""
    flight = fly(
        Fly(
            vehicle=FLIGHTS / f"{name}.toml",
            programme="hold",
            duration_s=seconds,
            set=(f"wind_speed={wind}",),
            out=tmp_path / "flight.rrd",
        )
    )
    apogee = flight.figures.apogee_m
    assert apogee == pytest.approx(peer, rel=0.01)
    assert apogee == pytest.approx(measured, rel=error)
