"""Writes the measurements of this folder: `python -m tests.data.generate`.

The gimbal is of another make than the twin's: a servo with viscous, Coulomb and Stribeck friction
that grows with the load it holds, in front of a flexible horn, integrated at 50 kHz by explicit
steps. The thrust is half a sine. The constants below are what the tests compare with.
"""

from math import copysign, exp, pi, sin
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
DELAY, LATER = 0.012, 0.019  # s; from command to motor, in gimbal_a.csv and gimbal_b.csv
GAIN = 0.95  # gimbal angle per commanded angle
DURATION, RATE, HOLD = 12.0, 125.0, 0.24  # s, Hz, s
DT = 2e-5  # s
STIFFNESS, SPEED_GAIN = 12.0, 0.3  # of the controller [N·m/rad, N·m·s/rad]
ROTOR, GIMBAL = 2e-4, 1.2e-4  # kg·m², on the gimbal's side
HORN, HORN_LOSS = 40.0, 0.02  # N·m/rad, N·m·s/rad
COULOMB, STICTION, SLOW, BY_LOAD = 0.006, 0.01, 0.15, 0.05  # N·m, N·m, rad/s, N·m per N·m
TORQUE = 3.0  # N·m; the largest of the servo
SPRING = 1.0  # N·m/rad; of hoses and cables
# A step ends where friction holds the controller's torque; the rms step is 4°.
SHORT = STICTION / (STIFFNESS * 4 * pi / 180) + BY_LOAD * SPRING * GAIN / STIFFNESS
LAG = SPEED_GAIN / (STIFFNESS + SPRING)  # s; of the shaft behind its set point, to first order
NOISE, STEP = 0.05, 0.1  # °; of the potentiometer and of its converter

PEAK, BURN = 30.0, 1.6  # N, s
IMPULSE = 2 * PEAK * BURN / pi  # N·s


def commands() -> np.ndarray:
    """Held commands at each reading [°]."""
    rng = np.random.default_rng(20)
    levels = rng.uniform(-5.0, 5.0, round(DURATION / HOLD))
    levels[:2] = 0.0
    return np.round(np.repeat(levels, round(HOLD * RATE)), 2)


def friction(speed: float, load: float) -> float:
    """Torque against the motion of the rotor [N·m]."""
    level = COULOMB + (STICTION - COULOMB) * exp(-((speed / SLOW) ** 2)) + BY_LOAD * abs(load)
    return level * max(-1.0, min(1.0, speed / 0.01))


def motion(delay: float) -> np.ndarray:
    """Gimbal angle at each reading, without noise [°]."""
    held, seen = commands(), []
    rotor = turning = angle = rate = 0.0
    steps = round(1 / (RATE * DT))
    for k in range(len(held) * steps):
        if k % steps == 0:
            seen.append(angle)
        late = round(k - delay / DT)
        wanted = held[late // steps] * pi / 180 * GAIN if late >= 0 else 0.0
        horn = HORN * (rotor - angle) + HORN_LOSS * (turning - rate)
        drive = STIFFNESS * (wanted * (1 + SPRING / HORN + SPRING / STIFFNESS) - rotor)
        drive -= SPEED_GAIN * turning
        drive = copysign(min(abs(drive), TORQUE), drive)
        turning += DT * (drive - horn - friction(turning, horn)) / ROTOR
        rotor += DT * turning
        rate += DT * (horn - SPRING * angle) / GIMBAL
        angle += DT * rate
    return np.degrees(seen)


def write_gimbal(name: str, delay: float, seed: int) -> None:
    """Write a run as a table: time, command, reading."""
    true = motion(delay)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(true))
    read = np.round((true + noise) / STEP) * STEP
    time = np.arange(len(true)) / RATE
    rows = np.column_stack([time, commands(), read])
    header = "t_s,command_deg,angle_deg"
    np.savetxt(FOLDER / name, rows, ("%.3f", "%.2f", "%.1f"), ",", header=header, comments="")


def write_motor() -> None:
    """Write the thrust curve as a RASP file of a motor that nobody sells."""
    time = np.linspace(0.0, BURN, 33)[1:]
    rows = "".join(f"   {t:.3f} {PEAK * sin(pi * t / BURN):.3f}\n" for t in time[:-1])
    head = "; half a sine of 30 N and 1.6 s\nF19 29 124 0 0.025 0.080 Sine\n"
    (FOLDER / "sine.eng").write_text(f"{head}{rows}   {BURN:.3f} 0.0\n", encoding="utf-8")


if __name__ == "__main__":
    write_gimbal("gimbal_a.csv", DELAY, 1)
    write_gimbal("gimbal_b.csv", LATER, 2)
    write_motor()
