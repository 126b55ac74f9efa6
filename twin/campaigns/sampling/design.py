"""Designs: which uniform numbers a run gets. Each parameter has its own stream, by its name."""

import functools
import hashlib
from collections.abc import Sequence

import numpy as np
import scipy  # its part `stats` takes half a second and is loaded where it is used
from numpy.typing import NDArray

from twin.errors import TwinError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
KINDS = ("grid", "random", "lhs", "sobol", "sensitivity", "star")
BLOCK = 1024  # numbers made together; a run's numbers do not depend on the size of the campaign
MOST_DIMENSIONS = 21201  # of `scipy.stats.qmc.Sobol`
BITS = 52
INSIDE = 0.5**53  # distance from 0 and 1 that every number keeps


class Streams:
    """Uniform numbers (0, 1) for every stream name and sample number.

    Streams are independent of each other and of how many there are. With `sobol` a stream takes
    the next dimension of the sequence in the order of `names`, under a digital shift of its own,
    so that a parameter added at the end changes no other's numbers.

    Parameters
    ----------
    kind : `random`, `lhs` (Latin hypercube of `n` samples) or `sobol`
    n : samples
    seed : of all streams
    names : of all streams
    """

    def __init__(self, kind: str, n: int, seed: int, names: Sequence[str]) -> None:
        self._kind, self._n, self._seed = kind, n, seed
        self._dimension = {name: k for k, name in enumerate(names)}
        if kind == "sobol" and len(names) > MOST_DIMENSIONS:
            raise TwinError(f"[design] sobol: has at most {MOST_DIMENSIONS} dimensions")
        self._block = functools.lru_cache(maxsize=4 * len(names) + 4)(self._made)

    def uniform(self, name: str, samples: Integers) -> Array:
        """Numbers of a stream for sample numbers (n,)."""
        out = np.empty(len(samples))
        blocks = samples // BLOCK
        for block in np.unique(blocks).tolist():
            here = blocks == block
            out[here] = self._block(name, block)[samples[here] - block * BLOCK]
        return np.clip(out, INSIDE, 1.0 - INSIDE)

    def _made(self, name: str, block: int) -> Array:
        if self._kind == "sobol":
            return self._sobol(name, block)
        jitter = self._random(name, block)
        if self._kind == "lhs":
            order = self._order(name)[block * BLOCK : (block + 1) * BLOCK]
            return (order + jitter[: len(order)]) / self._n
        return jitter

    def _random(self, name: str, block: int) -> Array:
        bits = np.random.Philox(key=_key(self._seed, name), counter=[0, block, 0, 0])
        return np.random.Generator(bits).random(BLOCK)

    @functools.cached_property
    def _orders(self) -> dict[str, Integers]:
        return {}

    def _order(self, name: str) -> Integers:
        """Strata (n,) of a Latin hypercube, in random order."""
        if name not in self._orders:
            bits = np.random.Philox(key=_key(self._seed, f"{name}/order"))
            self._orders[name] = np.random.Generator(bits).permutation(self._n)
        return self._orders[name]

    def _sobol(self, name: str, block: int) -> Array:
        """A block of one dimension of the sequence, its bits flipped by the stream's own pattern.

        A random digital shift keeps the net and makes every point uniform (Owen, Quasi-Monte Carlo
        sampling, 2003, §4).
        """
        dimension = self._dimension[name]
        engine = scipy.stats.qmc.Sobol(dimension + 1, scramble=False, bits=30)
        if block:
            engine.fast_forward(block * BLOCK)
        points = engine.random(BLOCK)[:, dimension]
        scale = 2.0**30
        shift = int(_key(self._seed, name)[0]) % (1 << 30)
        flipped = (points * scale).astype(np.int64) ^ shift
        return (flipped + self._random(f"{name}/fine", block)) / scale


def _key(seed: int, name: str) -> NDArray[np.uint64]:
    """Key (2,) of a stream: the seed and a digest of its name."""
    digest = hashlib.sha256(f"{seed}\x00{name}".encode()).digest()
    return np.frombuffer(digest[:16], np.uint64)
