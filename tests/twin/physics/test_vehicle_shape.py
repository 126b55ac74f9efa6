"""Coefficients and masses of a described vehicle against publications, solids and quadrature."""

import itertools
import math
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.spatial import ConvexHull

from tests.mjcf.barrowman import Fins
from tests.twin.physics.outlines import LARGE, REFERENCE, Outline
from twin.physics.aerodynamics.fit import misfits
from twin.physics.aerodynamics.silhouette import silhouette
from twin.physics.vehicle import Vehicle, read
from twin.physics.vehicle.barrowman import fin_term
from twin.physics.vehicle.design import Body, Design, FinSet, Mass
from twin.physics.vehicle.drag import _friction
from twin.physics.vehicle.lumps import lumps, total
from twin.physics.vehicle.outline import Outline as Surface
from twin.physics.vehicle.outline import Segment, hull_width
from twin.physics.vehicle.profile import unit_radius

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[3] / "mjcf" / "examples"
INCH = 0.0254


def described(name: str) -> Vehicle:
    return Vehicle.of(read(EXAMPLES / f"{name}.toml"))


def loaded(design: Design) -> Vehicle:
    """A design with the large rocket's motor, whatever its size."""
    motor = read(EXAMPLES / "large_rocket.toml").motor_data
    assert motor is not None
    return Vehicle.of(replace(design, motor_data=motor))


# distance of the centre of pressure from the tip over the length: 1 - V / (A L) in closed form
NOSES = [
    ("cone", None, 2 / 3),
    ("ellipsoid", None, 1 / 3),
    ("parabola", 1.0, 7 / 15),
    ("parabola", 0.0, 2 / 3),
    ("power", 0.5, 1 / 2),
    ("power", 0.75, 3 / 5),
    ("haack", 0.0, 1 / 2),
    ("haack", 1 / 3, 7 / 16),
    ("ogive", None, 0.466),  # of long ones: Barrowman & Barrowman (1966), to 0.2 % at 8 calibres
]


@pytest.mark.parametrize(("shape", "parameter", "expected"), NOSES)
def test_a_nose_acts_where_its_volume_says(
    shape: str, parameter: float | None, expected: float
) -> None:
    part = Body(part="nose", length=0.8, diameter=0.1, shape=shape, parameter=parameter, mass=1.0)  # type: ignore[arg-type]
    tube = Body(part="tube", length=1.0, mass=1.0)
    (nose,) = loaded(Design(body=(part, tube))).body_terms
    assert nose.slope == pytest.approx(2.0, rel=1e-12)
    assert nose.station / 0.8 == pytest.approx(expected, rel=2e-3 if shape == "ogive" else 1e-6)


@pytest.mark.parametrize("slenderness", [0.5, 1.0, 3.0, 12.0])
def test_a_tangent_ogive_meets_its_tube_without_a_kink(slenderness: float) -> None:
    radius = unit_radius("ogive", slenderness, None)
    at = radius(np.array([0.0, 1.0 - 1e-6, 1.0]))
    assert at[0] == pytest.approx(0.0, abs=1e-9)
    assert at[2] == pytest.approx(1.0, rel=1e-12)
    assert (at[2] - at[1]) / 1e-6 < 1e-3


@dataclass(frozen=True)
class Example:
    """A worked example of Barrowman's, in inches: parts, fins and the printed results.

    `body` rows: part, length, aft diameter; `fins` rows: root, tip, span, sweep, station of the
    leading edge; `slope` and `centre` of the whole, referred to `diameter`.
    """

    diameter: float
    body: tuple[tuple[str, float, float], ...]
    fins: tuple[tuple[float, float, float, float, float], ...]
    slope: float
    centre: float

    def design(self) -> Design:
        body = tuple(
            Body(part=part, length=length * INCH, diameter=d * INCH, mass=0.1)  # type: ignore[arg-type]
            for part, length, d in self.body
        )
        fins = tuple(
            FinSet(
                count=4, root=r * INCH, tip=t * INCH, span=s * INCH, sweep=x * INCH,
                thickness=1e-3, position=at * INCH, mass=0.01,
            )
            for r, t, s, x, at in self.fins
        )  # fmt: skip
        return Design(body=body, fins=fins)


# Barrowman & Barrowman, NARAM-8 (1966), pp. 41-50; Barrowman, Centuri TIR-33 (1970), pp. 21-29
PUBLISHED = {
    "Testbed II": Example(
        0.976,
        (("nose", 2.75, 0.976), ("tube", 7.0, 0.976), ("transition", 1.375, 0.736),
         ("tube", 8.75, 0.736)),
        ((3.0, 2.0, 1.5, 1.5, 16.625),), 21.44, 16.7,
    ),
    "Aerobee 350": Example(
        22.0, (("nose", 110.0, 22.0), ("tube", 340.45, 22.0)),
        ((50.0, 25.0, 34.2, 34.2, 400.45),), 21.5, 391.0,
    ),
    "Javelin": Example(
        0.75, (("nose", 3.6, 0.75), ("tube", 9.2, 0.75)),
        ((1.6, 0.85, 1.65, 0.75, 11.2),), 35.9, 11.3,
    ),
    "Arcon-Hi": Example(
        1.04, (("nose", 5.25, 1.04), ("tube", 18.75, 1.04)),
        ((1.9, 1.05, 2.2, 0.85, 18.1), (2.45, 1.25, 3.45, 0.6, 21.55)), 96.2, 20.8,
    ),
}  # fmt: skip


def slope_and_centre(example: Example) -> tuple[float, float]:
    """Normal-force slope [1/rad] and centre of pressure [in] of the whole."""
    outline = Surface.of(example.design())
    area = math.pi / 4 * (example.diameter * INCH) ** 2
    from twin.physics.vehicle.barrowman import body_terms

    terms = [*body_terms(outline, area), *(fin_term(fins, area) for fins in outline.fins)]
    slope = sum(term.slope for term in terms)
    return slope, sum(term.slope * term.station for term in terms) / slope / INCH


@pytest.mark.parametrize("name", PUBLISHED)
def test_barrowmans_own_examples_are_met_within_1_percent(name: str) -> None:
    """He worked with a slide rule and measured a length in each drawing."""
    example = PUBLISHED[name]
    slope, centre = slope_and_centre(example)
    assert slope == pytest.approx(example.slope, rel=0.01)
    assert centre == pytest.approx(example.centre, rel=0.01)


def test_a_trapezoid_has_the_published_closed_forms() -> None:
    plain = Fins(4, 0.2, 0.1, 0.08, 0.1, 0.049)
    vehicle = described("large_rocket")
    (term,), (damping, forcing) = vehicle.fin_terms, vehicle.roll
    assert term.slope == pytest.approx(plain.slope(), rel=1e-12)
    assert term.station == pytest.approx(1.65 + plain.behind(), rel=1e-12)
    assert damping == pytest.approx(plain.roll_damping(), rel=1e-6)  # a sum of 2000 there
    assert forcing == 0.0


def test_an_elliptical_fin_has_the_closed_forms_of_the_ellipse() -> None:
    """Area π/4·root·span; centre at (1/2 - 2/3π) of the root: OpenRocket TD 3.2.2."""
    fins = FinSet(count=3, shape="ellipse", root=0.12, span=0.07, thickness=3e-3, mass=0.05)
    plan = Surface.of(with_fins(fins)).fins[0].plan
    assert plan.area() == pytest.approx(math.pi / 4 * 0.12 * 0.07, rel=2e-5)
    assert plan.quarter() == pytest.approx((0.5 - 2 / (3 * math.pi)) * 0.12, rel=1e-4)
    assert plan.chord() == pytest.approx(8 / (3 * math.pi) * 0.12, rel=1e-4)
    assert plan.mid_chord_cosine() == pytest.approx(1.0, abs=1e-9)


def test_corners_give_the_same_fin_as_its_chords() -> None:
    chords = FinSet(count=4, root=0.2, tip=0.1, span=0.08, sweep=0.1, thickness=3e-3, mass=0.1)
    points = ((0.0, 0.0), (0.1, 0.08), (0.2, 0.08), (0.2, 0.0))
    corners = FinSet(count=4, shape="points", points=points, thickness=3e-3, mass=0.1)
    one, other = (loaded(with_fins(fins)) for fins in (chords, corners))
    assert one.fin_terms[0].slope == pytest.approx(other.fin_terms[0].slope, rel=1e-12)
    assert one.airframe.transverse == pytest.approx(other.airframe.transverse, rel=1e-12)
    np.testing.assert_allclose(one.strips, other.strips, rtol=1e-9)


def with_fins(*fins: FinSet) -> Design:
    body = (
        Body(part="nose", length=0.3, diameter=0.1, mass=0.2),
        Body(part="tube", length=1.2, mass=0.9),
    )
    return Design(body=body, fins=fins)


@pytest.mark.parametrize("count", [3, 4, 5, 6, 8])
@pytest.mark.parametrize("edge", [0.051, 0.06, 0.12, 0.4])
def test_the_width_of_tube_and_fins_is_their_hulls_perimeter_over_pi(
    count: int, edge: float
) -> None:
    """Against the convex hull of 3000 points of the circle and the corners of the plates."""
    turn = np.linspace(0, 2 * np.pi, 3001)[:-1]
    circle = 0.05 * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = np.array([[edge, 0.002], [edge, -0.002]])
    rotated = []
    for k in range(count):
        c, s = np.cos(2 * np.pi * k / count), np.sin(2 * np.pi * k / count)
        rotated.append(corners @ np.array([[c, s], [-s, c]]))
    perimeter = ConvexHull(np.concatenate([circle, *rotated])).area  # in a plane
    width = hull_width(np.array(0.05), np.array(edge), 0.002, count)
    assert width == pytest.approx(perimeter / np.pi, rel=2e-6)


@pytest.mark.parametrize(
    ("name", "outline"), [("reference", REFERENCE), ("large_rocket", LARGE)], ids=str
)
def test_strips_integrate_the_closed_outline_like_a_fine_quadrature(
    name: str, outline: Outline
) -> None:
    """Force and moment of a body that turns about any of its points, over the size of each.

    The closed outline of the MJCF has the fins' roots 1 mm inside the tube; here they begin on it.
    """
    z, area = described(name).strips
    outline = replace(outline, fin_root=outline.radius)
    at = np.linspace(outline.tail, outline.tip, 200_001)
    width = outline.width((at[1:] + at[:-1]) / 2) * np.diff(at)
    middle = (at[1:] + at[:-1]) / 2
    for still in np.linspace(outline.tail, outline.tip, 21):
        for power in (0, 1):
            truth, ours = (
                float(np.sum(w * np.abs(x - still) * (x - still) ** (1 + power)))
                for x, w in ((middle, width), (z, area))
            )
            size = float(np.sum(width * np.abs(middle - still) ** (2 + power)))
            assert ours == pytest.approx(truth, abs=2e-4 * size)


def test_strips_follow_steps_boat_tails_and_swept_fins() -> None:
    """Planform and its first moment against adaptive quadrature over the same width."""
    body = (
        Body(part="nose", length=0.3, diameter=0.08, shape="haack", mass=0.1),
        Body(part="tube", length=0.4, mass=0.2),
        Body(part="transition", length=0.1, diameter=0.12, mass=0.1),
        Body(part="tube", length=0.5, mass=0.3),
        Body(part="transition", length=0.08, diameter=0.07, shape="ogive", mass=0.1),
    )
    fins = FinSet(
        count=3, root=0.15, tip=0.05, span=0.1, sweep=0.25, thickness=3e-3, mass=0.1, position=1.1
    )
    vehicle = loaded(Design(body=body, fins=(fins,)))
    z, area = vehicle.strips
    ends = np.sort(vehicle.origin - vehicle.outline.corners())

    def moment(power: int) -> float:
        return sum(
            quad(
                lambda s: s**power * float(vehicle.outline.width(np.array(vehicle.origin - s))),
                low, high, epsrel=1e-8, limit=200,
            )[0]
            for low, high in itertools.pairwise(ends)
        )  # fmt: skip

    assert area.sum() == pytest.approx(moment(0), rel=5e-4)
    assert area @ z == pytest.approx(moment(1), abs=5e-4 * moment(0))


def test_the_width_of_a_described_vehicle_is_that_of_its_solid() -> None:
    """Slices of a solid made by trimesh: nose, tube and four fins as a mesh of 360 sides."""
    vehicle = described("large_rocket")
    stations = np.linspace(0.0, 0.35, 200)
    line = [[float(vehicle.outline.radius(np.array(x))), x] for x in stations[1:]]
    body = trimesh.creation.revolve([[0.0, 0.0], *line, [0.049, 1.85], [0.0, 1.85]], sections=360)
    corners = [[0.04, 1.65], [0.049, 1.65], [0.129, 1.75], [0.129, 1.85], [0.04, 1.85]]
    solid = trimesh.util.concatenate([body, *plates(corners, 0.003, 4)])
    x = np.array([0.05, 0.2, 0.34, 1.0, 1.64, 1.66, 1.7, 1.74, 1.76, 1.84])
    truth = silhouette(np.array(solid.vertices), np.array(solid.faces))(x)
    np.testing.assert_allclose(vehicle.outline.width(x), truth, rtol=2e-4)


def plates(corners: list[list[float]], thickness: float, count: int) -> list[trimesh.Trimesh]:
    """Convex plates around the axis z from corners (off the axis, along it) [m]."""
    sides = [[[r, w, z] for r, z in corners] for w in (-thickness / 2, thickness / 2)]
    plate = trimesh.convex.convex_hull(np.array(sides).reshape(-1, 3))
    made = []
    for k in range(count):
        turned = plate.copy()
        turn = trimesh.transformations.rotation_matrix(2 * np.pi * k / count, [0, 0, 1])
        turned.apply_transform(turn)
        made.append(turned)
    return made


@pytest.mark.parametrize(("front", "aft"), [(0.02, 0.05), (0.05, 0.02), (0.05, 0.05)])
def test_a_conical_transition_has_straight_sides(front: float, aft: float) -> None:
    segment = Segment(Body(part="transition", length=0.2, diameter=2 * aft), 1.0, front, aft)
    at = np.array([-1e-3, 0.0, 0.05, 0.2, 0.201])
    expected = [0.0, front, 0.75 * front + 0.25 * aft, aft, 0.0]
    np.testing.assert_allclose(segment.radius(at), expected, rtol=1e-12)
    volume = math.pi * 0.2 * (front**2 + front * aft + aft**2) / 3
    assert segment.volume() == pytest.approx(volume, rel=1e-9)


def solid_of(part: Body, front: float, aft: float, inner: float = 0.0) -> trimesh.Trimesh:
    """Body of revolution about z from x = 0, optionally with a bore [m]."""
    surface = Surface.of(Design(body=(part,))).segments[0]
    surface = type(surface)(part, 0.0, front, aft)
    t = np.linspace(0.0, 1.0, 400)
    share = t * t if aft >= front else 1.0 - t[::-1] ** 2
    x = share * part.length
    r = surface.radius(x)
    outer = [[float(a), float(b)] for a, b in zip(r, x, strict=True)]
    bore = np.maximum(r - inner, 0.0) if inner else np.zeros_like(r)
    back = [[float(a), float(b)] for a, b in zip(bore[::-1], x[::-1], strict=True)]
    line = np.array([*outer, *back, outer[0]])
    keep = np.concatenate([[True], np.abs(np.diff(line, axis=0)).max(axis=1) > 1e-12])
    mesh = trimesh.creation.revolve(1e3 * line[keep], sections=256)  # it drops small triangles
    mesh.apply_scale(1e-3)
    mesh.fix_normals()
    return mesh


SOLIDS = [
    (Body(part="nose", length=0.2, diameter=0.08, shape="ogive", solid=True, density=900.0), 0.0),
    (Body(part="nose", length=0.2, diameter=0.08, shape="haack", solid=True, density=900.0), 0.0),
    (Body(part="transition", length=0.1, diameter=0.03, solid=True, density=900.0), 0.04),
    (Body(part="tube", length=0.5, diameter=0.08, wall=2e-3, density=900.0), 0.04),
    (Body(part="transition", length=0.1, diameter=0.06, wall=2e-3, density=900.0), 0.04),
]


@pytest.mark.parametrize(("part", "front"), SOLIDS)
def test_mass_centre_and_inertia_are_those_of_a_solid_of_the_shape(
    part: Body, front: float
) -> None:
    before = (
        Body(part="nose", length=0.3, diameter=2 * front, mass=1.0) if part.part != "nose" else None
    )
    body = (part,) if before is None else (before, part)
    design = Design(body=body)
    lump = lumps(design, Surface.of(design))[-1]
    assert part.diameter is not None
    mesh = solid_of(part, front if before else 0.0, part.diameter / 2, part.wall or 0.0)
    mesh.density = part.density
    start = 0.3 if before is not None else 0.0
    assert lump.mass == pytest.approx(abs(mesh.mass), rel=5e-4)
    assert lump.station - start == pytest.approx(mesh.center_mass[2], rel=1e-3)
    inertia = np.abs(mesh.moment_inertia)
    assert lump.transverse == pytest.approx(inertia[0, 0], rel=2e-3)
    assert lump.axial == pytest.approx(inertia[2, 2], rel=2e-3)


def test_a_thin_nose_is_the_limit_of_its_shell() -> None:
    """Mass on the surface against the difference of two solids 0.1 mm apart, by its area."""
    part = Body(part="nose", length=0.2, diameter=0.08, shape="ellipsoid", mass=0.5)
    (shell,) = lumps(Design(body=(part,)), Surface.of(Design(body=(part,))))
    mesh = solid_of(part, 0.0, 0.04)
    skin = mesh.face_normals[:, 2] < 0.999  # without the base
    centres, areas = mesh.triangles_center[skin], mesh.area_faces[skin]
    share = areas / areas.sum()
    middle = float(share @ centres[:, 2])
    assert shell.station == pytest.approx(middle, rel=1e-3)
    assert shell.axial == pytest.approx(0.5 * share @ (centres[:, :2] ** 2).sum(axis=1), rel=2e-3)
    across = share @ ((centres[:, 2] - middle) ** 2 + centres[:, 0] ** 2)
    assert shell.transverse == pytest.approx(0.5 * across, rel=2e-3)


def test_fins_have_the_inertia_of_plates_standing_on_the_body() -> None:
    fins = FinSet(count=3, root=0.2, tip=0.1, span=0.08, sweep=0.1, thickness=4e-3, density=700.0)
    design = with_fins(fins)
    lump = lumps(design, Surface.of(design))[-1]
    corners = [[0.05, 0.0], [0.13, 0.1], [0.13, 0.2], [0.05, 0.2]]
    whole = trimesh.util.concatenate(plates(corners, 4e-3, 3))
    whole.density = 700.0
    assert lump.mass == pytest.approx(whole.mass, rel=1e-9)
    assert lump.station - 1.3 == pytest.approx(whole.center_mass[2], rel=1e-9)
    inertia = whole.moment_inertia
    assert lump.axial == pytest.approx(inertia[2, 2], rel=1e-9)
    assert lump.transverse == pytest.approx(inertia[0, 0], rel=1e-9)


@pytest.mark.parametrize("hollow", [True, False])
def test_a_mass_inside_is_a_cylinder_full_or_hollow(hollow: bool) -> None:
    item = Mass(mass=0.4, position=0.7, length=0.3, diameter=0.09, hollow=hollow)
    design = replace(with_fins(), masses=(item,))
    lump = lumps(design, Surface.of(design))[-1]
    mesh = trimesh.creation.cylinder(radius=0.045, height=0.3, sections=512)
    if not hollow:
        inertia = mesh.moment_inertia * 0.4 / mesh.mass
        axial, transverse = inertia[2, 2], inertia[0, 0]
    else:
        points, _ = trimesh.sample.sample_surface_even(mesh, 200_000, seed=1)
        axial = 0.4 * float((points[:, :2] ** 2).sum(axis=1).mean())
        transverse = 0.4 * float((points[:, 0] ** 2 + points[:, 2] ** 2).mean())
    assert (lump.mass, lump.station) == (0.4, 0.7)
    assert lump.axial == pytest.approx(axial, rel=5e-3)
    assert lump.transverse == pytest.approx(transverse, rel=5e-3)


def test_lumps_add_up_by_the_parallel_axis_theorem() -> None:
    design = replace(with_fins(), masses=(Mass(mass=2.0, position=0.4), Mass(mass=1.0, position=1)))
    parts = lumps(design, Surface.of(design))
    whole = total(parts)
    assert whole.mass == pytest.approx(sum(p.mass for p in parts))
    centre = sum(p.mass * p.station for p in parts) / whole.mass
    about = sum(p.transverse + p.mass * (p.station - centre) ** 2 for p in parts)
    assert (whole.station, whole.transverse) == pytest.approx((centre, about))


@pytest.mark.parametrize("reynolds", [1e6, 1e7, 1e8])
@pytest.mark.parametrize("roughness", [0.0, 1e-9, 1e-3])
def test_skin_friction_is_near_that_of_another_law_for_smooth_and_rough_plates(
    reynolds: float, roughness: float
) -> None:
    """Prandtl and Schlichting: 0.455 / lg(Re)^2.58 and (1.89 + 1.62 lg(l / k))^-2.5."""
    expected = 0.455 / math.log10(reynolds) ** 2.58
    if roughness == 1e-3:
        expected = (1.89 - 1.62 * math.log10(roughness)) ** -2.5
    assert _friction(reynolds, roughness) == pytest.approx(expected, rel=0.08)


def test_drag_of_a_published_rocket_is_near_its_published_curve() -> None:
    """Calisto of the RocketPy examples at Mach 0.3: 0.381 by RASAero II, motor off.

    Fin section and finish are not published; between square and rounded edges, and between a
    smooth surface and paint, the built-up figure moves by 15 %.
    """
    body = (
        Body(part="nose", length=0.55829, diameter=0.127, shape="haack", mass=1.0),
        Body(part="tube", length=1.91437, mass=10.0),
        Body(part="transition", length=0.06, diameter=0.087, mass=0.1),
    )
    fins = FinSet(
        count=4, root=0.12, tip=0.04, span=0.1, sweep=0.08, thickness=3e-3, mass=0.3, position=2.33
    )
    vehicle = loaded(Design(body=body, fins=(fins,), roughness=20e-6))
    assert vehicle.drag.total == pytest.approx(0.381, rel=0.15)
    smooth = replace(vehicle.design, roughness=0.0, fins=(replace(fins, section="airfoil"),))
    assert Vehicle.of(smooth).drag.total < vehicle.drag.total


@pytest.mark.parametrize(
    ("index", "off", "told"),
    [(0, -0.015, False), (0, -0.025, True), (-1, 0.015, False), (-1, 0.025, True)],
)
def test_strips_that_reach_over_an_end_by_2_percent_of_the_length_do_not_fit(
    index: int, off: float, told: bool
) -> None:
    """A tube of 1 m and 100 mm, far from the origin: its planform is 0.1 m²."""
    z = np.linspace(10.005, 10.995, 100)
    z[index] = (10.0 if index == 0 else 11.0) + off
    figures = {
        "strip_z": z, "strip_area": np.full(100, 1e-3), "nose_slope": [2.0], "nose_z": [10.9],
        "fin_slope": [0.0], "fin_z": [0.0],
    }  # fmt: skip
    numerics = "".join(
        f'<numeric name="air_{k}" data="{" ".join(map(str, v))}"/>' for k, v in figures.items()
    )
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><custom>{numerics}</custom><worldbody><body name="vehicle">
        <geom type="cylinder" size="0.05 0.5" pos="0 0 10.5" contype="0"/>
        <geom type="cylinder" size="0.02 0.1" pos="0 0 10.5" contype="0"/></body></worldbody>
        </mujoco>"""
    )
    found = misfits(model)
    assert bool(found) == told
    assert all("air_strip_z reaches from" in line for line in found)
