"""What a vehicle or mechanism file amounts to, before it flies."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from hardware.frames import AXES
from twin.errors import TwinError
from twin.physics.aerodynamics.silhouette import strip_check
from twin.physics.aerodynamics.stability import static_margin
from twin.physics.mechanism import Kinematics, mobility
from twin.plant.model.model import ModelConfig, load

LARGEST_STRIP_ERROR = 0.01  # of the planform; shipped vehicles agree to 1e-5

Findings = list[tuple[str, str]]


def inspect_vehicle(file: Path) -> Findings:
    """Mass, static margin and crossflow stations of a vehicle as (name, text) pairs.

    Raises
    ------
    TwinError : the file is not a vehicle that can fly
    """
    model = load(ModelConfig(vehicle=file)).mj
    findings = [("launch mass", f"{_mass(model):.3f} kg"), ("weight", _thrust_to_weight(model))]
    findings.append(("static margin", _text(lambda: static_margin(model).text)))
    findings.append(("planform", _text(lambda: _planform(model))))
    return findings


def inspect_mechanism(file: Path) -> Findings:
    """Mobility and workspace of a mechanism as (name, text) pairs.

    Raises
    ------
    TwinError : the file is not a mechanism that a vehicle can carry
    """
    model = load(ModelConfig(scene="bench", mechanism=file)).mj
    return [
        ("mobility", _text(lambda: mobility(model).text)),
        ("workspace", _text(lambda: Kinematics(model).workspace().text)),
        ("reach", _text(lambda: _reach(model))),
    ]


def _reach(model: mujoco.MjModel) -> str:
    """Gimbal angles with one servo at the ends of its range and the other at zero."""
    solution = Kinematics(model)
    parts = []
    for k, axis in enumerate(AXES):
        ends = model.actuator(f"gimbal_servo_{axis}").ctrlrange
        servo = np.zeros((2, 2))
        servo[:, k] = ends
        low, high = np.sort(np.degrees(solution.gimbal_from_servo(servo)[:, k]))
        a, b = np.degrees(ends)
        known = np.isfinite([low, high]).all()
        gimbal = f"{low:.1f}° to {high:.1f}°" if known else "past what the rods allow"
        parts.append(f"{axis} {gimbal} with its servo at {a:.0f}° to {b:.0f}°")
    return ", ".join(parts)


def _text(examine: Callable[[], str]) -> str:
    """What an examination gives, or why it cannot be made."""
    try:
        return examine()
    except TwinError as error:
        return f"not known: {error}"


def _mass(model: mujoco.MjModel) -> float:
    return float(model.body_subtreemass[model.body("vehicle").id])


def _thrust_to_weight(model: mujoco.MjModel) -> str:
    most = float(model.numeric("motor_thrust").data.max())
    weight = _mass(model) * float(np.linalg.norm(model.opt.gravity))
    return f"{weight:.2f} N, largest thrust {most:.2f} N"


def _planform(model: mujoco.MjModel) -> str:
    check = strip_check(model)
    if abs(check.error) <= LARGEST_STRIP_ERROR:
        return f"crossflow stations: {check.text}"
    return f"crossflow stations: {check.text}; replace them by\n{check.numerics}"
