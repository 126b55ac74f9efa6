"""The printed parts of the gimbal, each drawn in the frame of the body that carries it.

Which number means what stands beside the numerics `print_*` in mechanism.xml.
"""

import math

from meshes.drawing import Drawing
from meshes.solids import Solid, box, disc, hull, rod, sector, sphere, tube, union

QUARTER = 90.0
GAP = 0.1  # mm, so that a printed pocket takes its part
# GY-521 boards are sold with 20.7 to 21 by 15.5 to 15.9 mm; their two 3 mm holes stand 15.2 to
# 15.5 mm apart, 2.5 mm from the long edge opposite the pins.
BOARD, BOARD_HOLES, BOARD_EDGE = 15.8, 15.3, 2.5
PRESSED = 5.0  # mm of a rod's wire in the barrel of its end


def bulkhead(drawing: Drawing) -> Solid:
    """Collar glued into the tube; its two pads carry the screws of the x axis."""
    inner, outer, aft, forward, reach = drawing.numeric("print_bulkhead")
    thread, _, _ = drawing.numeric("print_screw")
    boss = drawing.numeric("print_ring")[3]
    pads = union(*(_pad(side, reach, outer, boss + 1.0, aft, forward) for side in (-1, 1)))
    collar = tube(inner, outer, aft, forward)
    trim = disc(outer, aft, forward)
    return collar + (pads ^ trim) - rod((-30, 0, 0), (30, 0, 0), thread)


def _pad(side: int, reach: float, outer: float, half: float, aft: float, forward: float) -> Solid:
    inside, outside = sorted((side * reach, side * (outer - 0.6)))
    return box((inside, -half, aft), (outside, half, forward - 0.5))


def ring(drawing: Drawing) -> Solid:
    """Cardan ring: pivots on the bulkhead's screws about x, carries the holder's screws on y."""
    inner, outer, half, boss, reach = drawing.numeric("print_ring")
    _, clearance, _ = drawing.numeric("print_screw")
    solid = tube(inner, outer, -half, half)
    for side in (-1, 1):
        solid += rod((side * (inner + 0.4), 0, 0), (side * reach, 0, 0), boss)
    solid -= disc(inner, -half - 1, half + 1)
    holes = rod((-30, 0, 0), (30, 0, 0), clearance) + rod((0, -30, 0), (0, 30, 0), clearance)
    return solid - holes


def holder(drawing: Drawing) -> Solid:
    """Sleeve that grips the motor, closed forward, with the y axis, both rod balls and the IMU."""
    bore, outer, aft, boss, reach = drawing.numeric("print_holder")
    thread, clearance, _ = drawing.numeric("print_screw")
    forward = drawing.site("motor_forward")[2]
    board, half_board = drawing.geom("imu_board"), drawing.geom_size("imu_board")
    top = board[2] - half_board[2]
    cap = forward + 1.6
    solid = disc(outer, aft, forward - 3) + rod((0, 0, forward - 3), (0, 0, cap), outer, bore, 64)
    cut = [disc(bore, aft - 1, forward), disc(bore - 6, forward - 1, cap + 1)]
    for side in (-1, 1):
        solid += rod((0, side * bore, 0), (0, side * reach, 0), boss)
        cut.append(rod((0, side * (bore + 0.4), 0), (0, side * 30, 0), thread))
    for name in ("holder_x_ball", "holder_y_ball"):
        ball = drawing.site(name)
        outward = ball * (1, 1, 0) / max(abs(ball[:2]))
        seat = ball - outward * 2.9  # room for the cup to swivel
        foot = outward * (bore + 0.6) + (0, 0, ball[2])
        solid += hull(
            rod(foot, seat, 2.0), rod(foot - (0, 0, 3.5), foot - (0, 0, 3.5) + outward, 2.0)
        )
        cut.append(rod(foot + outward * 0.2, ball, thread, segments=16))
    lug, slit = _clamp(bore, outer, aft, thread, clearance)
    solid = union(solid, lug) - union(*cut, slit)
    for side in (-1, 1):  # whole pillars, whose inner sides stand in the hole of the cap
        foot = (side * BOARD_HOLES / 2, BOARD / 2 - BOARD_EDGE)
        solid += rod((*foot, forward), (*foot, top), 1.9)
        solid -= rod((*foot, forward + 0.2), (*foot, top + 1), thread, segments=16)
    return solid - disc(bore, aft - 1, forward)


def _clamp(
    bore: float, outer: float, aft: float, thread: float, clearance: float
) -> tuple[Solid, Solid]:
    """Lug and slit by which a screw tightens the aft end of the sleeve on the motor.

    The screw has its thread in the far half alone: held in both, it could not pull them together.
    """
    lug = box((bore + 0.4, -3.7, aft), (outer + 3.2, 3.2, aft + 7))
    slit = box((bore - 2, -0.5, aft - 1), (outer + 9, 0.5, aft + 12))
    x, z = outer + 1.0, aft + 3.5
    hole = rod((x, -9, z), (x, 0, z), thread, segments=16)
    hole += rod((x, 0, z), (x, 9, z), clearance, segments=16)
    return lug.rotate((0, 0, -45)), (slit + hole).rotate((0, 0, -45))


def horn(drawing: Drawing) -> Solid:
    """Servo horn with a splined hub; its outer face is y = 0, the arm points along x."""
    hub, tip, plate, cover, spline, depth = drawing.numeric("print_horn")
    thread, clearance, _ = drawing.numeric("print_screw")
    arm = (drawing.site("horn_x_ball") - drawing.body("horn_x"))[0]
    floor = cover - depth - 1.2
    solid = rod((0, floor, 0), (0, cover, 0), hub, segments=48)
    solid += hull(
        rod((0, -plate, 0), (0, 0, 0), hub - 0.4), rod((arm, -plate, 0), (arm, 0, 0), tip)
    )
    bore = rod((0, floor - 1, 0), (0, floor + depth, 0), spline, segments=42)
    screw = rod((0, -9, 0), (0, 9, 0), clearance)
    return solid - bore - screw - rod((arm, -9, 0), (arm, 9, 0), thread, segments=16)


def rod_end(drawing: Drawing) -> Solid:
    """Cup that snaps on a ball, the wire's barrel along -z, the stud's opening along y."""
    cup, half, length, barrel = drawing.numeric("print_rod_end")
    ball = drawing.site_size("horn_x_ball")[0]
    wire = drawing.geom_size("rod_x")[0]
    solid = rod((0, -half, 0), (0, half, 0), cup, segments=36)
    solid += rod((0, 0, -length), (0, 0, 0), barrel)
    socket = sphere(ball + 0.05)
    mouth = rod((0, -9, 0), (0, 9, 0), ball * 0.82)
    return solid - socket - mouth - rod((0, 0, -length - 1), (0, 0, -length + PRESSED), wire)


def wire(drawing: Drawing) -> tuple[float, float]:
    """Lengths of the wires of rods x and y, between the ends of the bores of their ends [mm]."""
    length = drawing.numeric("print_rod_end")[2]
    balls = ((drawing.site(f"horn_{a}_ball"), drawing.site(f"holder_{a}_ball")) for a in "xy")
    x, y = (math.dist(high, low) - 2.0 * (length - PRESSED) for high, low in balls)
    return x, y


def bracket(drawing: Drawing) -> Solid:
    """Half shell in the tube with two shelves; each servo is screwed by its ears to two posts."""
    _, outer, _, _, _ = drawing.numeric("print_bulkhead")
    inner = drawing.numeric("print_bulkhead")[0]
    low, low_top, mid, mid_top = drawing.numeric("print_bracket")
    _, clearance, _ = drawing.numeric("print_screw")
    case, half = drawing.geom("servo_x_case"), drawing.geom_size("servo_x_case")
    rise = drawing.geom("servo_y_case")[2] - case[2]
    top = case[2] + rise + half[2]
    shelf = drawing.body("horn_x")[1] - 2.6  # inside the sweep of a horn and its rod
    # a rod alone needs less, but the higher its ball on the holder, the farther in it leans
    lean = 0.25 * max(drawing.site("holder_x_ball")[2] - 13.0, 0.0)
    passing = drawing.site("horn_x_ball")[1] - 3.8 - lean
    arm = abs(drawing.site("horn_x_ball")[0] - drawing.body("horn_x")[0])
    turn = min(1.0, 0.18 * drawing.site("holder_x_ball")[1] / arm)  # sine of it at stops of 10°
    # a long arm dips into the shelf, and the rod of one that turns far moves along it
    slot = max(6.0, arm - 2.0, 5.0 + arm * (1.0 - (1.0 - turn**2) ** 0.5))
    past = max(40.0, outer + 1.0)
    solid = tube(inner, outer, low, top) ^ sector(past, low, top, -130, 70)
    solid += disc(outer, low, low_top) + disc(outer, mid, mid_top)
    solid -= disc(9, low - 1, low_top + 1) + _lightening(mid, mid_top, outer / 25.9)
    solid -= box((-slot, shelf, low - 1), (slot, past, top + 1))
    solid -= box((-past, -slot, low - 1), (-passing, slot, mid - 1))
    solid -= box((-past, -slot, mid - 1), (-shelf, slot, top + 1))
    posts = _posts(drawing, low_top, case[2] + half[2])
    upper = _posts(drawing, mid_top - rise, case[2] + half[2])
    solid += posts + upper.rotate((0, 0, QUARTER)).translate((0, 0, rise))
    for azimuth in (-100, -30, 40):
        for height in (low + 6, top - 6):
            hole = rod((outer - 5.9, 0, height), (outer + 4.1, 0, height), clearance)
            solid -= hole.rotate((0, 0, azimuth))
    pilots = _pilots(drawing, past)
    solid -= pilots + pilots.rotate((0, 0, QUARTER)).translate((0, 0, rise))
    return solid ^ disc(outer, low, top)


def _lightening(bottom: float, top: float, scale: float) -> Solid:
    """Holes in the upper shelf, in proportion to the tube."""
    holes = [
        rod(
            (17 * x * scale, 17 * y * scale, bottom - 1),
            (17 * x * scale, 17 * y * scale, top + 1),
            4.0 * scale,
        )
        for x, y in ((0.94, 0.34), (0.34, -0.94))
    ]
    return union(disc(5, bottom - 1, top + 1), *holes)


def _posts(drawing: Drawing, bottom: float, top: float) -> Solid:
    """Two posts under the ears of servo x."""
    case, half = drawing.geom("servo_x_case"), drawing.geom_size("servo_x_case")
    ears, reach = drawing.geom("servo_x_ears"), drawing.geom_size("servo_x_ears")
    seat = ears[1] - reach[1]
    posts = [
        box(
            (min(a, b), seat - 8.4, bottom - 0.5),
            (max(a, b), seat, top),
        )
        for a, b in (
            (case[0] + half[0] + GAP, ears[0] + reach[0]),
            (case[0] - half[0] - GAP, ears[0] - reach[0]),
        )
    ]
    return union(*posts)


def _pilots(drawing: Drawing, past: float) -> Solid:
    """Holes of servo x's screws in the posts, and the way of head and driver through the shell."""
    ears, reach = drawing.geom("servo_x_ears"), drawing.geom_size("servo_x_ears")
    (half,) = drawing.numeric("print_servo")
    thread, _, head = drawing.numeric("print_screw")
    holes = []
    for side in (-1, 1):
        x, z = ears[0] + side * half, ears[2]
        low, high = ears[1] - reach[1], ears[1] + reach[1]
        holes.append(rod((x, low - 7, z), (x, high, z), thread, segments=16))
        holes.append(rod((x, high, z), (x, past, z), head + 0.4))
    return union(*holes)
