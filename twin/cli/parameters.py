"""`twin parameters`: every name that `--set` takes, with its value, unit and meaning."""

from dataclasses import dataclass

import numpy as np

from twin.config import ListParameters
from twin.config.result import Result, Rows
from twin.physics.native.names import ALL, Numeric
from twin.plant.compiled import compiled
from twin.plant.model.model import ModelConfig, load
from twin.plant.model.overrides import DECIDED
from twin.plant.model.overrides import parameters as values_of

MOST_SHOWN = 4  # values of one parameter
NOT_SIMULATED = "gimbal_print_", "print_"  # dimensions of printed parts
# numerics of the mechanism, the benches and the attitude loop: those of the forces stand in ALL
OTHERS = (
    Numeric("control_limit", 1, "rad", "largest commanded gimbal angle, either way", ""),
    Numeric("control_kp", 1, "1/s²", "proportional gain of the attitude loop", ""),
    Numeric("control_ki", 1, "1/s³", "integral gain", ""),
    Numeric("control_kd", 1, "1/s", "rate gain", ""),
    Numeric("control_cutoff", 1, "rad/s", "cut-off of the low-pass of the rate", ""),
    Numeric("control_rate_limit", 1, "rad/s", "limit of the commanded rate; 0: off", ""),
    Numeric("control_error_limit", 1, "rad", "limit of the attitude error", ""),
    Numeric("control_authority_floor", 1, "1/s²", "below it the gimbal is centred", ""),
    Numeric("gimbal_servo_resistance", 1, "Ω", "winding of the servo motors", ""),
    Numeric("gimbal_servo_motor_constant", 1, "N m/A", "torque and back-EMF at the shaft", ""),
    Numeric("gimbal_servo_voltage", 1, "V", "supply of the servos", ""),
    Numeric("gimbal_servo_gain", 1, "N m/rad", "position gain of the servos", ""),
    Numeric("gimbal_servo_rate_gain", 1, "N m s/rad", "velocity feedback; 0: none", ""),
    Numeric("gimbal_servo_slew", 1, "rad/s", "speed limit of the set point; 0: none", ""),
    Numeric("gimbal_servo_dead_band", 1, "rad", "half width of the dead band; 0: none", ""),
    Numeric("gimbal_backlash", 1, "rad", "gear play at the horn, stop to stop; 0: none", ""),
    Numeric("gimbal_stroke", 1, "rad", "largest command that the mechanism is made for", ""),
    Numeric("gimbal_closure_limit", 1, "m", "gap of a rod that counts as diverged", ""),
    Numeric("switch_angle", 4, "rad", "angles at which the limit switches close", ""),
    Numeric("turntable_lead", 2, "s, s²", "feed-forward of the base servo", ""),
    Numeric("gravity", 3, "m/s²", "acceleration of gravity", ""),
)
# of elements: unit and meaning by attribute
ATTRIBUTES = {
    "mass": ("kg", "mass of the body; its inertia follows"),
    "inertia": ("kg m²", "principal moments of inertia of the body"),
    "pos": ("m", "position of the body in its parent"),
    "stiffness": ("N m/rad", "spring of the joint"),
    "range": ("rad", "stops of the joint"),
    "damping": ("N m s/rad", "viscous friction of the joint"),
    "armature": ("kg m²", "inertia of the drive, at the joint"),
    "frictionloss": ("N m", "dry friction of the joint"),
    "ctrlrange": ("rad", "limits of the command of the actuator"),
    "forcerange": ("N m", "limits of the torque of the actuator"),
}
KNOWN = {numeric.name: numeric for numeric in (*ALL, *OTHERS)}


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model; with several values each is set by its index, NAME[0]."""

    name: str
    values: tuple[float, ...]
    unit: str
    meaning: str


@dataclass(frozen=True)
class ParametersResult(Result):
    """Parameters of a model."""

    parameters: tuple[Parameter, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values: by name, the value or values, unit and meaning."""
        return {
            p.name: {
                "value": p.values[0] if len(p.values) == 1 else list(p.values),
                "unit": p.unit,
                "meaning": p.meaning,
            }
            for p in self.parameters
        }

    def rows(self) -> Rows:
        """One row a parameter."""
        rows: Rows = []
        for p in self.parameters:
            shown = " ".join(f"{v:.5g}" for v in p.values[:MOST_SHOWN])
            more = f" … ({len(p.values)})" if len(p.values) > MOST_SHOWN else ""
            name = f"{p.name}[0…{len(p.values) - 1}]" if len(p.values) > 1 else p.name
            rows.append((name, f"{shown}{more} {p.unit}".ljust(24) + f" {p.meaning}"))
        return rows


def parameters(config: ListParameters) -> ParametersResult:
    """List the parameters of a model whose name or meaning contains every word.

    Raises
    ------
    TwinError : a file, name or number that cannot be used, in one line
    """
    with compiled():
        model = load(
            ModelConfig(
                scene=config.scene,
                vehicle=config.vehicle,
                mechanism=config.mechanism,
                overrides=config.overrides,
            )
        ).mj
    found = (_described(name, values) for name, values in values_of(model).items())
    words = [word.lower() for word in config.words]
    return ParametersResult(
        tuple(
            p
            for p in found
            if p.name not in DECIDED
            and not p.name.startswith(NOT_SIMULATED)
            and all(word in f"{p.name} {p.meaning}".lower() for word in words)
        )
    )


def _described(name: str, values: np.ndarray) -> Parameter:
    given = tuple(values.tolist())
    if name in KNOWN:
        return Parameter(name, given, KNOWN[name].unit, KNOWN[name].meaning)
    unit, meaning = ATTRIBUTES.get(name.rpartition(".")[2], ("", "of this model"))
    return Parameter(name, given, unit, meaning)
