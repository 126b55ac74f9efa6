"""The calibration rig of bench.xml: a clamp on the tube and four posts that hold limit switches."""

import math

import numpy as np

from meshes.drawing import Drawing
from meshes.solids import Solid, box, disc, hull, rod, tube, union

SIDES = ("x_positive", "x_negative", "y_positive", "y_negative")
SHELF = 2.4  # mm; the switch's screws need something to bite
HOLES = 9.5  # mm between the screws of an SS-5GL: data sheet
BAR = 4.0  # mm


def calibration_rig(drawing: Drawing) -> Solid:
    """Clamp, posts, ring and the four switch mounts; z points to the nose."""
    inner, wall, aft, forward, reach = drawing.numeric("print_rig")
    thread, clearance, _ = drawing.numeric("gimbal_print_screw")
    low = float(drawing.local("switch_x_positive_case", "calibration_rig")[2])
    shelf = low - drawing.geom_size("switch_x_positive_case")[2]
    outer = inner + wall
    solid = disc(outer, aft, forward) + tube(reach - 1, reach + BAR, shelf - SHELF - 3, shelf)
    for turn in (45, 135, 225, 315):
        solid += _leg(outer, reach, aft, forward, shelf).rotate((0, 0, turn))
        solid -= rod((outer - 9, 0, forward - 4), (outer + 9, 0, forward - 4), thread).rotate(
            (0, 0, turn)
        )
    solid = union(solid, *(_mount(drawing, side, reach, shelf) for side in SIDES))
    solid -= disc(inner, aft - 1, forward + 1)
    for side in SIDES:
        solid -= _holes(drawing, side, shelf, clearance)
    return solid


def _leg(outer: float, reach: float, aft: float, forward: float, shelf: float) -> Solid:
    """Post from the clamp to the ring, wide at its foot."""
    foot = box((outer - 2, -BAR, aft), (outer + 3, BAR, forward))
    elbow = box((reach, -BAR / 2, aft - 14), (reach + BAR, BAR / 2, aft - 8))
    post = box((reach, -BAR / 2, shelf - SHELF), (reach + BAR, BAR / 2, aft - 8))
    return hull(foot, elbow) + post


def _azimuth(drawing: Drawing, side: str) -> float:
    case = drawing.local(f"switch_{side}_case", "calibration_rig")
    return math.degrees(math.atan2(case[1], case[0]))


def _mount(drawing: Drawing, side: str, reach: float, shelf: float) -> Solid:
    """Shelf under one switch, from its face to the ring."""
    case = drawing.local(f"switch_{side}_case", "calibration_rig")
    half = drawing.geom_size(f"switch_{side}_case")
    middle = float(np.hypot(case[0], case[1]))
    plate = box(
        (middle - half[1] + 1.0, -half[0] - 1, shelf - SHELF), (reach + 1, half[0] + 1, shelf)
    )
    fence = box(
        (middle + half[1] + 0.1, -half[0] - 1, shelf - SHELF), (reach + 1, half[0] + 1, shelf + 4)
    )
    return (plate + fence).rotate((0, 0, _azimuth(drawing, side)))


def _holes(drawing: Drawing, side: str, shelf: float, clearance: float) -> Solid:
    case = drawing.local(f"switch_{side}_case", "calibration_rig")
    middle = float(np.hypot(case[0], case[1])) + 1.9
    pair = union(
        *(
            rod((middle, y, shelf - 9), (middle, y, shelf + 9), clearance)
            for y in (-HOLES / 2, HOLES / 2)
        )
    )
    return pair.rotate((0, 0, _azimuth(drawing, side)))
