"""Own controller: the shipped attitude loop written in plain Python, flown beside the built-in one.

twin fly --controller docs/examples/own_controller.py:AttitudeLoop --programme doublet
python docs/examples/own_controller.py [FOLDER]
"""

import math
import sys
from pathlib import Path

import numpy as np

import twin
from twin.plant.authority import control_config


class AttitudeLoop:
    """PID on the rotation that is missing, scheduled by the motor's thrust."""

    def start(self, model, period):
        """Read the gains that belong to the vehicle; called once, with the time of a tick [s]."""
        self.period = period
        self.gains = control_config(model)
        self.rate = [0.0, 0.0]  # filtered, about body x and y [rad/s]
        self.integral = [0.0, 0.0]  # [rad/s²]

    def update(self, time, gimbal, vehicle, setpoint):
        """Gimbal angles (x, y) to command now [rad]."""
        g, dt = self.gains, self.period
        # angular acceleration per gimbal angle; without thrust nothing steers
        authority = float(np.interp(time, g.authority_time, g.authority))
        error = missing_rotation(vehicle.attitude, setpoint)
        size = max(math.sqrt(error[0] ** 2 + error[1] ** 2), 1e-12)
        shrink = min(1.0, g.error_limit / size)
        command = [0.0, 0.0]
        for axis in (0, 1):
            rate = float(vehicle.rate[axis])
            self.rate[axis] = rate + (self.rate[axis] - rate) * math.exp(-g.cutoff * dt)
            if authority <= g.authority_floor:
                continue
            most = g.limit * authority
            e = shrink * error[axis]
            wanted = g.kp * e + self.integral[axis] - g.kd * self.rate[axis]
            turn = min(max(wanted, -most), most)
            push = g.ki * e
            if (wanted - turn) * push <= 0.0:  # the integral waits while the gimbal is at its limit
                self.integral[axis] += push * dt
            self.integral[axis] = min(max(self.integral[axis], -most), most)
            command[axis] = -turn / authority  # thrust tilted about +x turns the vehicle about -x
        return command


def missing_rotation(attitude, nose):
    """Rotation about body x and y that takes the nose to a world direction [rad]."""
    w, x, y, z = attitude.tolist()
    dx, dy, dz = nose.tolist()
    bx = (1 - 2 * (y * y + z * z)) * dx + 2 * (x * y + w * z) * dy + 2 * (x * z - w * y) * dz
    by = 2 * (x * y - w * z) * dx + (1 - 2 * (x * x + z * z)) * dy + 2 * (y * z + w * x) * dz
    bz = 2 * (x * z + w * y) * dx + 2 * (y * z - w * x) * dy + (1 - 2 * (x * x + y * y)) * dz
    across = math.sqrt(bx * bx + by * by)
    angle = math.atan2(across, bz)
    if across < 1e-12:
        return (0.0, 0.0) if bz > 0.0 else (angle, 0.0)
    return -by / across * angle, bx / across * angle


def main(folder):
    """Fly both loops and print how far apart they end."""
    flown = {}
    for name, controller in (("built-in", None), ("own", AttitudeLoop())):
        out = folder / f"{name}.rrd"
        flight = twin.fly(
            programme="doublet", controller=controller, gimbal="transfer-function", out=out
        )
        flown[name] = twin.read(flight)
        print(f"{name:9} {flight.ended}, height {flight.max_height_m:.1f} m")
    for signal in ("vehicle/position", "gimbal/command"):
        a, b = (flown[name][signal] for name in ("built-in", "own"))
        print(f"{signal}: at most {np.abs(a.values - b.values).max():.1e} {a.unit} apart")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
