"""Figures of the rig's sensing half, over many seeded rigs.

python -m tests.benchmarks.rig_studies calibration [RIGS]
python -m tests.benchmarks.rig_studies fusion [RIGS]
python -m tests.benchmarks.rig_studies nees [SEEDS]
python -m tests.benchmarks.rig_studies faults [RIGS]
python -m tests.benchmarks.rig_studies alarms [SECONDS PER RIG] [RIGS]
python -m tests.benchmarks.rig_studies servos [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies table [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies quiet [SECONDS PER RUN] [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies plant [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies plant_drift [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies plant_quiet [SECONDS PER RUN] [RIGS] [FIRST SEED]
python -m tests.benchmarks.rig_studies cost
"""

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from math import degrees, radians

import numpy as np
from scipy import stats

from hardware.emulator import parse, sample_rig
from hardware.emulator.truth import exact_calibration
from tests.benchmarks.rig_studies_plant import plant, plant_drift, plant_quiet
from tests.benchmarks.rig_studies_servos import quiet, servos, table
from tests.hardware.trial import calibrate, random_steps, run

WORKERS = 2
SETTLED = 2.0  # s after which the gyro's bias is known
ONSET, LENGTH = 4.0, 4.0  # of a fault


def calibration_error(seed):
    """Zero [°], matrix (relative), and their errors over the stated deviations."""
    parameters = sample_rig(seed)
    got, true = calibrate(parameters, seed=seed), exact_calibration(parameters)
    M, X = np.array(got.matrix), np.array(true.matrix)
    error = np.array(got.zero) - true.zero
    zero = np.degrees(M @ error)
    scale = np.abs(np.diag(X))[:, None]
    z_zero = error / np.sqrt(np.diag(got.zero_covariance))
    z_matrix = (M - X).ravel() / np.sqrt(np.diag(got.matrix_covariance))
    return zero, (M - X) / scale, np.concatenate([z_zero, z_matrix])


def calibration(rigs=200):
    with ProcessPoolExecutor(WORKERS) as pool:
        results = list(pool.map(calibration_error, range(rigs)))
    zero = np.array([r[0] for r in results])
    matrix = np.array([r[1] for r in results])
    z = np.array([r[2] for r in results])
    print(f"calibration of {rigs} rigs")
    print(f"  zero: worst {np.abs(zero).max():.3f}°, rms {zero.std():.3f}° (claim 0.15°)")
    print(f"  matrix: worst {100 * np.abs(matrix).max():.2f} %, rms {100 * matrix.std():.2f} %")
    inside = np.abs(z) < 1.96
    print(f"  stated 95 % intervals cover zero {100 * inside[:, :2].mean():.1f} %,")
    print(f"  matrix {100 * inside[:, 2:].mean():.1f} % (claim 90–98 %)")


def fusion_error(seed):
    """Rms of the fused angles (2,) and of the potentiometers (4,) [rad], and changes of health."""
    trial = run(sample_rig(seed), random_steps(seed), 12.0, seed=seed)
    late = trial.time > SETTLED
    single = trial.potentiometer - trial.true_angle[:, [0, 0, 1, 1]]
    return trial.error(SETTLED), np.sqrt((single[late] ** 2).mean(axis=0)), len(trial.changes)


def fusion(rigs=40):
    with ProcessPoolExecutor(WORKERS) as pool:
        results = list(pool.map(fusion_error, range(rigs)))
    fused = np.degrees([r[0] for r in results])
    single = np.degrees([r[1] for r in results])
    better = np.minimum(single[:, [0, 2]], single[:, [1, 3]])
    ratio = better / fused
    print(f"fusion on {rigs} rigs, random steps within ±6°")
    print(f"  fused {np.sqrt((fused**2).mean()):.4f}° rms, worst rig {fused.max():.4f}°")
    print(f"  better potentiometer {np.sqrt((better**2).mean()):.4f}° rms")
    print(f"  ratio median {np.median(ratio):.2f}, worst {ratio.min():.2f} (claim 2)")


def nees(seeds=100):
    from tests.hardware.matched import run_matched

    values = run_matched(seeds)
    n = 3 * seeds
    low, high = stats.chi2.ppf([0.025, 0.975], n) / seeds
    mean = values.mean(axis=0)
    inside = ((mean > low) & (mean < high)).mean()
    print(f"NEES of (angle, rate, bias) over {seeds} seeds: mean {mean.mean():.3f},")
    print(f"  95 % band {low:.3f}…{high:.3f}, {100 * inside:.1f} % of the instants inside")


FAULTS = {
    "potentiometer_x_a:glitch:0.2": ("potentiometer_x_a", 0.050, 1.5),
    "potentiometer_y_b:open": ("potentiometer_y_b", 0.050, 1.5),
    "potentiometer_x_b:stuck": ("potentiometer_x_b", 0.050, 1.5),
    "supply:sag:0.1": ("supply", 0.300, 3.0),
    "gyro:bias:20": ("gyro", 0.300, 1.5),
}


def _fault(job):
    name, seed = job
    end = ONSET + LENGTH
    parameters, command = sample_rig(seed), random_steps(seed)
    fault = parse(f"{name}@{ONSET}-{end}")
    bad = run(parameters, command, end + 0.1, injections=(fault,), seed=seed)
    good = run(parameters, command, end + 0.1, seed=seed)
    start = ONSET
    if fault.kind == "stuck":
        axis = 0 if "_x_" in name else 1
        during = bad.time >= ONSET
        moved = np.abs(bad.true_angle[during, axis] - bad.true_angle[during, axis][0])
        start = float(bad.time[during][np.argmax(moved > radians(1.0))])
    named = bad.named(ONSET)
    sensor = FAULTS[name][0]
    delay = named.get(sensor, np.inf) - start
    wrong = [n for n, t in named.items() if n != sensor and t < end]
    return name, delay, wrong, bad.error(ONSET, end), good.error(ONSET, end)


def faults(rigs=40):
    jobs = [(name, seed) for name in FAULTS for seed in range(rigs)]
    with ProcessPoolExecutor(WORKERS) as pool:
        results = list(pool.map(_fault, jobs))
    print(f"faults for {LENGTH:g} s on {rigs} rigs each; error over the whole fault")
    for name, (_, limit, allowed) in FAULTS.items():
        rows = [r for r in results if r[0] == name]
        delay = np.array([r[1] for r in rows])
        wrong = sum(bool(r[2]) for r in rows)
        bad = np.sqrt(np.mean([r[3] ** 2 for r in rows]))
        good = np.sqrt(np.mean([r[4] ** 2 for r in rows]))
        print(
            f"  {name:30s} named after {1e3 * np.median(delay):4.0f} ms median, "
            f"{1e3 * delay.max():4.0f} ms worst, {(delay <= limit).mean():.0%} within "
            f"{1e3 * limit:.0f} ms; wrong name {wrong}; error {degrees(bad):.4f}° / "
            f"{degrees(good):.4f}° = {bad / good:.2f} (claim {allowed})"
        )


def _alarms(job):
    seed, duration = job
    calibration = calibrate(sample_rig(seed), seed=seed)
    trial = run(
        sample_rig(seed), random_steps(seed), duration, seed=seed + 1000, calibration=calibration
    )
    named = [c for c in trial.changes if c.new == "faulty"]
    return seed, named


def alarms(duration=600, rigs=12):
    with ProcessPoolExecutor(WORKERS) as pool:
        results = list(pool.map(_alarms, [(s, duration) for s in range(rigs)]))
    hours = duration * rigs / 3600
    count = sum(len(r[1]) for r in results)
    print(f"false alarms: {count} in {hours:.2f} h of calibrated healthy rigs (claim < 1/h)")
    for seed, named in results:
        for change in named:
            print(f"  rig {seed}: {change}")


def cost():
    parameters = sample_rig(0)
    from hardware.emulator import Emulator
    from hardware.fusion import Fusion
    from hardware.rig import in_process

    device = Emulator(parameters)
    rig = in_process(device)
    rig.connect()
    frames = []
    while len(frames) < 5000:
        device.advance_us(2000)
        frames += rig.poll()
    fusion = Fusion(exact_calibration(parameters))
    spent = np.empty(len(frames))
    for i, frame in enumerate(frames):
        start = time.perf_counter_ns()
        fusion.update(frame)
        spent[i] = time.perf_counter_ns() - start
    p50, p99 = np.percentile(spent[100:], [50, 99]) / 1e3
    print(f"fusion and fault detection, both axes: p50 {p50:.0f} µs, p99 {p99:.0f} µs (claim 75)")


STUDIES = {
    f.__name__: f
    for f in (
        *(calibration, fusion, nees, faults, alarms),
        *(servos, table, quiet, plant, plant_drift, plant_quiet, cost),
    )
}


def main(arguments):
    names = [a for a in arguments if not a.isdigit()] or list(STUDIES)
    numbers = [int(a) for a in arguments if a.isdigit()]
    for name in names:
        start = time.perf_counter()
        STUDIES[name](*(numbers if len(names) == 1 else ()))
        print(f"  ({time.perf_counter() - start:.0f} s)", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
