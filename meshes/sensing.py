"""What carries the potentiometers: a cradle on the ring, a saddle on the tube, and their shafts.

Each is drawn with the axis of its potentiometer along +y, and placed by the scenes.
"""

from meshes.drawing import Drawing
from meshes.solids import Solid, box, disc, rod

PLAY = 0.15  # mm around a potentiometer, on each side
FREE = 0.35  # mm around a shaft that turns
TIE = 3.0  # mm, groove of a cable tie 2.5 mm wide


def shaft(drawing: Drawing) -> Solid:
    """Sleeve on an M2 rod that turns the rotor; open on the flat side, where the rod itself bears.

    The wall would be 0.2 mm there.
    """
    _, _, thick, radius, flat = drawing.numeric("print_potentiometer")
    thread, _, _ = drawing.numeric("print_screw")
    solid = rod((0, 0, 0), (0, thick + 0.4, 0), radius - 0.05, segments=48)
    solid -= box((-9, -1, -9), (9, 9, -flat + 0.05))
    slot = box((-0.6, -1, -9), (0.6, 9, 0))
    return solid - slot - rod((0, -1, 0), (0, 9, 0), thread, segments=24)


def cradle(drawing: Drawing) -> Solid:
    """Seat of a potentiometer of the y axis, glued over both edges of the ring; terminals aft."""
    half, tall, thick, radius, _ = drawing.numeric("print_potentiometer")
    _, outer, height, _, _ = drawing.numeric("print_ring")
    wall = drawing.numeric("print_wall")[0]
    case, size = drawing.geom("potentiometer_y_a"), drawing.geom_size("potentiometer_y_a")
    face, rail = case[1] - size[1], half + PLAY + wall
    solid = box((-rail, outer - 1.6, -tall), (rail, face + 0.7 * thick, tall))
    solid -= box((-half - PLAY, face, -9), (half + PLAY, 40, 9))
    # without the film of 0.1 mm that is left in front of the ring
    solid -= box((-half + wall, face - wall, -height), (half - wall, 40, height))
    solid -= rod((0, 0, 0), (0, 40, 0), radius + FREE)
    seat = height + PLAY
    return solid - (disc(outer + 0.05, -seat, seat) + disc(outer - 1.4, -9, 9))


def saddle(drawing: Drawing) -> Solid:
    """Seat of a potentiometer of the x axis outside the tube, held by two cable ties."""
    half, tall, thick, radius, _ = drawing.numeric("gimbal_print_potentiometer")
    inner = drawing.numeric("print_rig")[0]
    wall = drawing.numeric("gimbal_print_wall")[0]
    face = drawing.local("potentiometer_x_a", "potentiometers")[0]
    face -= drawing.geom_size("potentiometer_x_a")[0]
    side, top = half + PLAY + wall, tall + PLAY + wall
    reach = top + TIE + 2 * wall
    solid = box((-side, 20, -top), (side, face + 0.7 * thick, top))
    solid += box((-side, 20, -reach), (side, face - 0.4, reach))
    for end in (-1, 1):
        low, high = sorted((end * (top + wall), end * (top + wall + TIE)))
        solid -= box((-40, face - 1.4, low), (40, 40, high))
    # open aft, for the terminals
    solid -= box((-half - PLAY, face, -40), (half + PLAY, 40, tall + PLAY))
    solid -= rod((0, 0, 0), (0, 40, 0), radius + FREE)
    return solid - disc(inner, -40, 40)
