"""The numerics a model carries for the compiled forces: name, size, unit, meaning, default.

docs/aerodynamics.md shows the same table; `bind` checks a model against it.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Numeric:
    """One `<numeric>` of the MJCF; `size` is the least it must have."""

    name: str
    size: int
    unit: str
    meaning: str
    default: str


NUMERICS: Final = (
    Numeric("air_enabled", 1, "-", "1: forces of the air act, 0: vacuum", "1"),
    Numeric("air_model", 1, "-", "crossflow: 0 strip integral, 1 area moments of the thesis", "0"),
    Numeric("air_altitude", 1, "m", "launch site (world z = 0) above mean sea level", "0"),
    Numeric("air_crossflow_drag", 1, "-", "crossflow drag coefficient C_dc", "0.84"),
    Numeric("air_strip_z", 2, "m", "stations of the crossflow quadrature", "from geometry"),
    Numeric("air_strip_area", 2, "m²", "silhouette b dz of each station", "from geometry"),
    Numeric("air_reference_area", 1, "m²", "cross-section that coefficients refer to", "π d²/4"),
    Numeric("air_axial_drag", 1, "-", "axial drag coefficient C_A", "0.5"),
    Numeric("air_nose_slope", 1, "1/rad", "normal force slope C_Nα of nose (and steps)", "2"),
    Numeric("air_nose_z", 1, "m", "centre of pressure of each", "from geometry"),
    Numeric("air_fin_slope", 1, "1/rad", "C_Nα of each fin set with the body", "from geometry"),
    Numeric("air_fin_z", 1, "m", "centre of pressure of each", "from geometry"),
    Numeric("air_roll_damping", 1, "m⁴", "slope · Σ∫ c y² dy over the fins", "from geometry"),
    Numeric("air_thesis_radius", 1, "m", "r_ref of the area-moment form", "from geometry"),
    Numeric("air_thesis_offset", 1, "m/s", "∂v_ref of the area-moment form", "0.1"),
    Numeric("wind_speed", 1, "m/s", "mean wind at the reference height", "0"),
    Numeric("wind_azimuth", 1, "rad", "direction that the wind blows to, from east to north", "0"),
    Numeric("wind_exponent", 1, "-", "power law of height; 0: constant", "1/7"),
    Numeric("wind_reference_height", 1, "m", "height above ground of `wind_speed`", "10"),
    Numeric("wind_turbulence", 1, "-", "gust rms over `wind_speed`, mean of the components", "0"),
    Numeric("wind_length", 1, "m", "integral length of the turbulence", "150"),
    Numeric("wind_seed", 1, "-", "seed of the gusts, a whole number", "0"),
    Numeric("wind_modes", 7, "-", "written by `bind` from seed and length; zeros", "size 112"),
    Numeric("ramp_position", 3, "m", "rest position of the lower lug", "0 0 0.5"),
    Numeric("ramp_elevation", 1, "rad", "above the horizon", "0.8727"),
    Numeric("ramp_azimuth", 1, "rad", "from east to north", "0"),
    Numeric("ramp_length", 1, "m", "travel of a lug on the ramp; 0: no ramp", "2"),
    Numeric("ramp_lug", 2, "m", "stations of the lower and the upper lug; equal: one lug", "-"),
    Numeric("ramp_stiffness", 1, "N/m", "of a lug against the rail; 0: rigid rail", "0"),
    Numeric("ramp_damping", 1, "N s/m", "of a lug against an elastic rail", "0"),
    Numeric("motor_time", 2, "s", "thrust curve: time after ignition", "H13ST"),
    Numeric("motor_thrust", 2, "N", "thrust curve; padded with zeros", "H13ST"),
    Numeric("motor_impulse", 1, "N s", "integral of the thrust curve", "H13ST"),
    Numeric("motor_ignition", 1, "s", "simulation time of ignition", "0"),
    Numeric("motor_propellant_mass", 1, "kg", "before ignition", "0.1164"),
    Numeric("motor_loaded_mass", 1, "kg", "casing and propellant", "0.2034"),
    Numeric("motor_length", 1, "m", "casing, upward from the nozzle site", "0.2134"),
    Numeric("motor_diameter", 1, "m", "casing", "0.029"),
    Numeric("motor_grain_length", 1, "m", "grain before ignition, centred in the casing", "0.1394"),
    Numeric("motor_grain_radius", 1, "m", "outer radius of the grain", "0.0125"),
    Numeric("motor_burn", 1, "-", "grain: 0 burns from the core outward, 1 from its end", "1"),
)
# a model may lack these; their force is then absent
OPTIONAL: Final = (
    Numeric("air_roll_forcing", 1, "m³", "optional: slope · Σ∫ c y dy · cant of the fins", "0"),
    Numeric(
        "air_pitch_damping", 1, "m⁴", "optional: damping across the axis beyond local flow", "0"
    ),
    Numeric(
        "air_drag_mach", 2, "-", "optional: Mach numbers of the drag tables, ascending", "none"
    ),
    Numeric("air_drag_coasting", 2, "-", "optional: C_A at these, motor off", "none"),
    Numeric("air_drag_thrusting", 2, "-", "optional: C_A at these, motor on", "none"),
    Numeric("wind_model", 1, "-", "optional: gust spectrum, 0 von Kármán, 1 Dryden", "0"),
    Numeric(
        "gravity_radius", 1, "m", "optional: Earth's radius, so that gravity falls; 0: not", "0"
    ),
    Numeric("motor_misalignment", 2, "rad", "optional: thrust turned about nozzle x and y", "0 0"),
    Numeric("motor_swirl", 1, "m", "optional: roll moment of the jet over its thrust", "0"),
    Numeric(
        "chute_drag_area", 1, "m²", "optional: drag coefficient × area of each parachute", "none"
    ),
    Numeric("chute_delay", 1, "s", "optional: opens so long after burnout; negative: off", "none"),
    Numeric(
        "chute_height", 1, "m", "optional: opens on the way down below it; negative: off", "none"
    ),
    Numeric("chute_z", 1, "m", "optional: station that each pulls at", "none"),
    Numeric(
        "air_profile",
        10,
        "-",
        "optional: heights, wind to east, north, density, temperature",
        "none",
    ),
)
ALL: Final = NUMERICS + OPTIONAL
BODIES: Final = ("vehicle", "gimbal_propellant")
SITES: Final = ("gimbal_nozzle",)
INDEX: Final = "native_index"

SLOT: Final = {numeric.name: k for k, numeric in enumerate(ALL)}
