"""The air against quadrature, published tables and symmetry."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from tests.benchmarks.area_moments import Comparison
from tests.mjcf.barrowman import Fins
from tests.twin.physics.outlines import LARGE, REFERENCE, Outline
from twin.physics import aerodynamics as air
from twin.physics.aerodynamics.revolve import profile, refined
from twin.physics.aerodynamics.silhouette import silhouette, strip_table, strips
from twin.physics.native.names import NUMERICS

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = {"vehicle.xml": REFERENCE, "examples/large_rocket.xml": LARGE}


def shipped_strips(name: str = "vehicle.xml") -> tuple[Array, Array]:
    """Stations [m] and areas [m²] that fly: the numerics of a shipped vehicle."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "mjcf" / name))
    z, area = (np.array(model.numeric(f"air_strip_{what}").data) for what in ("z", "area"))
    return z, area


def integrals(outline: Outline, v: Array, w: Array, centre: float) -> Array:
    """Crossflow force (2,), moment (2,) and their uncancelled sizes (2,) by adaptive quadrature."""

    def integrand(z: float, what: int) -> float:
        r = z - centre
        ux, uy = v[0] + w[1] * r, v[1] - w[0] * r
        drag = np.hypot(ux, uy) * float(outline.width(z))
        size = np.hypot(ux, uy) * drag
        return float(
            (-drag * ux, -drag * uy, r * drag * uy, -r * drag * ux, size, abs(r) * size)[what]
        )

    # quad finds no kink by itself: where the outline has corners, where the flow is slowest, r = 0
    slowest = centre + (w[0] * v[1] - w[1] * v[0]) / max(w @ w, 1e-30)
    kinks = [z for z in (slowest, centre) if np.abs(z - np.array(outline.corners)).min() > 1e-9]
    kinks = [z for z in kinks if outline.tail < z < outline.tip]
    ends = sorted([*outline.corners, *kinks])

    def whole(what: int) -> float:
        return sum(
            float(quad(integrand, *pair, (what,), epsabs=1e-7, epsrel=1e-6, limit=100)[0])
            for pair in itertools.pairwise(ends)
        )

    return np.array([whole(k) for k in range(6)])


def states(outline: Outline, still_places: int) -> Iterator[tuple[Array, Array, float]]:
    """Velocity (2,), rate (2,) and centre of mass: any, and a body still somewhere in the air."""
    rng = np.random.default_rng(3)
    length = outline.tip - outline.tail
    for _ in range(8):
        centre = outline.tail + rng.uniform(0.44, 0.52) * length
        yield 8 * rng.normal(size=2), 8 * rng.normal(size=2), centre
    for still in np.linspace(outline.tail, outline.tip, still_places):  # v0 - ωr changes sign here
        w = np.array([0.0, 5.0])
        yield np.array([-w[1] * (still - centre), 0.0]), w, centre


def strip_error(name: str, still_places: int = 25) -> float:
    """Worst error of force and moment, relative to the integrals of their magnitudes."""
    (z, area), outline = shipped_strips(name), SHIPPED[name]
    worst = np.zeros(2)
    for v, w, centre in states(outline, still_places):
        truth = integrals(outline, v, w, centre)
        load = np.array(air.crossflow(v[0], v[1], w[0], w[1], 1.0, z, area, centre))
        error = np.hypot(*(load - truth[:4]).reshape(2, 2).T) / truth[4:]
        worst = np.maximum(worst, error)
    return float(worst.max())


@pytest.mark.parametrize(
    ("name", "still_places"),
    [
        ("vehicle.xml", 5),
        pytest.param("vehicle.xml", 25, marks=pytest.mark.slow),
        pytest.param("examples/large_rocket.xml", 25, marks=pytest.mark.slow),
    ],
)
def test_shipped_strips_agree_with_adaptive_quadrature_to_1e_4(
    name: str, still_places: int
) -> None:
    """Relative to the integral of magnitudes, since force and moment may cancel to nothing."""
    assert strip_error(name, still_places) <= 1e-4


def test_a_coarse_mesh_of_a_round_body_has_the_outline_of_that_body() -> None:
    """MuJoCo's hemisphere, stretched; its own facets are 0.1 to 5 % too narrow."""
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="nose", scale=[0.03, 0.03, 0.2])
    mesh.make_hemisphere(10)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="nose")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    faces = model.mesh_face.astype(np.int64)
    z = np.linspace(0.001, 0.195, 40)
    own = silhouette(points, faces)
    fine = silhouette(*refined(points, faces, own))
    true = 0.06 * np.sqrt(1 - (z / 0.2) ** 2)
    assert (own(z) / true).max() < 0.999
    assert np.abs(fine(z) - true).max() < 1e-4 * 0.06  # polygons of 512, chords of a millimetre


def test_strips_of_a_half_ellipse_have_its_area_and_first_moment() -> None:
    z, area = strips(lambda x: 0.06 * np.sqrt(np.maximum(1 - (x / 0.2) ** 2, 0)), [0.0, 0.2], [8])
    assert area.sum() == pytest.approx(np.pi / 4 * 0.06 * 0.2, rel=1e-6)
    assert area @ z == pytest.approx(0.06 * 0.2**2 / 3, rel=1e-6)


def test_bodies_with_edges_keep_them() -> None:
    """None of them is the round body of its vertices."""
    import trimesh

    askew = trimesh.creation.box(extents=(0.1, 0.06, 0.03))
    askew.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1, 2, 0.5]))
    shaft = trimesh.util.concatenate(
        [
            trimesh.creation.cylinder(radius=r, segment=[[0, 0, z], [0, 0, z + 0.01]], sections=64)
            for r, z in ((0.01, 0.0), (0.02, 0.01), (0.01, 0.02), (0.03, 0.03), (0.02, 0.04))
        ]
    )
    radii = 0.01 * np.array([0, 1, 2, 1, 2, 1, 2, 1, 2, 0])
    beads = trimesh.creation.revolve(np.c_[radii, np.arange(10) / 100], sections=64)
    oval = trimesh.creation.uv_sphere(radius=0.05, count=(12, 32))
    oval.apply_scale([1.0, 0.8, 1.0])
    assert profile(np.array(oval.vertices)) is None
    assert profile(np.array(beads.vertices)) is not None
    bar = trimesh.creation.cylinder(radius=0.01, height=0.1, sections=6)
    for mesh in (askew, shaft, beads, oval, bar):
        points, faces = np.array(mesh.vertices), np.array(mesh.faces)
        assert refined(points, faces, silhouette(points, faces))[0] is points


def test_turning_the_flow_about_the_axis_turns_the_load_with_it() -> None:
    z, area = shipped_strips()
    rng = np.random.default_rng(4)
    for angle in rng.uniform(0, 2 * np.pi, 20):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        v, w = rng.normal(size=2), rng.normal(size=2)
        (vx, vy), (wx, wy) = turn @ v, turn @ w
        plain = np.array(
            [
                air.crossflow(*v, *w, 1.0, z, area, 0.3),
                air.normal_force(*v, 40.0, *w, 1.0, 0.2),
            ]
        ).reshape(2, 2, 2)
        turned = np.array(
            [
                air.crossflow(vx, vy, wx, wy, 1.0, z, area, 0.3),
                air.normal_force(vx, vy, 40.0, wx, wy, 1.0, 0.2),
            ]
        ).reshape(2, 2, 2)
        np.testing.assert_allclose(turned, plain @ turn.T, rtol=1e-12, atol=1e-12)  # rounding


def test_load_does_not_depend_on_the_point_it_is_reckoned_about() -> None:
    z, area = shipped_strips()
    v, w, shift = np.array([4.0, -2.0]), np.array([1.5, 3.0]), 0.11
    f = np.array(air.crossflow(*v, *w, 1.0, z, area, 0.3))
    moved = v + shift * np.array([w[1], -w[0]])
    g = np.array(air.crossflow(*moved, *w, 1.0, z, area, 0.3 + shift))
    np.testing.assert_allclose(g[:2], f[:2], rtol=1e-12)
    np.testing.assert_allclose(g[2:], f[2:] - shift * np.array([-f[1], f[0]]), rtol=1e-12)


def test_crossflow_takes_energy_out_whatever_the_motion() -> None:
    z, area = shipped_strips()
    for v, w in np.random.default_rng(5).normal(scale=9, size=(50, 2, 2)):
        fx, fy, mx, my = air.crossflow(*v, *w, 1.0, z, area, 0.3)
        assert fx * v[0] + fy * v[1] + mx * w[0] + my * w[1] < 0


def test_broadside_cylinder_has_the_textbook_drag() -> None:
    """½ρ C d l v² for a cylinder of 54 mm and 1 m at 10 m/s."""
    z, area = strips(lambda s: np.full(np.shape(s), 0.054), [0.0, 1.0], [4])
    fx, fy, mx, my = air.crossflow(10.0, 0.0, 0.0, 0.0, 0.5 * 1.225 * 1.2, z, area, 0.5)
    assert fx == pytest.approx(-0.5 * 1.225 * 1.2 * 0.054 * 100, rel=1e-12)
    assert (fy, mx) == (0, 0)
    assert my == pytest.approx(0, abs=1e-15)


def test_normal_force_of_a_turning_part_damps_pitch_as_barrowmans_local_angle_has_it() -> None:
    """A part at r m ahead meets the air at (v + ω×r)/axial: M_q = −½ρ V A C_Nα r² ω."""
    slope, speed = 0.5 * 1.225 * 2.29e-3 * 3.9, 40.0  # ½ρ A C_Nα [kg/m]
    for r in (-0.4, 0.25):
        # no flow across but that of the turn: about x the part moves along −y, about y along x
        assert air.normal_force(0.0, 0.0, speed, 1.5, 0.0, slope, r) == pytest.approx(
            (0.0, slope * speed * 1.5 * r, -slope * speed * 1.5 * r * r, 0.0), abs=1e-15
        )
        assert air.normal_force(0.0, 0.0, speed, 0.0, 1.5, slope, r) == pytest.approx(
            (-slope * speed * 1.5 * r, 0.0, 0.0, -slope * speed * 1.5 * r * r), abs=1e-15
        )
        # and sideways at 2 m/s: C_Nα α about the small angle 2/40
        assert air.normal_force(2.0, 0.0, speed, 0.0, 0.0, slope, r)[0] == pytest.approx(
            -slope * speed**2 * (2.0 / 40.0)
        )


def test_area_moment_form_equals_its_printed_polynomial() -> None:
    """M = ½ (1/C_v) ρ [v0³, -3v0²ω, 3v0ω², -ω³]·∫C_d [r¹…r⁴] b dr, the integrals by quadrature."""
    moments = [
        quad(lambda r, n=n: 0.9 * r**n * (0.05 + 0.01 * r), -0.4, 0.6, epsabs=1e-15)[0]
        for n in range(5)
    ]
    rho, r_ref, dv = 1.1, 0.25, 0.1
    for v0, w in np.random.default_rng(6).normal(scale=6, size=(200, 2)):
        polynomial = [v0**3, -3 * v0**2 * w, 3 * v0 * w**2, -(w**3)]
        c_v = abs(v0 - w * r_ref) + dv
        force, moment = air.crossflow_area_moment(v0, w, rho, tuple(moments), r_ref, dv)
        scale = sum(abs(p * a) for p, a in zip(polynomial, moments[1:], strict=True)) / c_v
        assert abs(moment - 0.5 / c_v * rho * np.dot(polynomial, moments[1:])) <= 1e-12 * scale
        assert abs(force - 0.5 / c_v * rho * np.dot(polynomial, moments[:4])) <= 1e-12 * max(
            scale, 1
        )


def test_area_moment_form_is_exact_for_a_body_that_does_not_turn() -> None:
    """Without rotation and with ∂v_ref → 0 the cubic form is v0|v0| itself, signs included."""
    z, area = shipped_strips()
    exact = air.crossflow(3.0, -5.0, 0.0, 0.0, 0.5 * 1.2 * 0.84, z, area, 0.3)
    for axis, v in ((0, (3.0, 0.0)), (1, (0.0, -5.0))):
        single = air.crossflow(*v, 0.0, 0.0, 0.5 * 1.2 * 0.84, z, area, 0.3)
        form = air.crossflow_by_moments(*v, 0.0, 0.0, 1.2, 0.84, z, area, 0.3, 0.25, 1e-12)
        np.testing.assert_allclose(form, single, rtol=1e-9, atol=1e-15)
        assert np.sign(form[axis]) == np.sign(exact[axis])


def test_area_moment_form_damps_a_turning_body() -> None:
    z, area = shipped_strips()
    _, _, mx, my = air.crossflow_by_moments(0, 0, 2.0, 3.0, 1.2, 0.84, z, area, 0.3, 0.25, 0.1)
    assert mx < 0
    assert my < 0


def test_silhouette_of_a_cylinder_mesh_is_its_diameter_to_0_1_percent() -> None:
    import trimesh

    for turn in (0.0, 0.3):
        mesh = trimesh.creation.cylinder(radius=0.027, height=1.0, sections=64)
        mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 0, 1]))
        width = silhouette(mesh.vertices, mesh.faces)
        np.testing.assert_allclose(width(np.linspace(-0.49, 0.49, 9)), 0.054, rtol=1e-3)


def test_silhouette_sees_fins_alike_at_every_roll_angle() -> None:
    """Mean width of a cross of plates by direct averaging of its shadow over 720 views."""
    import trimesh

    plates = [trimesh.creation.box(extents=e) for e in ((0.12, 0.002, 0.1), (0.002, 0.12, 0.1))]
    mesh = trimesh.util.concatenate(plates)
    views = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    shadow = np.ptp(mesh.vertices[:, :2] @ np.array([np.cos(views), np.sin(views)]), axis=0)
    width = silhouette(mesh.vertices, mesh.faces)
    assert width(np.array([0.01]))[0] == pytest.approx(shadow.mean(), rel=1e-4)  # 720 views


# U.S. Standard Atmosphere 1976, table I: geometric altitude [m], density [kg/m³]
STANDARD = (
    (0, 1.2250),
    (1000, 1.1117),
    (5000, 0.73643),
    (11000, 0.36480),
    (15000, 0.19476),
    (20000, 0.08891),
)


@pytest.mark.parametrize(("altitude", "published"), STANDARD)
def test_density_is_the_published_standard_atmosphere(altitude: float, published: float) -> None:
    """To the five digits printed."""
    assert air.density(altitude) == pytest.approx(published, rel=1e-4)


def test_wind_follows_the_power_law_and_stops_at_the_ground() -> None:
    assert air.mean_wind(5.0, 10.0, 10.0, 1 / 7) == pytest.approx(5.0)
    assert air.mean_wind(5.0, 320.0, 10.0, 0.2) == pytest.approx(10.0)  # 32^0.2 = 2
    assert air.mean_wind(5.0, 320.0, 10.0, 0.0) == 5.0
    assert air.mean_wind(5.0, -1.0, 10.0, 1 / 7) == 0.0


def test_gusts_have_unit_variance_and_no_divergence() -> None:
    rng = np.random.default_rng(0)
    samples = np.array(
        [
            air.gust(modes, 64, *point)
            for modes in (air.gust_modes(seed, 20.0, 64) for seed in range(40))
            for point in rng.uniform(-1e4, 1e4, (100, 3))
        ]
    )
    # √(2/4000) = 2.2 % of the samples and 13 %/√40 = 2.1 % of the fields: three standard errors
    np.testing.assert_allclose(samples.var(axis=0), 1.0, atol=0.09)
    np.testing.assert_allclose(samples.mean(axis=0), 0.0, atol=0.06)
    modes, h, x = air.gust_modes(1, 20.0, 64), 1e-4, np.array([3.0, -7.0, 11.0])
    slopes = [
        (air.gust(modes, 64, *(x + h * e))[k] - air.gust(modes, 64, *(x - h * e))[k]) / (2 * h)
        for k, e in enumerate(np.eye(3))
    ]
    assert sum(slopes) == pytest.approx(0, abs=1e-6 * max(map(abs, slopes)) + 1e-7)


def test_gusts_share_their_variance_among_components_as_documented() -> None:
    """Of a mode a·cos(k·x + φ) each component has the variance a²/2 over all space."""
    fields = np.array([air.gust_modes(seed, 150.0, 16).reshape(16, 7) for seed in range(1000)])
    rms = np.sqrt((fields[:, :, 3:6] ** 2).sum(axis=1) / 2)
    np.testing.assert_allclose((rms**2).sum(axis=1), 3.0)
    np.testing.assert_allclose(rms.std(axis=0), 0.13, atol=0.015)
    np.testing.assert_allclose(np.percentile(rms, [2.5, 97.5]), [0.71, 1.24], atol=0.02)
    assert rms[0] == pytest.approx([0.70, 1.14, 1.10], abs=0.005)


def test_gusts_decorrelate_over_their_length() -> None:
    """Correlation near 1 within a hundredth of the length and near 0 beyond five lengths."""
    pairs = {near: [] for near in (True, False)}
    for seed in range(200):
        modes = air.gust_modes(seed, 50.0, 16)
        origin = air.gust(modes, 16, 0, 0, 0)[0]
        pairs[True].append((origin, air.gust(modes, 16, 0.5, 0, 0)[0]))
        pairs[False].append((origin, air.gust(modes, 16, 250.0, 0, 0)[0]))
    assert np.corrcoef(np.array(pairs[True]).T)[0, 1] > 0.95
    assert abs(np.corrcoef(np.array(pairs[False]).T)[0, 1]) < 0.25  # 200 fields: 3 σ = 0.21


def test_barrowman_coefficients_of_a_worked_fin_set() -> None:
    """Rectangular fins without sweep: C_Nα and centre of pressure worked by hand."""
    fins = Fins(count=4, root=0.1, tip=0.1, span=0.1, sweep=0.0, radius=0.05)
    bare = 4 * 4 * 1.0 / (1 + np.sqrt(1 + (2 * 0.1 / 0.2) ** 2))
    assert fins.slope() == pytest.approx(bare * (1 + 0.05 / 0.15))
    assert fins.behind() == pytest.approx(0.025)  # quarter chord
    # slope per fin area a: 2 fins carry `bare`; Σ∫ c y² dy = 4 c (R³-r³)/3
    per_area = bare * np.pi * 0.05**2 / (2 * 0.1 * 0.1)
    assert fins.roll_damping() == pytest.approx(
        per_area * 4 * 0.1 * (0.15**3 - 0.05**3) / 3, rel=1e-6
    )


def test_documented_tables_are_those_the_code_gives() -> None:
    """Errors of the area-moment form, and the numerics a vehicle carries."""
    page = (ROOT / "docs" / "aerodynamics.md").read_text()
    comparison = Comparison(mujoco.MjModel.from_xml_path(str(ROOT / "mjcf" / "vehicle.xml")))
    assert comparison.table() in page
    assert comparison.summary() in page
    head = "| numeric | size | unit | meaning | default |\n|---|---|---|---|---|\n"
    rows = (f"| `{n.name}` | {n.size} | {n.unit} | {n.meaning} | {n.default} |" for n in NUMERICS)
    assert head + "\n".join(rows) in page


def test_area_moment_form_strays_as_far_as_the_page_says() -> None:
    """Near right without rotation, wrong by tens of percent with it, against quadrature."""
    z, area = shipped_strips()
    moments = tuple(air.area_moments(z, area, 0.2726))
    errors = []
    for v0, w in ((10.0, 0.2), (10.0, 1.0), (3.0, 10.0)):
        exact = integrals(REFERENCE, np.array([-v0, 0.0]), np.array([0.0, w]), 0.2726)[3] / 2
        form = air.crossflow_area_moment(v0, w, 1.0, moments, 0.235, 0.1)[1]
        errors.append(abs(form - exact) / abs(exact))
    assert errors[0] < 0.1 < errors[1] < 0.3 < 1.0 < errors[2]


@pytest.mark.parametrize("nose", ["sphere", "ellipsoid", "capsule"])
def test_noses_of_mujocos_own_shapes_are_sliced_as_they_are(nose):
    """Their meshes have no levels; widths against the closed form at some stations."""
    size = {"sphere": "0.027", "ellipsoid": "0.027 0.027 0.15", "capsule": "0.027 0.1"}[nose]
    half = {"sphere": 0.027, "ellipsoid": 0.15, "capsule": 0.127}[nose]
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="vehicle"><freejoint name="vehicle"/>
        <geom type="{nose}" size="{size}" contype="0" conaffinity="0"/>
        </body></worldbody></mujoco>"""
    )
    z, area = strip_table(model)
    exact = {
        "sphere": np.pi * 0.027**2,
        "ellipsoid": np.pi * 0.027 * 0.15,
        "capsule": np.pi * 0.027**2 + 4 * 0.027 * 0.1,
    }[nose]
    assert np.abs(z).max() < half
    # an icosphere of five subdivisions is 0.1 % too narrow, a capsule of 32 sides half a percent
    assert np.sum(area) == pytest.approx(exact, rel=8e-3)
