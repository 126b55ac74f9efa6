"""Miss of a point at 500 m in the thesis's cone, in wind with gusts of 20 %, over seeds.

python -m tests.benchmarks.point [FIRST] [COUNT] [GIMBAL]
"""

import sys

import numpy as np

from tests.twin.loop.test_guidance import closest, random_case


def main(first: int = 1000, count: int = 40, gimbal: str = "transfer-function") -> None:
    """Print each seed that misses by more than 1 m, then the figures of all."""
    misses = []
    for seed in range(first, first + count):
        place, wind, azimuth = random_case(seed)
        misses.append(closest(place, wind, azimuth, 0.2, seed, gimbal))
        if misses[-1] > 1.0:
            print(f"seed {seed}: {misses[-1]:.2f} m, off {place} degrees, wind {wind:.2f} m/s")
    seeds = f"seeds {first} to {first + count - 1}"
    inside = np.mean(np.array(misses) < 1.0)
    print(f"{gimbal}, {seeds}: within 1 m {inside:.1%}, median {np.median(misses):.3f} m,")
    print(f"  largest {max(misses):.3f} m")


if __name__ == "__main__":
    first, count, *gimbal = sys.argv[1:] or ("1000", "40")
    main(int(first), int(count), *gimbal)
