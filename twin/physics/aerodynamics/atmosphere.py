"""Air at rest and in motion: ICAO standard atmosphere, mean wind, turbulence."""

import math
from typing import Final

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from hardware.parts import STANDARD_GRAVITY as GRAVITY

# ICAO Doc 7488/3, Manual of the ICAO Standard Atmosphere
SEA_LEVEL_DENSITY: Final = 1.225  # kg/m³
SEA_LEVEL_TEMPERATURE: Final = 288.15  # K
LAPSE: Final = 0.0065  # K/m
GAS_CONSTANT: Final = 287.05287  # J/(kg K)
EARTH_RADIUS: Final = 6356766.0  # m
TROPOPAUSE: Final = 11000.0  # m, geopotential

_EXPONENT: Final = GRAVITY / (LAPSE * GAS_CONSTANT) - 1.0
_TROPOPAUSE_RATIO: Final = 1.0 - LAPSE * TROPOPAUSE / SEA_LEVEL_TEMPERATURE
_TROPOPAUSE_DENSITY: Final = SEA_LEVEL_DENSITY * _TROPOPAUSE_RATIO**_EXPONENT
_SCALE_HEIGHT: Final = GAS_CONSTANT * SEA_LEVEL_TEMPERATURE * _TROPOPAUSE_RATIO / GRAVITY
HEAT_RATIO: Final = 1.4  # of the specific heats of air
LOWEST, HIGHEST = -5000.0, 20000.0  # m, of the layers modelled here

# length of von Kármán's spectrum over its integral length, 1.339: Γ(1/3) / (√π Γ(5/6))
KARMAN: Final = math.gamma(1 / 3) / (math.sqrt(math.pi) * math.gamma(5 / 6))
COLUMNS: Final = 5  # of a profile: height, wind to east and north, density, temperature
EAST, NORTH, DENSITY, TEMPERATURE = range(1, COLUMNS)
MODE: Final = 7  # numbers per gust mode: wave vector (3), direction (3), phase


@register_jitable
def _geopotential(altitude: float) -> float:
    bounded = min(max(altitude, LOWEST), HIGHEST)
    return EARTH_RADIUS * bounded / (EARTH_RADIUS + bounded)


@register_jitable
def temperature(altitude: float) -> float:
    """Temperature of the ICAO standard atmosphere [K] at a geometric altitude [m], as `density`."""
    return SEA_LEVEL_TEMPERATURE - LAPSE * min(_geopotential(altitude), TROPOPAUSE)


@register_jitable
def speed_of_sound(altitude: float) -> float:
    """Speed of sound in the ICAO standard atmosphere [m/s] at a geometric altitude [m]."""
    return sound(temperature(altitude))


@register_jitable
def sound(kelvin: float) -> float:
    """Speed of sound in air of that temperature [m/s]."""
    speed: float = np.sqrt(HEAT_RATIO * GAS_CONSTANT * kelvin)
    return speed


@register_jitable
def density(altitude: float) -> float:
    """Density of the ICAO standard atmosphere [kg/m³].

    `altitude` is geometric, above mean sea level [m]; held constant below -5 km and above 20 km,
    where the two layers modelled here end. Source: ICAO Doc 7488/3.
    """
    geopotential = _geopotential(altitude)
    if geopotential <= TROPOPAUSE:
        ratio = 1.0 - LAPSE * geopotential / SEA_LEVEL_TEMPERATURE
        low: float = SEA_LEVEL_DENSITY * ratio**_EXPONENT
        return low
    high: float = _TROPOPAUSE_DENSITY * np.exp((TROPOPAUSE - geopotential) / _SCALE_HEIGHT)
    return high


@register_jitable
def profile_at(profile: NDArray[np.float64], column: int, height: float) -> float:
    """A column of a profile at a height above ground [m], linear between its levels.

    `profile` (5 n,): n heights ascending [m], then n values each of the wind to the east and to
    the north [m/s], the density [kg/m³] and the temperature [K]. Constant outside.
    """
    count = profile.size // COLUMNS
    first = column * count
    low, high = 0, count - 1
    if height <= profile[0]:
        return float(profile[first])
    if height >= profile[high]:
        return float(profile[first + high])
    while high - low > 1:
        middle = (low + high) // 2
        if height >= profile[middle]:
            low = middle
        else:
            high = middle
    share = (height - profile[low]) / (profile[high] - profile[low])
    return float(profile[first + low] + share * (profile[first + high] - profile[first + low]))


@register_jitable
def mean_wind(speed: float, height: float, reference: float, exponent: float) -> float:
    """Mean wind at a height above ground [m/s]: power law, constant with exponent 0.

    `speed` [m/s] holds at the height `reference` [m]; none below the ground. Exponent 1/7 over
    open country: Counihan (1975), Atmospheric Environment 9, 871-905.
    """
    if height <= 0.0:
        return 0.0
    if exponent == 0.0:
        return speed
    aloft: float = speed * (height / reference) ** exponent
    return aloft


@register_jitable
def gust(
    modes: NDArray[np.float64], count: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Turbulent velocity at a point that drifts with the air, of unit variance: `gust_modes`.

    `modes` (7 count,): see `gust_modes`; x, y, z [m].
    """
    u, v, w = 0.0, 0.0, 0.0
    for k in range(0, MODE * count, MODE):
        wave = np.cos(modes[k] * x + modes[k + 1] * y + modes[k + 2] * z + modes[k + 6])
        u += modes[k + 3] * wave
        v += modes[k + 4] * wave
        w += modes[k + 5] * wave
    return u, v, w


@register_jitable
def wind(
    x: float,
    y: float,
    z: float,
    time: float,
    speed: float,
    azimuth: float,
    exponent: float,
    reference: float,
    turbulence: float,
    modes: NDArray[np.float64],
    profile: NDArray[np.float64],
) -> tuple[float, float, float]:
    """Velocity of the air at a point above ground, world frame [m/s]: mean wind and gusts.

    x, y, z [m], `time` [s]; `speed`, `exponent` and `reference` as for `mean_wind`, `azimuth`
    [rad] from east to north where it blows to; gusts of rms `turbulence` · `speed`, taken over
    the three components, a frozen field (Taylor's hypothesis) that travels with `speed` at every
    height. A `profile` (see `profile_at`) that is not empty takes the place of the mean wind.
    """
    east, north = np.cos(azimuth), np.sin(azimuth)
    if profile.size > 0:
        mean_east, mean_north = profile_at(profile, EAST, z), profile_at(profile, NORTH, z)
    else:
        mean = mean_wind(speed, z, reference, exponent)
        mean_east, mean_north = mean * east, mean * north
    sigma = speed * turbulence
    if sigma == 0.0:
        return mean_east, mean_north, 0.0
    drift = speed * time
    u, v, w = gust(modes, modes.size // MODE, x - drift * east, y - drift * north, z)
    return mean_east + sigma * u, mean_north + sigma * v, sigma * w


def gust_modes(
    seed: int, length: float, count: int, *, dryden: bool = False
) -> NDArray[np.float64]:
    """Random Fourier modes of isotropic turbulence of unit variance, (7 count,).

    The variances of the three components add up to 3 in every field; each is 1 in the mean over
    seeds, and with 16 modes one component's rms scatters by 13 % about it.

    A frozen field: a function of position alone, so it needs no state, and divergence-free, since
    every mode's direction is normal to its wave vector. Method: Kraichnan (1970), Physics of
    Fluids 13, 22-31; energy spectrum of von Kármán (1948), PNAS 34, 530-539, of integral
    `length` [m], whose spectrum's own length is 1.339 times it. Wave numbers are spaced evenly in
    the logarithm over the two decades that hold nine tenths of the energy.

    With `dryden` the spectra are Dryden's, longitudinal σ²·2L/π / (1 + (LΩ)²) (MIL-F-8785C, 3.7.1),
    for isotropic turbulence E(κ) = 8σ²L/π · (Lκ)⁴ / (1 + (Lκ)²)³; each mode's wave number is
    random within its share of the energy, so that the mean over seeds has that spectrum.
    """
    rng = np.random.default_rng(seed)
    if dryden:
        return _modes(rng, *_dryden_waves(rng, count), length)
    edges = np.geomspace(0.3, 30.0, count + 1)
    centre = np.sqrt(edges[1:] * edges[:-1])  # κ times the spectrum's own length
    energy = centre**4 / (1.0 + centre**2) ** (17 / 6) * np.diff(edges)
    amplitude = np.sqrt(2.0 * 3.0 * energy / energy.sum())  # Σ amplitude²/2 = 3 components
    return _modes(rng, centre, amplitude, KARMAN * length)


def _dryden_waves(
    rng: np.random.Generator, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Wave numbers κL and amplitudes (count,) of Dryden's energy spectrum, unit variance."""

    def below(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of the energy below κL = x: the integral of E, in closed form."""
        return np.asarray(
            2.0 / np.pi * (np.arctan(x) - (5.0 * x**3 + 3.0 * x) / (3.0 * (1.0 + x * x) ** 2))
        )

    grid = np.geomspace(1e-3, 1e5, 4000)
    edges = np.concatenate([[0.0], below(np.geomspace(0.3, 100.0, count - 1)), [1.0]])
    shares = np.diff(edges)
    waves = np.interp(edges[:-1] + rng.uniform(size=count) * shares, below(grid), grid)
    return waves, np.sqrt(2.0 * 3.0 * shares)


def _modes(
    rng: np.random.Generator,
    centre: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    length: float,
) -> NDArray[np.float64]:
    """Modes of those wave numbers times `length`, in random directions with random phases."""
    count = centre.size
    heading = _unit(rng.normal(size=(count, 3)))
    across = _unit(np.cross(heading, rng.normal(size=(count, 3))))
    phase = rng.uniform(0.0, 2.0 * np.pi, size=(count, 1))
    modes = [heading * (centre / length)[:, None], across * amplitude[:, None], phase]
    return np.hstack(modes).ravel()


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
