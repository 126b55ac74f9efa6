"""Twin, RocketPy and measurement of four public flights: python -m tests.benchmarks.measured_flights

RocketPy is flown with the same description, thrust curve, drag and air where an interpreter has it
(ROCKETPY_PYTHON); its documented apogee stands beside.
"""  # noqa: E501

from tests.benchmarks.rocketpy_flights import peer
from tests.twin.experiments.test_measured_flights import FLIGHTS, PUBLIC, Public
from twin.config import Fly
from twin.experiments.flight.fly import fly


def main() -> None:
    """Print one line a flight: apogee [m] and its difference from the measurement."""
    flown = peer(*(f"{name}:{public.wind}" for name, public in PUBLIC.items()))
    version = "not installed" if flown is None else flown["version"]
    print(f"apogee [m]     measured   RocketPy's documentation   RocketPy {version}   twin")
    for name, public in PUBLIC.items():
        theirs = None if flown is None else flown["reached"][name][0]
        columns = [_beside(v, public.measured) for v in (public.peer, theirs, _twin(name, public))]
        print(f"{name:12s} {public.measured:10.1f} {'   '.join(columns)}", flush=True)


def _beside(apogee: float | None, measured: float) -> str:
    if apogee is None:
        return f"{'-':>20s}"
    return f"{apogee:10.1f} ({100 * (apogee / measured - 1):+.1f} %)"


def _twin(name: str, public: Public) -> float | None:
    config = Fly(
        vehicle=FLIGHTS / f"{name}.toml",
        programme="hold",
        duration_s=public.seconds,
        set=(f"wind_speed={public.wind}",),
    )
    return fly(config, recorded=False).figures.apogee_m


if __name__ == "__main__":
    main()
