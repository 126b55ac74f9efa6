"""Monte Carlo studies of the identification: `python tests/benchmarks/identification.py [SEEDS]`.

The gimbals here are simulated by other means than the estimator's: closed forms of the second-order
step response, python-control, and small-step integration of the rate-limited servo. The tests run
the same studies on a handful of seeds.
"""

import argparse
import math
import time
from dataclasses import dataclass, replace

import control
import numpy as np

from analysis.identify import identify
from analysis.identify.evidence.uncertainty import covariance, whole_jacobian
from analysis.identify.identification import layout_of
from analysis.identify.problem.assemble import assemble
from analysis.identify.problem.problem import Problem
from analysis.recording import measurement

LSB = math.radians(240.0 / 1023.0)  # 10 bits over a potentiometer of 240°


@dataclass(frozen=True)
class Gimbal:
    frequency: float
    damping: float
    delay: float
    gain: float


def gimbal(rng):
    return Gimbal(
        rng.uniform(20, 90), rng.uniform(0.3, 1.1), rng.uniform(0.005, 0.04), rng.uniform(0.8, 1.2)
    )


def step_pair(g, t):
    """Unit step response of a second-order gimbal and its derivative, closed form."""
    t = np.clip(t - g.delay, 0.0, None)
    root = np.sqrt(complex(g.damping**2 - 1.0)) * g.frequency
    p, q = -g.damping * g.frequency + root, -g.damping * g.frequency - root
    y = 1.0 + (q * np.exp(p * t) - p * np.exp(q * t)) / (p - q)
    v = p * q * (np.exp(p * t) - np.exp(q * t)) / (p - q)
    return g.gain * y.real, g.gain * v.real


def stamps(rng, duration, period, lost=0.03):
    """Sample times with jitter and gaps."""
    t = np.arange(0.0, duration, period)
    t = t + rng.uniform(0.0, 0.3 * period, len(t))
    return t[rng.random(len(t)) > lost]


def random_steps(rng, duration, hold, amplitude, columns=1):
    at = np.arange(0.2, duration, hold)
    at = at + rng.uniform(-0.02, 0.02, len(at))
    return at, np.radians(rng.uniform(-amplitude, amplitude, (len(at), columns)))


def sensed(rng, angle, rate, noise=(0.2, 0.3)):
    """Potentiometer with offset and 10 bits, gyro with bias; noise in ° and °/s."""
    pot = angle + 0.03 + math.radians(noise[0]) * rng.normal(size=angle.shape)
    gyro = rate + 0.1 + math.radians(noise[1]) * rng.normal(size=rate.shape)
    return np.round(pot / LSB) * LSB, gyro


def true_noise(noise=(0.2, 0.3)):
    return math.hypot(math.radians(noise[0]), LSB / math.sqrt(12.0)), math.radians(noise[1])


def moved(gimbals, t, at, u):
    """Angle and rate of one axis under steps of several commands."""
    angle, rate = np.zeros(len(t)), np.zeros(len(t))
    for j, g in enumerate(gimbals):
        for begin, jump in zip(at, np.diff(u[:, j], prepend=0.0), strict=True):
            y, v = step_pair(g, t - begin)
            angle += jump * y
            rate += jump * v
    return angle, rate


def servo_record(rng, g, duration=10.0, period=0.005):
    t = stamps(rng, duration, period)
    at, u = random_steps(rng, duration, 0.5, 8.0)
    angle, rate = sensed(rng, *moved([g], t, at, u))
    return measurement(t, u, command_time=at, before=[0.0], angle=angle, rate=rate)


def frequency_error(model, truth, reference, channel=(0, 0)):
    """Error of a channel's frequency response over that of a reference, up to twice ωn."""
    w = np.geomspace(1.0, 2.0 * reference.frequency, 200)

    def response(g):
        s = 1j * w
        below = s**2 + 2 * g.damping * g.frequency * s + g.frequency**2
        return g.gain * g.frequency**2 / below * np.exp(-s * g.delay)

    found = model.to_transfer_function().channel(*channel).frequency_response(w)
    return np.linalg.norm(found - response(truth)) / np.linalg.norm(response(reference))


def cramer_rao(
    problem: Problem, theta: np.ndarray, linear: np.ndarray, noise: tuple[float, float]
) -> np.ndarray:
    """Smallest covariance any unbiased estimate can have (all, all), at the true parameters.

    Parameters
    ----------
    theta, linear : the true parameters
    noise : true standard deviation of angle [rad] and rate [rad/s] readings
    """
    sigma = np.where(problem.is_rate, noise[1], noise[0])
    exact = problem.weighed(1.0 / sigma)
    quiet = replace(exact, measured=exact.predict(theta, linear), cache={})
    return covariance(whole_jacobian(quiet.solve(theta)))


def servo_study(seed):
    """One simulated servo: errors over Cramér–Rao, coverage, frequency response, delay."""
    rng = np.random.default_rng(seed)
    g = gimbal(rng)
    r = servo_record(rng, g)
    model = identify([r])
    channel = model.channels[0][0]
    truth = np.array(
        [math.log(2 * g.damping * g.frequency), 2 * math.log(g.frequency), g.delay, g.gain]
    )
    problem = assemble([r], 0, layout_of([r], 2, 0), shared_offset=False)
    bound = cramer_rao(problem, truth[:3], np.array([g.gain, 0.03, 0.1]), true_noise())
    z = (channel.parameters - truth) / np.sqrt(np.diag(bound)[:4])
    values = {"gain": g.gain, "delay": g.delay}
    values |= {"natural frequency": g.frequency, "damping": g.damping}
    inside = [
        e.interval[0] <= values[e.name.removeprefix("x/x ")] <= e.interval[1]
        for e in model.estimates
    ]
    return {
        "frequency error": frequency_error(model, g, g),
        "delay error": abs(channel.delay - g.delay),
        "z": z,
        "inside": inside,
    }


def servo_summary(seeds):
    found = [servo_study(seed) for seed in seeds]
    return {
        "frequency error, median": float(np.median([f["frequency error"] for f in found])),
        "delay error, median [ms]": 1e3 * float(np.median([f["delay error"] for f in found])),
        "delay error, rms [ms]": 1e3
        * float(np.sqrt(np.mean([f["delay error"] ** 2 for f in found]))),
        "error / Cramér–Rao": float(np.sqrt(np.mean([f["z"] ** 2 for f in found]))),
        "coverage of 95 % intervals": float(np.mean([f["inside"] for f in found])),
    }


COUPLED = (
    (Gimbal(55.0, 0.6, 0.012, 1.0), Gimbal(50.0, 0.7, 0.012, 0.05)),
    (Gimbal(60.0, 0.6, 0.015, -0.03), Gimbal(45.0, 0.8, 0.015, 0.95)),
)


def coupled_record(rng, duration=60.0, period=0.002):
    t = stamps(rng, duration, period, lost=0.0)
    at, u = random_steps(rng, duration, 0.4, 8.0, columns=2)
    pairs = [moved(row, t, at, u) for row in COUPLED]
    angle = np.stack([a for a, _ in pairs], axis=1)
    rate = np.stack([r for _, r in pairs], axis=1)
    angle, rate = sensed(rng, angle, rate)
    return measurement(t, u, command_time=at, before=[0.0, 0.0], angle=angle, rate=rate)


def coupled_study(seed, duration=60.0):
    """2×2 with cross coupling: worst error of any channel over its axis' own, and the time."""
    r = coupled_record(np.random.default_rng(seed), duration)
    begin = time.perf_counter()
    model = identify([r])
    took = time.perf_counter() - begin
    worst = max(
        frequency_error(model, COUPLED[i][j], COUPLED[i][i], (i, j))
        for i in range(2)
        for j in range(2)
    )
    return {"worst frequency error": worst, "seconds": took}


def rate_limited(t, at, u, frequency, damping, delay, limit, step=2e-5):
    """Angle and rate of a servo whose speed loop saturates, by small Euler–Cromer steps."""
    w = 2.0 * damping * frequency
    k = frequency**2 / w
    grid = np.arange(0.0, t[-1] + step, step)
    command = np.concatenate([[0.0], u])[np.searchsorted(at + delay, grid, side="right")]
    angle, rate = np.empty(len(grid)), np.empty(len(grid))
    y = v = 0.0
    decay = math.exp(-w * step)
    for i, c in enumerate(command):
        angle[i], rate[i] = y, v
        aim = min(max(k * (c - y), -limit), limit)
        new = aim + (v - aim) * decay
        y += 0.5 * (v + new) * step
        v = new
    return np.interp(t, grid, angle), np.interp(t, grid, rate)


def limited_study(seed, duration=12.0):
    """Rate-limited servo: errors of limit and linear part; was the plain linear fit flagged."""
    rng = np.random.default_rng(seed)
    frequency, damping = rng.uniform(25, 60), rng.uniform(0.5, 1.0)
    delay, limit = rng.uniform(0.005, 0.03), rng.uniform(0.8, 2.0)
    t = stamps(rng, duration, 0.005)
    at = np.arange(0.2, duration, 0.6) + rng.uniform(
        -0.02, 0.02, len(np.arange(0.2, duration, 0.6))
    )
    size = np.radians(rng.permutation(np.geomspace(0.5, 14.0, len(at))))
    u = size * np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    angle, rate = sensed(rng, *rate_limited(t, at, u, frequency, damping, delay, limit))
    r = measurement(t, u, command_time=at, before=[0.0], angle=angle, rate=rate)
    bounded = identify([r], servo=True)
    assert bounded.servo is not None
    linear = identify([r])
    truth = Gimbal(frequency, damping, delay, 1.0)
    return {
        "limit error": abs(bounded.servo[0].rate_limit.value / limit - 1.0),
        "frequency error": frequency_error(bounded, truth, truth),
        "flagged": any("rate-limited" in w for w in linear.warnings),
        "linear frequency error": frequency_error(linear, truth, truth),
        "structure": bounded.servo[0].structure,
    }


def prbs(stages=(9, 4), hold=7):
    """Maximum-length sequence of ±1, every value held for some samples."""
    register, bits = [1] * stages[0], []
    for _ in range(2 ** stages[0] - 1):
        bits.append(register[-1])
        register = [register[-1] ^ register[stages[1] - 1], *register[:-1]]
    return np.repeat(2.0 * np.array(bits) - 1.0, hold)


# Rao and Garnier, "Numerical illustrations of the relevance of direct continuous-time model
# identification", IFAC World Congress 2002: fourth order, non-minimum phase, 10 dB
RAO_GARNIER = ((-6400.0, 1600.0), (1.0, 5.0, 408.0, 416.0, 1600.0), 0.0, 0.01)
# second order with a long delay that is no multiple of the period, as in the CONTSID tutorials
DELAYED = ((2.0,), (0.25, 0.7, 1.0), 0.836, 0.05)


def benchmark_study(seed, num, den, delay, period, ratio=10.0, samples=6000):
    """One seed of a classical benchmark: parameters' errors and Cramér–Rao deviations."""
    rng = np.random.default_rng(seed)
    u = prbs() if len(den) > 3 else prbs(hold=20)[:samples]
    t = np.arange(len(u)) * period
    fine = 50 if delay else 1
    held = np.repeat(u, fine)
    late = round(delay / period * fine)
    held = np.concatenate([np.zeros(late), held])[: len(held)]
    system = control.ss(control.tf(num, den)).sample(period / fine, "zoh")
    _, y = control.forced_response(system, U=held)
    y = np.asarray(y)[::fine]
    sigma = math.sqrt(float(np.var(y)) / ratio)
    r = measurement(
        t, u, command_time=t, before=[0.0], angle=y + sigma * rng.normal(size=len(t)), scale=1.0
    )
    poles, zeros = len(den) - 1, len(num) - 1
    model = identify([r], poles, zeros, "free" if delay else 0.0, max_delay=2.0 if delay else None)
    channel = model.channels[0][0]
    found = [*np.array(channel.num), *np.array(channel.den)[1:]]
    lead = den[0]
    truth = [*np.array(num) / lead, *np.array(den)[1:] / lead]
    if delay:
        found, truth = [*found, channel.delay], [*truth, delay]
    return np.array(found) - np.array(truth), _bound(r, num, den, delay, sigma), np.array(truth)


def _bound(r, num, den, delay, sigma):
    """Cramér–Rao deviations of numerator, denominator and delay, by plain finite differences."""
    lead, n, m = den[0], len(den) - 1, len(num)
    at = np.array([*np.array(num) / lead, *np.array(den)[1:] / lead, delay])

    def response(p):
        g = control.ss(control.tf(p[:m], np.concatenate([[1.0], p[m : m + n]])))
        t = r.time
        # PRBS held over samples: an undelayed run on the samples' own grid, then shifted in time
        fine = np.arange(0.0, t[-1] + 1e-9, (t[1] - t[0]) / (10.0 if delay else 1.0))
        u = r.command.held(fine)[:, 0]
        _, y = control.forced_response(g.sample(fine[1], "zoh"), U=u)
        return np.interp(t - p[-1], fine, np.asarray(y), left=0.0)

    columns = []
    for i in range(len(at) if delay else len(at) - 1):
        shift = np.zeros(len(at))
        shift[i] = 1e-5 * max(abs(at[i]), 0.1)
        columns.append((response(at + shift) - response(at - shift)) / (2.0 * shift[i]))
    j = np.column_stack([*columns, np.ones(len(r.time))]) / sigma
    return np.sqrt(np.diag(np.linalg.inv(j.T @ j)))[:-1]


def benchmark_summary(seeds, case):
    studies = [benchmark_study(seed, *case) for seed in seeds]
    errors = np.array([e for e, _, _ in studies])
    bound = np.mean([b for _, b, _ in studies], axis=0)
    n = len(studies)
    return {
        "bias / (Cramér–Rao/√n), each": np.abs(errors.mean(axis=0)) / (bound / math.sqrt(n)),
        "bias / Cramér–Rao, each": np.abs(errors.mean(axis=0)) / bound,
        "std / Cramér–Rao, each": errors.std(axis=0, ddof=1) / bound,
        "std / Cramér–Rao": float(np.sqrt(np.mean((errors.std(axis=0, ddof=1) / bound) ** 2))),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="?", type=int, default=200)
    parser.add_argument("--only", choices=("servos", "coupled", "limited", "rao", "delayed"))
    options = parser.parse_args()
    few = min(options.seeds, 40)
    studies = {
        "servos": lambda: servo_summary(range(options.seeds)),
        "coupled": lambda: coupled_study(0),
        "limited": lambda: _limited_summary(range(few)),
        "rao": lambda: benchmark_summary(range(few), RAO_GARNIER),
        "delayed": lambda: benchmark_summary(range(few), DELAYED),
    }
    identify([servo_record(np.random.default_rng(0), Gimbal(40.0, 0.7, 0.01, 1.0))])  # compile
    for name, study in studies.items():
        if options.only in (None, name):
            begin = time.perf_counter()
            print(name)
            for key, value in study().items():
                print(f"  {key:34s} {np.array2string(np.asarray(value), precision=4)}")
            print(f"  took {time.perf_counter() - begin:.1f} s", flush=True)


def _limited_summary(seeds):
    found = [limited_study(seed) for seed in seeds]
    return {
        "limit error, median and worst": [
            f([s["limit error"] for s in found]) for f in (np.median, np.max)
        ],
        "frequency error, median and worst": [
            f([s["frequency error"] for s in found]) for f in (np.median, np.max)
        ],
        "linear fit: frequency error, median": np.median(
            [s["linear frequency error"] for s in found]
        ),
        "linear fit flagged": np.mean([s["flagged"] for s in found]),
        "speed structure found": np.mean([s["structure"] == "speed" for s in found]),
    }


if __name__ == "__main__":
    main()
