"""The checks. Each measures with the functions of a test or a benchmark, which names its source."""

import functools
import math
import tempfile
from pathlib import Path

import numpy as np

from analysis.response import model_step_metrics
from analysis.transfer_function import Channel, Loop
from tests.analysis import test_margins, test_response, test_transfer_function
from tests.benchmarks import coverage, rig_studies
from tests.hardware import test_calibration_map
from tests.mjcf import test_mechanism_clearance
from tests.twin.experiments import test_measured_flights
from tests.twin.experiments.test_measured_flights import PUBLIC
from tests.twin.physics import (
    test_aerodynamics,
    test_air,
    test_free_flight,
    test_one_axis,
    test_vehicle_shape,
)
from tests.twin.plant import test_integrators, test_reference_gimbal
from tests.validation.check import Check
from twin.hil import mechanism_map
from twin.physics.aerodynamics import density


def free_flight(wind: float) -> float:
    """Height of the apogee, relative [%]."""
    with tempfile.TemporaryDirectory() as folder:
        _, truth, _, ours = test_free_flight.apogees(Path(folder), wind)
    return 100 * abs(ours[2] / truth[2] - 1)


def vertical_flight() -> float:
    """Height and speed after 8 s with drag, the worse of both, relative [%]."""
    truth, ours = test_one_axis.flown(1.0)
    return 100 * float(np.abs(ours / truth - 1).max())


@functools.cache
def apogee(name: str) -> float:
    """Of a public flight [m]."""
    with tempfile.TemporaryDirectory() as folder:
        return test_measured_flights.apogee(name, Path(folder))


def orders() -> float:
    """Worst distance of an observed order from the method's."""
    methods = {"ab1": 1, "ab2": 2, "ab3": 3, "ab4": 4, "rk4": 4}
    seen = {
        name: test_integrators.observed_order(
            [test_integrators.oscillator_error(name, h) for h in (0.02, 0.01, 0.005)]
        )
        for name in methods
    }
    return max(abs(seen[name] - order) for name, order in methods.items())


def tumbling() -> float:
    """Rate of a free body after 30 s of Runge-Kutta at 5 ms [°/s]."""
    truth, _ = test_integrators.euler_equations(30.0)
    rate, _ = test_integrators.tumbling("rk4", 0.005, 30.0)
    return float(np.degrees(np.abs(rate - truth).max()))


def air_density() -> float:
    """Worst deviation up to 20 km, relative [%]."""
    return 100 * max(abs(density(h) / rho - 1) for h, rho in test_aerodynamics.STANDARD)


def gusts() -> float:
    """Of 50 wave numbers those outside the 95 % band."""
    return float((np.abs(test_air.dryden_deviations()) > 1.96).sum())


def barrowman() -> float:
    """Slope and centre of pressure of four printed examples, the worst [%]."""
    worst = 0.0
    for example in test_vehicle_shape.PUBLISHED.values():
        slope, centre = test_vehicle_shape.slope_and_centre(example)
        worst = max(worst, abs(slope / example.slope - 1), abs(centre / example.centre - 1))
    return 100 * worst


def stepinfo() -> float:
    """Rise and settling time of the manual's example, the worse [ms]."""
    seen = model_step_metrics(test_response.MATLAB)
    return 1e3 * max(abs(seen.rise_time - 0.2087), abs(seen.settling_time - 3.4972))


def phase_margin() -> float:
    """Worst error over three loops K/s·exp(−sT), whose margin is π/2 − KT [°]."""

    def error(gain: float, delay: float) -> float:
        loop = Loop("loop", (gain,), (1.0, 0.0), 0.0)
        found = test_margins.single(loop, Channel((1.0,), (1.0,), delay))
        return math.degrees(abs(found.phase - (math.pi / 2 - gain * delay)))

    return max(error(*each) for each in ((2.0, 0.1), (9.0, 0.05), (20.0, 0.01)))


@functools.cache
def rig_and_model() -> tuple[float, float]:
    """Attitude, rms [°], and path, relative to its length [%], of 8 s of the doublet."""
    with tempfile.TemporaryDirectory() as folder:
        runs = test_reference_gimbal.flights(Path(folder), "doublet")
        angle, _, distance, flown = test_reference_gimbal.apart(runs)
    return float(angle), float(100 * distance / flown)


def stale_model() -> float:
    """Worst figure of the shipped model against the same commands run now, in its half widths."""
    with tempfile.TemporaryDirectory() as folder:
        return test_reference_gimbal.staleness(Path(folder))


def clearance() -> float:
    """Smallest distance of two parts over 25 angles [mm]; what exceeds 1 mm counts as that."""
    return float(test_mechanism_clearance.least_gap(test_mechanism_clearance.loaded(), 1.0)[0])


@functools.cache
def scores(kind: str, seeds: int) -> tuple[float, float]:
    """Share of true parameters inside their 95 % intervals [%]; error over deviation, rms."""
    share, rms, _ = coverage.study(kind, range(seeds))
    return 100 * share, rms


def polynomial() -> float:
    """Linearised angle of the calibration against the linkage's [°]."""
    linkage = test_calibration_map.Linkage()
    linearisation = mechanism_map(linkage.model).linearisation
    return test_calibration_map.polynomial_error(linkage, linearisation)


@functools.cache
def maps() -> tuple[float, float]:
    """Commanded against true angle over ±8° [°], the worst of 40 units; share within 2 σ [%]."""
    linkage = test_calibration_map.Linkage()
    linearisation = mechanism_map(linkage.model).linearisation
    units = test_calibration_map.calibrated(linkage, linearisation)
    worst = max(np.degrees(abs(u.error)).max() for u in units)
    return float(worst), float(100 * (abs(test_calibration_map.scores(units)) < 2.0).mean())


def calibrated() -> float:
    """Zero of a calibrated rig, the worse axis of two units [°]."""
    return max(float(np.abs(rig_studies.calibration_error(unit)[0]).max()) for unit in (1, 2))


def fused() -> float:
    """Error of the better potentiometer over that of the fused angle, the least of two units."""
    ratios = []
    for unit in (1, 2):
        error, single, _ = rig_studies.fusion_error(unit)
        ratios += list(np.minimum(single[[0, 2]], single[[1, 3]]) / error)
    return float(min(ratios))


def _flights() -> list[Check]:
    against = []
    for name, public in PUBLIC.items():
        title = "NDRT" if name == "ndrt" else name.replace("_", " ").title()
        peer = functools.partial(lambda n, p: 100 * abs(apogee(n) / p - 1), name, public.peer)
        real = functools.partial(lambda n, p: 100 * abs(apogee(n) / p - 1), name, public.measured)
        against += [
            Check(f"peer-{name}", f"apogee of {title}", f"RocketPy's pages: {public.peer} m",
                  peer, 1.0, " %"),
            Check(f"flight-{name}", f"apogee of {title}", f"measured: {public.measured} m",
                  real, 100 * public.error, " %"),
        ]  # fmt: skip
    return against


SCIPY = "the same equations integrated by SciPy"
CHECKS = (
    Check("free-flight", "apogee of a thrown rocket, six degrees of freedom", SCIPY,
          functools.partial(free_flight, 0.0), 0.02, " %"),
    Check("free-flight-wind", "the same in 7 m/s of wind", SCIPY,
          functools.partial(free_flight, 7.0), 0.02, " %"),
    Check("vertical-flight", "height and speed after 8 s straight up, with drag", SCIPY,
          vertical_flight, 0.02, " %"),
    Check("orders", "order of ab1 to ab4 and rk4", "exact solution of a forced oscillator",
          orders, 0.15),
    Check("tumbling", "rate of a tumbling body after 30 s", "Euler's equations by SciPy's DOP853",
          tumbling, 1e-7, " °/s"),
    Check("density", "density of the air up to 20 km", "U.S. Standard Atmosphere 1976, table I",
          air_density, 0.01, " %"),
    Check("gusts", "wave numbers of the gusts outside the 95 % band, of 50",
          "spectra of MIL-F-8785C 3.7.1", gusts, 6),
    Check("strips", "crossflow force and moment of the shipped strips", "adaptive quadrature",
          lambda: 100 * test_aerodynamics.strip_error("vehicle.xml"), 0.01, " %"),
    Check("barrowman", "slope and centre of pressure of four rockets",
          "examples printed by Barrowman (1966, 1970)", barrowman, 0.5, " %"),
    *_flights(),
    Check("clearance", "distance of parts of the mechanism at every angle",
          "solids by manifold3d", clearance, unit=" mm", low=0.3),
    Check("transfer-function", "motion of a coupled 2×2 model [rad]", "python-control",
          test_transfer_function.coupled_error, 1e-12),
    Check("stepinfo", "rise and settling time", "stepinfo's example in MATLAB's manual",
          stepinfo, 0.1, " ms"),
    Check("phase-margin", "phase margin of an integrator with a delay", "π/2 − KT",
          phase_margin, 1e-6, "°"),
    Check("model-attitude", "attitude flown with the shipped model of the gimbal, rms",
          "the emulated rig in the loop", lambda: rig_and_model()[0],
          test_reference_gimbal.ATTITUDE_DEG, "°"),
    Check("model-path", "path flown with it, of its length", "the emulated rig in the loop",
          lambda: rig_and_model()[1], 100 * test_reference_gimbal.PATH, " %"),
    Check("model-renewed", "figures of the shipped model, of half of their 95 % interval",
          "the commands of docs/identification.md, run now", stale_model, 1.0, long=True),
    *(Check(f"coverage-{kind}", f"true parameters inside 95 % intervals, {text}",
            "closed-form motions of 100 gimbals of known parameters",
            functools.partial(lambda k: scores(k, 100)[0], kind), 98.0, " %", low=90.0, long=True)
      for kind, text in (("exact", "exact stamps"), ("late", "stamps up to 0.3 ms off"),
                         ("coloured", "coloured noise"), ("quantised", "quiet potentiometer"),
                         ("single", "one step"))),
    Check("scores", "errors of identified parameters over their stated deviations, rms",
          "closed-form motions of 100 gimbals, exact stamps",
          lambda: scores("exact", 100)[1], 1.25, low=0.75, long=True),
    Check("calibration", "zero found by calibrating two emulated units, worst axis",
          "zero the units were drawn with", calibrated, 0.12, "°", long=True),
    Check("linearisation", "polynomial of the calibration between the stops",
          "linkage solved by MuJoCo's kinematics", polynomial, 0.008, "°"),
    Check("calibration-map", "commanded against true angle over ±8°, worst of 40 units",
          "linkage solved by MuJoCo's kinematics", lambda: maps()[0], 0.15, "°"),
    Check("calibration-sigma", "errors of that map within twice its stated deviation",
          "95.4 % of a normal distribution", lambda: maps()[1], 99.0, " %", low=88.0),
    Check("fusion", "error of the better potentiometer over that of the fused angle, at least",
          "true angle of two emulated units", fused, low=3.0),
    Check("coverage-coupled", "true parameters inside 95 % intervals, two axes and a coupling",
          "closed-form motions of 20 gimbals of known parameters",
          lambda: scores("coupled", 20)[0], 98.0, " %", low=90.0, long=True),
)  # fmt: skip
