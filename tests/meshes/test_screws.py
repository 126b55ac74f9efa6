"""Every screw of the bill of materials in the STL it goes into: thread, reach and room, measured.

Left out: the servos' own screws on the horns, of which makers give no length; ball studs, sold
with threads of 4 to 8 mm; the M2 rods of the potentiometers, which are glued or cut to fit.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

ROOT = Path(__file__).resolve().parents[2]
ROW = re.compile(r"^\| (\d+) \| screw M2 × (\d+)([^|]*) \| ([^|]*) \|", re.MULTILINE)
MODEL = mujoco.MjModel.from_xml_path(str(ROOT / "mjcf" / "bench.xml"))
TUBE = 27.0  # mm, outer radius
NUT = 1.6  # mm high: ISO 4032
BOARD = 1.6  # mm, of a GY-521
EARS = 2.5  # mm thick: SG90 data sheet
SWITCH = 6.4  # mm thick: SS-5GL data sheet
THREAD, SHANK, HEAD = 0.95, 1.5, 1.9  # mm: beside a thread's hole, a shank's hole; a head's edge
STEP = 0.02  # mm along a screw


def bill() -> dict[str, tuple[int, float, str]]:
    """Number, length and remark of each screw, by where it goes."""
    text = (ROOT / "docs" / "wiring.md").read_text(encoding="utf-8")
    return {w: (int(n), float(length), more) for n, length, more, w in ROW.findall(text)}


@dataclass
class Axis:
    """Plastic about the line of a screw; `at` are distances from `start` [mm]."""

    part: str
    start: np.ndarray
    along: np.ndarray
    at: np.ndarray

    def __init__(self, part: str, start, along) -> None:
        self.part, self.start = part, np.asarray(start, float)
        self.along = np.asarray(along, float) / np.linalg.norm(along)
        self.at = np.arange(0.0, 40.0, STEP) + STEP / 2

    def inside(self, radius: float, ways: int = 8) -> np.ndarray:
        """Whether (ways, n) is plastic, on lines `radius` beside the screw's."""
        across = np.eye(3)[np.argmin(np.abs(self.along))]
        first = np.cross(self.along, across)
        first /= np.linalg.norm(first)
        turns = 2.0 * np.pi * (np.arange(ways) + 0.31) / ways
        beside = np.outer(np.cos(turns), first)
        beside += np.outer(np.sin(turns), np.cross(self.along, first))
        triangles = trimesh.load(ROOT / "meshes" / f"{self.part}.stl").triangles
        return np.array([self._line(triangles, self.start + radius * b) for b in beside])

    def _line(self, triangles: np.ndarray, start: np.ndarray) -> np.ndarray:
        a, b, c = triangles.transpose(1, 0, 2)
        across = np.cross(self.along, c - a)
        volume = ((b - a) * across).sum(axis=1)
        hit = np.abs(volume) > 1e-12
        scale = np.where(hit, volume, 1.0)
        u = ((start - a) * across).sum(axis=1) / scale
        v = (np.cross(start - a, b - a) @ self.along) / scale
        crossed = hit & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        depth = ((c - a) * np.cross(start - a, b - a)).sum(axis=1) / scale
        return np.array((depth[crossed, None] > self.at).sum(axis=0) % 2 == 1)

    @property
    def thread(self) -> np.ndarray:
        """Where a thread is cut: plastic all around, closer than a shank's hole."""
        return np.asarray(self.inside(THREAD).all(axis=0) & ~self.closed)

    @property
    def hole(self) -> np.ndarray:
        """Where a hole of either width is."""
        return np.asarray(self.inside(SHANK).all(axis=0) & ~self.closed)

    @property
    def closed(self) -> np.ndarray:
        """Where the screw itself would be in plastic."""
        return np.asarray(self.inside(0.3).any(axis=0))

    def ends(self, of: np.ndarray) -> tuple[float, float]:
        """Where a property begins and ends [mm]."""
        there = self.at[of]
        return float(there[0]), float(there[-1])


def place(geom: str) -> np.ndarray:
    """Of a geom at home in the frame of the mechanism [mm]."""
    data = mujoco.MjData(MODEL)
    mujoco.mj_kinematics(MODEL, data)
    mount = data.body("gimbal_mount")
    away = data.geom(geom).xpos - mount.xpos
    return np.asarray(away @ mount.xmat.reshape(3, 3)) * 1e3


def radial(azimuth: float) -> np.ndarray:
    turn = np.radians(azimuth)
    return np.array([np.cos(turn), np.sin(turn), 0.0])


def threaded(axis: Axis, tip: float, least: float) -> None:
    """At least so much thread before the tip, and nothing in its way."""
    length = STEP * int((axis.thread & (axis.at < tip)).sum())
    assert length >= least - STEP, f"{axis.part}: {length:.2f} mm of thread"
    assert not (axis.closed & (axis.at < tip)).any(), f"{axis.part}: it meets the ground"


def x_axis(length: float) -> None:
    """From outside the tube through the pad of the bulkhead into the ring, not to its inside."""
    for side in (-1.0, 1.0):
        start, along = (side * TUBE, 0.0, 0.0), (-side, 0.0, 0.0)
        threaded(Axis("bulkhead", start, along), length, 3.0)
        ring = Axis("ring", start, along)
        begin, end = ring.ends(ring.hole & (ring.at < TUBE))
        assert begin + 2.0 <= length <= end
        assert not (ring.thread & (ring.at < TUBE)).any()  # it turns in the ring


def y_axis(length: float) -> None:
    """A pin under side load; more thread than 1.5 mm does not fit between ring and motor."""
    for side in (-1.0, 1.0):
        start, along = (0.0, side * 30.0, 0.0), (0.0, -side, 0.0)
        ring, holder = Axis("ring", start, along), Axis("holder", start, along)
        seat = ring.ends(ring.hole & (ring.at < 30.0))[0]
        head = abs(place(f"gimbal_pin_y_{'left' if side < 0 else 'right'}_head")[1]) - 0.6
        threaded(holder, 30.0 - head + length, 1.5)
        assert 30.0 - head < seat  # it turns under the head
        bottom = holder.ends(holder.closed & (holder.at < 30.0))[0]
        assert seat + length <= bottom


def ears(length: float) -> None:
    """Into the posts behind the ears; head and driver come through the shell."""
    for name, turn in (("x", 0.0), ("y", 90.0)):
        for side in (-1, 1):
            along = -radial(90.0 + turn)
            start = place(f"gimbal_servo_{name}_ears") + side * 13.9 * radial(turn)
            start = start - along * (40.0 + along @ start)
            post = Axis("bracket", start, along)
            seat = post.ends(post.thread & (post.at < 40.0))[0]
            assert abs(start @ along) - seat == pytest.approx(
                place("gimbal_servo_x_ears")[1] - EARS / 2, abs=0.05
            )
            threaded(post, seat - EARS + length, 3.0)
            assert not (post.inside(HEAD).any(axis=0) & (post.at < seat - EARS)).any()


def tube(length: float) -> None:
    for azimuth in (-100, -30, 40):
        for height in (51.4, 69.6):
            along = -radial(azimuth)
            axis = Axis("bracket", -TUBE * along + (0.0, 0.0, height), along)
            near = axis.hole & (axis.at < 5.0)
            begin, end = axis.ends(near)
            assert 1.0 < begin < 1.3  # mm, the tube's wall
            assert not (axis.thread & near).any()
            assert end + NUT <= length <= end + NUT + 3.0
            # nut: 4.6 mm over its corners
            behind = axis.inside(2.3).any(axis=0) & (axis.at > end + 0.2) & (axis.at < length)
            assert not behind.any()


def clamp(length: float) -> None:
    """A shank's hole in the half under the head, a thread in the other."""
    axis = Axis("holder", 17.0 * radial(-45) + 20.0 * radial(45) + (0, 0, -20.5), -radial(45))
    begin, end = axis.ends(axis.hole & (axis.at < 30.0))
    threaded(axis, begin + length, 3.0)
    assert axis.ends(axis.thread & (axis.at < 30.0))[0] > begin + 3.0
    assert end < begin + length < end + 2.0


def board(length: float) -> None:
    """2.1 g; deeper pillars would raise the board."""
    for side in (-1, 1):
        axis = Axis("holder", (side * 7.65, 5.4, 60.0), (0.0, 0.0, -1.0))
        seat = axis.ends(axis.thread)[0]
        threaded(axis, seat - BOARD + length, 2.3)


def rig(length: float) -> None:
    """Onto the tube, though the leg's face is oblique and the head meets its higher edge."""
    for azimuth in (45, 135, 225, 315):
        along = -radial(azimuth)
        axis = Axis("calibration_rig", -60.0 * along + (0.0, 0.0, -18.0), along)
        near = axis.at < 40.0
        seat = axis.at[axis.inside(HEAD).any(axis=0) & near][0]
        end = axis.ends(axis.thread & near)[1]
        threaded(axis, end, 3.0)
        assert seat + length >= 60.0 - TUBE + 0.5, "it does not reach the tube"
        assert end + 1.0 <= seat + length <= end + 2.0


def switches(length: float) -> None:
    for side in ("x_positive", "x_negative", "y_positive", "y_negative"):
        case = place(f"switch_{side}_case")
        out = case * (1, 1, 0) / np.hypot(case[0], case[1])
        half = MODEL.geom(f"switch_{side}_case").size * 1e3
        assert 2 * half[2] == pytest.approx(SWITCH)
        for hole in (-4.75, 4.75):  # SS-5GL: 9.5 mm between its holes
            start = case + 1.9 * out + hole * np.array([-out[1], out[0], 0.0])
            start[2] += half[2]
            axis = Axis("calibration_rig", start, (0.0, 0.0, -1.0))
            begin, end = axis.ends(axis.hole)
            assert begin == pytest.approx(SWITCH, abs=0.05)
            assert not axis.thread.any()
            assert end + NUT <= length <= end + NUT + 3.0
            assert not (axis.inside(2.3).any(axis=0) & (axis.at > end + 0.2)).any()


SCREWS = {
    "x axis": x_axis,
    "y axis": y_axis,
    "ears of the servos": ears,
    "tube to `bracket.stl`": tube,
    "clamp of `holder.stl`": clamp,
    "GY-521": board,
    "`calibration_rig.stl` on the tube": rig,
    "limit switches": switches,
}


@pytest.mark.parametrize("where", SCREWS)
def test_a_screw_of_the_bill_holds_in_its_part_and_reaches_what_it_clamps(where):
    rows = {w: row for w, row in bill().items() if w.startswith(where)}
    assert len(rows) == 1
    ((_, length, _),) = rows.values()
    SCREWS[where](length)


def test_every_screw_with_a_length_is_measured():
    assert [w for w in bill() if not w.startswith(tuple(SCREWS))] == []
    assert len(bill()) == len(SCREWS)
