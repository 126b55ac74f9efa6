"""The shipped linkage solved by MuJoCo's forward kinematics, and units with tolerances over it."""

from math import radians
from pathlib import Path

import mujoco
import numpy as np

from hardware.calibration import CalibrationRig, Event, Log
from hardware.emulator import sample_rig

MJCF = Path(__file__).resolve().parents[2] / "mjcf"


class Linkage:
    """Shafts and gimbal angles at which each rod fits between its two balls.

    Only MuJoCo's positions of the balls enter; each equation is solved by a secant or Newton
    search on the rods' lengths.
    """

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_path(str(MJCF / "bench.xml"))
        self.data = mujoco.MjData(self.model)
        self.gimbal = [self.model.joint(f"gimbal_{a}").qposadr[0] for a in "xy"]
        self.servo = [self.model.joint(f"gimbal_servo_{a}").qposadr[0] for a in "xy"]
        self.horn, self.ball = (
            [self.model.site(f"gimbal_{part}_{a}_ball").id for a in "xy"]
            for part in ("horn", "holder")
        )
        self.length = np.zeros(2)
        self.length = self.misfit((0.0, 0.0), (0.0, 0.0))

    def misfit(self, angle, shaft):
        """Distance between each rod's balls beyond its length (2,) [m]."""
        q = self.data.qpos
        q[self.gimbal], q[self.servo] = angle, shaft
        mujoco.mj_kinematics(self.model, self.data)
        apart = self.data.site_xpos[self.horn] - self.data.site_xpos[self.ball]
        return np.linalg.norm(apart, axis=1) - self.length

    def shaft(self, angle):
        """Servo shafts (2,) [rad] that hold a gimbal angle: a secant search for each rod."""
        before, now = np.array(angle) * 2.4, np.array(angle) * 2.5 + 1e-4
        f = self.misfit(angle, before)
        for _ in range(30):
            g = self.misfit(angle, now)
            if abs(g).max() < 1e-13:
                break
            slope = (g - f) / np.where(now == before, 1.0, now - before)
            before, f = now, g
            now = now - np.where(slope == 0.0, 0.0, g / np.where(slope == 0.0, 1.0, slope))
        return now

    def angle(self, shaft):
        """Gimbal angle (2,) [rad] that servo shafts hold: Newton with difference quotients."""
        angle = np.array(shaft) / 2.45
        for _ in range(20):
            f = self.misfit(angle, shaft)
            if abs(f).max() < 1e-13:
                break
            J = [(self.misfit(angle + e, shaft) - f) / 1e-7 for e in 1e-7 * np.eye(2)]
            angle = angle - np.linalg.solve(np.transpose(J), f)
        return angle


class Unit:
    """A rig with sampled servos, switches and sensors on the exact linkage, without weight.

    Parameters
    ----------
    linkage : kinematics
    seed : of `hardware.emulator.sample_rig`, and of its noise
    """

    def __init__(self, linkage, seed):
        self.linkage, self.rng = linkage, np.random.default_rng([seed, 9])
        rig = sample_rig(seed)
        servos, skew = rig.plant.servos[:2], 1.0 + rig.skew
        self.travel = np.array([s.travel for s in servos]) / skew
        self.centre = np.array([(1.5e-3 + s.trim) * skew for s in servos])
        # half of play and dead band on either side of what the pulses ask for, at the shaft
        self.play = np.array([s.backlash / 2 + s.dead_band for s in servos])
        self.sensors = rig.sensors
        self.time, self.turned, self.before = 0.0, np.zeros(3), np.zeros(2)

    def true_angle(self, pulses):
        """Gimbal angle in the middle of the play [rad]."""
        return self.linkage.angle((np.array(pulses) - self.centre) * self.travel)

    def _pulses(self, angle, way):
        return self.centre + (self.linkage.shaft(angle) + way * self.play) / self.travel

    def _at_switch(self, axis, own, held, way):
        """Gimbal angle with one axis at `own` and the other servo's shaft at `held`."""
        other, angle = 1 - axis, np.zeros(2)
        angle[axis] = own
        for _ in range(8):
            angle[other] += 0.41 * (held - (self.linkage.shaft(angle) + way * self.play)[other])
        return angle

    def event(self, rig, switch, closed, offset):
        """What a calibration run records as a switch moves."""
        axis, sign = switch // 2, 1 - 2 * (switch % 2)
        s, came = self.sensors, int(self.rng.choice((-1, 1)))
        way = np.full(2, came)
        way[axis] = sign if closed else -sign
        own = s.switch_angle[switch] - (0.0 if closed else sign * s.differential)
        held = (rig.neutral[1 - axis] + offset - self.centre[1 - axis]) * self.travel[1 - axis]
        met = self._pulses(self._at_switch(axis, own, held, way), way)
        settled = met.copy()
        settled[axis] += way[axis] * self.rng.uniform(0.0, rig.fine)
        pulses = settled.copy()
        pulses[axis] -= way[axis] * rig.fine / 2
        angle = self.linkage.angle((settled - self.centre) * self.travel - way * self.play)
        readings = [
            p.fraction(angle[k // 2]) + self.rng.normal(0.0, 1e-4)
            for k, p in enumerate(s.potentiometers)
        ]
        change = (angle - self.before) * [np.cos((angle[1] + self.before[1]) / 2), 1.0]
        self.turned += np.array(s.imus[0].gyro_matrix) @ [*change, 0.0]
        self.before, self.time = angle, self.time + 1.0
        return Event(
            switch, closed, tuple(pulses), tuple(settled), tuple(readings), self.time,
            tuple(self.turned), came,
        )  # fmt: skip

    def log(self, rig: CalibrationRig) -> Log:
        """What a whole calibration run records."""
        return Log(
            [
                self.event(rig, switch, closed, offset)
                for offset in rig.offsets
                for _ in range(rig.repeats)
                for switch in range(4)
                for closed in (True, False)
            ]
        )


GRID = [(radians(x), radians(y)) for x in (-8, -4, 0, 4, 8) for y in (-8, -4, 0, 4, 8)]
