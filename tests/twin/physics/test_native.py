"""The compiled callbacks against MuJoCo's own functions, momentum books and each other."""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from twin.control.attitude import interpolate
from twin.physics import aerodynamics as air
from twin.physics import native
from twin.physics.motor import Depletion
from twin.physics.native import index, layout, ramp
from twin.physics.native.names import NUMERICS, SITES
from twin.plant.authority import control_config
from twin.plant.flow import Flow

FLIGHT = Path(__file__).resolve().parents[3] / "mjcf" / "flight.xml"

PLAIN = """
<mujoco><option timestep="0.002"/><worldbody><body name="vehicle" pos="0 0 9"><freejoint/>
<geom size="0.1 0.4" type="capsule"/><body pos="0.5 0 0"><joint/><geom size="0.1"/></body>
</body></worldbody><custom><numeric name="mine" data="1 2 3"/></custom></mujoco>"""


@pytest.fixture
def callbacks() -> Iterator[None]:
    with native.installed():
        yield


@pytest.fixture
def model() -> mujoco.MjModel:
    loaded = mujoco.MjModel.from_xml_path(str(FLIGHT))
    native.bind(loaded)
    return loaded


def put(model: mujoco.MjModel, **numerics: float) -> None:
    for name, value in numerics.items():
        model.numeric(name).data[0] = value


def still(model: mujoco.MjModel) -> mujoco.MjData:
    """High above ramp and ground, gimbal and attitude askew, at rest."""
    data = mujoco.MjData(model)
    data.qpos[:3] = 10.0, -20.0, 300.0
    data.qpos[3:7] = np.array([0.8, 0.3, -0.4, 0.2]) / np.sqrt(0.93)
    data.joint("gimbal_x").qpos[0], data.joint("gimbal_y").qpos[0] = 0.1, -0.07
    data.time = 5.0
    return data


def passive(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """What the callback adds to qfrc_passive."""
    mujoco.mj_forward(model, data)
    with_forces = data.qfrc_passive.copy()
    quiet = mujoco.MjModel.from_xml_path(str(FLIGHT))
    for name in ("air_enabled", "motor_impulse", "ramp_length"):
        quiet.numeric(name).data[0] = 0
    quiet.body_mass[:] = model.body_mass
    mujoco.mj_forward(quiet, data)
    return with_forces - data.qfrc_passive


def thrust_at_5_s(model: mujoco.MjModel) -> float:
    time, thrust = (model.numeric(f"motor_{name}").data[:18] for name in ("time", "thrust"))
    return float(np.interp(5.0, time, thrust))


def test_offsets_are_those_the_bindings_report() -> None:
    layout.verify()


def test_a_strange_layout_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    declared = layout._place

    def shifted(fields: object) -> tuple[dict[str, int], int, int]:
        offsets, end, alignment = declared(fields)  # type: ignore[arg-type]
        return {name: at + 8 * (at > 500) for name, at in offsets.items()}, end, alignment

    monkeypatch.setattr(layout, "_place", shifted)
    with pytest.raises(layout.LayoutError, match=r"mjModel\.\w+"):
        layout.verify.__wrapped__()


def test_compiled_name_search_finds_what_mujoco_finds(model: mujoco.MjModel) -> None:
    found = np.zeros(index.LENGTH)
    index.resolve(model._address, found)
    np.testing.assert_array_equal(found, index.entries(model))


@pytest.mark.usefixtures("callbacks")
def test_an_unbound_model_feels_the_same_forces(model: mujoco.MjModel) -> None:
    unbound = mujoco.MjModel.from_xml_path(str(FLIGHT))
    assert not unbound.numeric("native_index").data.any()
    results = []
    for m in (model, unbound):
        data = still(m)
        mujoco.mj_step(m, data, 50)
        results.append(data.qvel.copy())
    np.testing.assert_array_equal(*results)


@pytest.mark.usefixtures("callbacks")
def test_thrust_is_mj_apply_ft_at_the_tilted_nozzle(model: mujoco.MjModel) -> None:
    put(model, air_enabled=0)
    data = still(model)
    added = passive(model, data)
    thrust = np.interp(
        5.0, model.numeric("motor_time").data[:19], model.numeric("motor_thrust").data[:19]
    )
    site = data.site("gimbal_nozzle")
    force = thrust * site.xmat.reshape(3, 3)[:, 2]
    expected = np.zeros(model.nv)
    body = int(model.site("gimbal_nozzle").bodyid[0])
    mujoco.mj_applyFT(model, data, force, np.zeros(3), site.xpos, body, expected)
    np.testing.assert_allclose(added, expected, atol=1e-12)  # rounding at 13 N
    assert np.linalg.norm(expected[:3]) == pytest.approx(thrust)


@pytest.mark.usefixtures("callbacks")
def test_thrust_does_the_work_of_its_point_of_attack(model: mujoco.MjModel) -> None:
    """Generalised force against δW/δq by central differences of the nozzle's position."""
    put(model, air_enabled=0)
    data = still(model)
    added = passive(model, data)
    force = np.linalg.norm(added[:3]) * data.site("gimbal_nozzle").xmat.reshape(3, 3)[:, 2].copy()
    q0, h = data.qpos.copy(), 1e-6
    for dof in range(model.nv):
        ends = []
        for sign in (1, -1):
            data.qpos[:] = q0
            mujoco.mj_integratePos(model, data.qpos, np.eye(model.nv)[dof], sign * h)
            mujoco.mj_kinematics(model, data)
            ends.append(data.site("gimbal_nozzle").xpos.copy())
        work = force @ (ends[0] - ends[1]) / (2 * h)
        assert added[dof] == pytest.approx(work, abs=1e-6)  # 13 N · 300 m · 1e-16 / h


def moving(model: mujoco.MjModel) -> mujoco.MjData:
    """High above the ground, in vacuum: airframe turning, motor swinging on both axes."""
    put(model, air_enabled=0)
    data = still(model)
    data.qvel[:6] = 3.0, -2.0, 8.0, 0.7, -1.1, 0.9
    data.joint("gimbal_x").qvel[0], data.joint("gimbal_y").qvel[0] = 4.0, -2.5
    return data


def flow_of(model: mujoco.MjModel) -> float:
    """Gas through the nozzle at 5 s [kg/s]."""
    return thrust_at_5_s(model) * 0.1164 / float(model.numeric("motor_impulse").data[0])


def gas_by_newton(
    model: mujoco.MjModel, data: mujoco.MjData, ends: tuple[float, float], speed: float, flow: float
) -> np.ndarray:
    """Generalised force of a stream of gas: every element's mass times what it is accelerated.

    Elements move from the first to the second of `ends`, stations along the motor below its own
    origin [m], at `speed` [m/s]. Accelerations are second differences of places in the world, less
    those of elements that stay in the motor, which MuJoCo's own inertia has; so no formula of
    rotating frames enters.
    """
    body, h = model.body("gimbal_holder").id, 1e-4
    q0, v0 = data.qpos.copy(), data.qvel.copy()
    nodes, weights = np.polynomial.legendre.leggauss(8)
    stations = ends[0] + (ends[1] - ends[0]) * (1 + nodes) / 2
    masses = flow / speed * abs(ends[1] - ends[0]) / 2 * weights
    way = np.sign(ends[1] - ends[0]) * speed

    def places(shift: float) -> np.ndarray:
        """Of moving and of staying elements at a time `shift` from now, (2, 8, 3)."""
        data.qpos[:] = q0
        mujoco.mj_integratePos(model, data.qpos, v0, shift)
        mujoco.mj_kinematics(model, data)
        up = data.site("gimbal_nozzle").xmat.reshape(3, 3)[:, 2]
        base = data.site("gimbal_nozzle").xpos
        exit_ = float(model.site("gimbal_nozzle").pos[2])
        return np.array([base + np.outer(stations + w * shift - exit_, up) for w in (way, 0.0)])

    before, now, after = places(-h), places(0.0), places(h)
    acceleration = (before - 2 * now + after) / h**2
    extra = acceleration[0] - acceleration[1]
    data.qpos[:] = q0
    mujoco.mj_forward(model, data)
    total = np.zeros(model.nv)
    for mass, pull, point in zip(masses, extra, now[0], strict=True):
        mujoco.mj_applyFT(model, data, -mass * pull, np.zeros(3), point, body, total)
    return total


@pytest.mark.usefixtures("callbacks")
@pytest.mark.parametrize("burn", ["end", "core"])
def test_gas_loads_a_swinging_motor_as_newton_has_it_element_by_element(
    model: mujoco.MjModel, burn: str
) -> None:
    data = moving(model)
    put(model, motor_burn=burn == "end")
    turning = passive(model, data)
    velocity = data.qvel.copy()
    data.qvel[:] = 0
    added = turning - passive(model, data)
    data.qvel[:] = velocity
    exit_, half = float(model.site("gimbal_nozzle").pos[2]), 0.1394 / 2
    middle = float(model.body("gimbal_propellant").pos[2])
    # burning all along: streams from every station, the mean of eight
    bore = middle + half * np.polynomial.legendre.leggauss(8)[0]
    share = np.polynomial.legendre.leggauss(8)[1] / 2
    faces, shares = ([middle - half], [1.0]) if burn == "end" else (bore, share)
    flow = flow_of(model)
    expected = sum(
        part * gas_by_newton(model, data, (face, exit_), 40.0, flow)
        for face, part in zip(faces, shares, strict=True)
    )
    assert np.abs(expected).max() > 1e-3
    # second differences: 300 m · 1e-16 / h² of 3e-6 kg
    np.testing.assert_allclose(added, expected, atol=2e-6 * np.abs(expected).max())


@pytest.mark.usefixtures("callbacks")
def test_vehicle_and_the_gas_it_left_keep_their_momentum(model: mujoco.MjModel) -> None:
    """Vacuum, no weight, airframe tumbling and gimbal swinging: the books of P and L over 1 s.

    Gas leaves with the nozzle's own velocity and thrust / flow backwards; inside the motor it has
    `flow` times its way. MuJoCo's vehicle knows of neither.
    """
    put(model, air_enabled=0)
    model.opt.gravity[:] = 0
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = h = 5e-4
    data, propellant = still(model), Depletion(model)
    data.joint("gimbal_x").qpos[0] = data.joint("gimbal_y").qpos[0] = 0.0
    data.qvel[3:6] = 5.0, -4.0, 2.0
    start = data.qpos[:3].copy()
    left, last, books, coriolis = np.zeros(6), np.zeros(6), [], np.zeros(6)
    for step in range(2000):
        propellant.update(data.time)
        held, inside, leaving, turned = momenta(model, data, start)
        left += h / 2 * (last + leaving) if step else 0.0
        last = leaving
        coriolis += h * turned
        books.append(held + inside + left)
        data.ctrl[:] = 0.1 * np.sin(20 * data.time), 0.1 * np.cos(20 * data.time)
        mujoco.mj_step(model, data)
    drift = np.abs(np.array(books) - books[0]).max(axis=0).reshape(2, 3).max(axis=1)
    # the burning face's own 9 mm/s times the flow, 7e-5 N, is what the forces leave out
    assert (drift < [5e-5, 1e-4]).all()  # N s of 30, N m s of 1.5
    assert np.linalg.norm(coriolis[3:]) > 5e-3  # half of the damping, had it been forgotten


def momenta(
    model: mujoco.MjModel, data: mujoco.MjData, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Linear and angular (6,): of the vehicle, of the gas in it; what gas takes along a second;
    and flow · ω × way, half of what the gas inside does to the motor."""
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    vehicle, grain = model.body("vehicle").id, model.body("gimbal_propellant").id

    def both(p: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.concatenate([p, np.cross(at - origin, p)])

    held = both(
        model.body_subtreemass[vehicle] * data.subtree_linvel[vehicle], data.subtree_com[vehicle]
    )
    held[3:] += data.subtree_angmom[vehicle]
    site = data.site("gimbal_nozzle")
    up, nozzle = site.xmat.reshape(3, 3)[:, 2], site.xpos
    time, thrust = (model.numeric(f"motor_{name}").data[:19] for name in ("time", "thrust"))
    force = float(np.interp(data.time, time, thrust))
    flow = force * 0.1164 / float(model.numeric("motor_impulse").data[0])
    face = data.xipos[grain] - 0.5 * model.body_mass[grain] / 0.1164 * 0.1394 * up
    velocity = np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_SITE
    mujoco.mj_objectVelocity(model, data, kind, model.site("gimbal_nozzle").id, velocity, 0)
    way, middle = nozzle - face, (nozzle + face) / 2
    leaving = both(flow * velocity[3:] - force * up, nozzle)
    return (
        held,
        both(flow * way, middle),
        leaving,
        both(flow * np.cross(velocity[:3], way), middle),
    )


@pytest.mark.usefixtures("callbacks")
@pytest.mark.parametrize("ahead", [30, -60])
@pytest.mark.parametrize("form", [0, 1])
def test_air_is_the_sum_of_the_formulas_about_the_axis(
    model: mujoco.MjModel, form: int, ahead: float
) -> None:
    put(model, motor_impulse=0, air_model=form, wind_speed=6, wind_azimuth=0.4, wind_exponent=0.2)
    data = still(model)
    data.qvel[:6] = 12, -7, 0, 1.5, -2.0, 4.0
    mujoco.mj_forward(model, data)
    data.qvel[:3] += ahead * data.body("vehicle").xmat.reshape(3, 3)[:, 2]
    added = passive(model, data)
    mujoco.mj_forward(model, data)
    n = {k.name: model.numeric(k.name).data for k in NUMERICS}
    body = data.body("vehicle")
    rotation, w = body.xmat.reshape(3, 3), data.qvel[3:6]
    station = (rotation.T @ (data.subtree_com[body.id] - body.xpos))[2]
    point = body.xpos + station * rotation[:, 2]
    speed = 6 * (point[2] / 10) ** 0.2
    wind = speed * np.array([np.cos(0.4), np.sin(0.4), 0])
    v = rotation.T @ (data.qvel[:3] - wind) + np.cross(w, [0, 0, station])
    rho = air.density(point[2])
    strips = (n["air_strip_z"], n["air_strip_area"], station)
    if form == 0:
        cross = air.crossflow(v[0], v[1], w[0], w[1], 0.5 * rho * 0.84, *strips)
    else:
        reference = n["air_thesis_radius"][0], n["air_thesis_offset"][0]
        cross = air.crossflow_by_moments(v[0], v[1], w[0], w[1], rho, 0.84, *strips, *reference)
    q = 0.5 * rho * n["air_reference_area"][0]
    parts = [cross]
    for part, axial in (("nose", max(v[2], 0)), ("fin", abs(v[2]))):
        slope, z = n[f"air_{part}_slope"][0], n[f"air_{part}_z"][0]
        parts.append(air.normal_force(v[0], v[1], axial, w[0], w[1], q * slope, z - station))
    fx, fy, mx, my = np.sum(parts, axis=0)
    fz = air.axial_drag(v[2], q * n["air_axial_drag"][0])
    mz = air.roll_damping(v[2], w[2], 0.5 * rho * n["air_roll_damping"][0])
    expected = np.zeros(model.nv)
    mujoco.mj_applyFT(
        model, data, rotation @ [fx, fy, fz], rotation @ [mx, my, mz], point, body.id, expected
    )
    np.testing.assert_allclose(added, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.usefixtures("callbacks")
def test_forces_turn_with_the_world(model: mujoco.MjModel) -> None:
    """The same motion headed elsewhere feels the same forces in its own axes."""
    loads = []
    for azimuth in (0.0, 1.1):
        half = azimuth / 2
        turn = np.array([np.cos(half), 0, 0, np.sin(half)])
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, turn)
        rotation = rotation.reshape(3, 3)
        put(model, wind_speed=5, wind_azimuth=azimuth, wind_turbulence=0)
        data = still(model)
        attitude = np.empty(4)
        mujoco.mju_mulQuat(attitude, turn, data.qpos[3:7])
        data.qpos[3:7] = attitude
        data.qvel[:6] = *(rotation @ [12, -7, 30]), 1.5, -2.0, 4.0
        added = passive(model, data)
        loads.append(np.concatenate([rotation.T @ added[:3], added[3:]]))
    np.testing.assert_allclose(*loads, rtol=1e-10, atol=1e-12)


@pytest.mark.usefixtures("callbacks")
def test_vacuum_without_thrust_leaves_the_vehicle_alone(model: mujoco.MjModel) -> None:
    put(model, air_enabled=0, motor_impulse=0)
    data = still(model)
    data.qvel[:6] = 1, 2, 3, 4, 5, 6
    assert not passive(model, data).any()


@pytest.mark.usefixtures("callbacks")
def test_drag_alone_never_adds_energy(model: mujoco.MjModel) -> None:
    put(model, motor_impulse=0)
    model.opt.gravity[:] = 0
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = still(model)
    data.qvel[:6] = 20, -10, 40, 1, 2, 3
    kinetic = []
    for _ in range(20):
        mujoco.mj_step(model, data, 50)
        kinetic.append(data.energy[1])
    assert np.diff(kinetic).max() < 0


def test_models_without_the_numerics_are_untouched() -> None:
    plain = mujoco.MjModel.from_xml_string(PLAIN)
    free, watched = mujoco.MjData(plain), mujoco.MjData(plain)
    mujoco.mj_step(plain, free, 300)
    with native.installed():
        mujoco.mj_step(plain, watched, 300)
        native.bind(plain)
    np.testing.assert_array_equal(free.qpos, watched.qpos)
    np.testing.assert_array_equal(plain.numeric("mine").data, [1, 2, 3])


def test_nested_blocks_put_back_what_was_there() -> None:
    before = mujoco.get_mjcb_passive(), mujoco.get_mjcb_act_dyn()
    with native.installed():
        inside = mujoco.get_mjcb_passive()
        with pytest.raises(RuntimeError, match="on purpose"), native.installed():
            raise RuntimeError("on purpose")
        assert mujoco.get_mjcb_passive() is inside
        assert inside is not None
    assert (mujoco.get_mjcb_passive(), mujoco.get_mjcb_act_dyn()) == before


def test_a_python_callback_comes_back_after_the_block() -> None:
    calls: list[int] = []
    plain = mujoco.MjModel.from_xml_string(
        PLAIN
    )  # MuJoCo compiles no model under a Python callback
    mujoco.set_mjcb_passive(lambda m, d: calls.append(1))
    try:
        with native.installed():
            mujoco.mj_step(plain, mujoco.MjData(plain))
        assert not calls
        mujoco.mj_step(plain, mujoco.MjData(plain))
        assert calls
    finally:
        mujoco.set_mjcb_passive(None)


@pytest.mark.usefixtures("callbacks")
def test_two_threads_give_bitwise_the_flights_of_one(model: mujoco.MjModel) -> None:
    put(model, wind_speed=8, wind_turbulence=0.2)
    results = []
    for threads in (1, 2):
        batch = Batch(model, nsim=6, nthread=threads)
        qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
        qvel[:, 0] += np.linspace(0, 5, 6)
        batch.step(nstep=400)
        results.append(np.concatenate([qpos, qvel], axis=1).copy())
    np.testing.assert_array_equal(*results)
    assert np.ptp(results[0][:, 0]) > 0.5


@pytest.mark.usefixtures("callbacks")
def test_25_s_of_hostile_wind_raise_no_warning(model: mujoco.MjModel) -> None:
    """Gale with gusts, gimbal driven to and fro, tumbling after burnout; no ground to hit."""
    put(model, wind_speed=25, wind_azimuth=2.0, wind_turbulence=0.5, wind_seed=3)
    native.bind(model)
    model.geom("ground").contype[0] = model.geom("ground").conaffinity[0] = 0
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for _ in range(250):
        data.ctrl[:] = rng.uniform(-0.35, 0.35, model.nu)
        mujoco.mj_step(model, data, 100)
    assert not np.array(data.warning.number).any()
    assert np.isfinite(data.qpos).all()
    assert data.time == pytest.approx(25)


@pytest.mark.usefixtures("callbacks")
def test_same_seed_same_gusts_other_seed_others(model: mujoco.MjModel) -> None:
    ends = []
    for seed in (1, 1, 2):
        put(model, wind_speed=10, wind_turbulence=0.3, wind_seed=seed)
        native.bind(model)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 1500)
        ends.append(data.qpos[:3].copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    assert np.linalg.norm(ends[0] - ends[2]) > 1e-3


@pytest.mark.usefixtures("callbacks")
def test_vehicle_rests_on_the_ramp_until_thrust_beats_weight(model: mujoco.MjModel) -> None:
    put(model, motor_ignition=100)
    data = mujoco.MjData(model)
    start = data.qpos[:3].copy()
    mujoco.mj_step(model, data, 2000)
    # sag: 9.8 N · sin 50° / 15 kN/m = 0.5 mm along, 9.8 N · cos 50° on one lug 0.4 mm across
    assert np.linalg.norm(data.qpos[:3] - start) < 1.5e-3
    assert np.linalg.norm(data.qvel[:6]) < 5e-3


@pytest.mark.usefixtures("callbacks")
def test_ramp_guides_to_its_end_and_then_lets_go(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    direction = np.array([np.cos(0.872665), 0, np.sin(0.872665)])
    foot = model.numeric("ramp_position").data
    for _ in range(3000):
        mujoco.mj_step(model, data)
        lug = data.qpos[:3] + data.body("vehicle").xmat.reshape(3, 3)[:, 2] * -0.02 - foot
        travel = lug @ direction
        if travel > 1.9:
            break
        assert np.linalg.norm(lug - travel * direction) < 2e-3
    assert travel > 1.9
    put(model, motor_impulse=0, air_enabled=0)
    data.qpos[:3] += 0.2 * direction
    assert not passive(model, data)[:6].any()


@pytest.mark.usefixtures("callbacks")
@pytest.mark.parametrize("aside", [0.1, 1.4])
@pytest.mark.parametrize("drop", [-1.0, 0.0, 3.0])
def test_a_vehicle_that_falls_beside_the_rail_feels_no_rail(
    model: mujoco.MjModel, aside: float, drop: float
) -> None:
    """Tail first at 30 m/s, between the rail's end (2 m) and well below its foot."""
    put(model, ramp_elevation=np.pi / 2, motor_ignition=100, air_enabled=0)
    native.bind(model)
    data = mujoco.MjData(model)
    data.qpos[0] += aside
    data.qpos[2] -= drop
    data.qvel[2] = -30.0
    assert not passive(model, data)[:6].any()


def test_the_rail_lets_go_smoothly_and_keeps_what_a_launch_needs() -> None:
    up, rest = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    gap = np.linspace(0, 0.1, 2001)
    force = np.array(
        [ramp.guide_force((x, 0.0, 1.0), rest, up, 2.0, 15e3, 60.0, False)[0] for x in gap]
    )
    held = gap <= 0.02  # a launch keeps within 2 mm: the test of guiding above
    np.testing.assert_allclose(force[held], -15e3 * gap[held], rtol=1e-12)
    assert not force[gap > 0.081].any()
    assert np.abs(np.diff(force)).max() < 4.0  # N per 50 µm, 5 times the spring's own: no step


def test_launch_pose_lies_on_the_rail_whatever_its_direction(model: mujoco.MjModel) -> None:
    for elevation, azimuth in ((0.3, 0.0), (1.2, 2.0), (np.pi / 2, -1.0)):
        put(model, ramp_elevation=elevation, ramp_azimuth=azimuth)
        native.bind(model)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        up = data.body("vehicle").xmat.reshape(3, 3)[:, 2]
        level = np.cos(elevation)
        direction = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        np.testing.assert_allclose(up, direction, atol=1e-12)
        lug = data.body("vehicle").xpos - 0.02 * up
        np.testing.assert_allclose(lug, model.numeric("ramp_position").data, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("wind_seed", 0.5, "whole number"),
        ("wind_length", 0.0, "positive"),
        ("ramp_elevation", 2.0, "within"),
        ("ramp_length", -1.0, "positive"),
        ("ramp_length", np.nan, "finite"),
        ("wind_speed", np.nan, "finite"),
        ("motor_thrust", np.inf, "finite"),
        ("motor_thrust[5]", -50.0, "negative"),
        ("motor_thrust[-1]", 1.0, "0 where the curve ends"),
        ("motor_time[3]", 99.0, "later than the point before"),
        ("motor_time", 0.1, "start at 0"),
        ("motor_impulse", 0.0, "integral of the thrust curve"),
        ("motor_impulse", 400.0, "integral of the thrust curve"),
        ("motor_propellant_mass", 0.0, "positive"),
        ("motor_loaded_mass", 0.1, "more than motor_propellant_mass"),
        ("motor_grain_length", 0.0, "positive"),
        ("motor_burn", 0.5, "0 or 1"),
        ("air_model", 7.0, "0 or 1"),
        ("air_reference_area", -1.0, "negative"),
        ("wind_reference_height", 0.0, "positive"),
        ("wind_exponent", -1.0, "negative"),
    ],
)
def test_bad_numerics_are_refused_in_one_line(
    model: mujoco.MjModel, name: str, value: float, says: str
) -> None:
    name, _, place = name.partition("[")
    model.numeric(name).data[int(place.rstrip("]") or 0)] = value
    with pytest.raises(native.TwinError, match=says) as caught:
        native.bind(model)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_vehicle_without_a_motor_binds(model: mujoco.MjModel) -> None:
    for name in ("time", "thrust", "impulse", "propellant_mass", "loaded_mass"):
        model.numeric(f"motor_{name}").data[:] = 0
    native.bind(model)


def test_a_rounded_impulse_is_accepted(model: mujoco.MjModel) -> None:
    put(model, motor_impulse=round(model.numeric("motor_impulse").data[0]))
    native.bind(model)


@pytest.mark.usefixtures("callbacks")
@pytest.mark.parametrize(
    "numerics",
    [{"motor_propellant_mass": 0}, {"wind_speed": 5, "wind_reference_height": 0}],
)
def test_a_division_by_zero_in_the_forces_is_seen_in_the_state(
    model: mujoco.MjModel, numerics: dict[str, float]
) -> None:
    """Changed after `bind`, so unchecked: NaN for the plant to end on, not a flight unforced."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    put(model, **numerics)
    data = still(model)
    mujoco.mj_step(model, data)
    assert not np.isfinite(data.qvel).all()


def test_every_missing_name_is_named() -> None:
    bare = mujoco.MjModel.from_xml_string(
        '<mujoco><custom><numeric name="native_index" size="128"/></custom></mujoco>'
    )
    with pytest.raises(native.TwinError) as caught:
        native.bind(bare)
    for name in ("vehicle", *SITES, *(n.name for n in NUMERICS)):
        assert f"'{name}'" in str(caught.value)


def test_authority_waits_for_the_ignition_and_ends_with_the_burn(model: mujoco.MjModel) -> None:
    """A curve that starts at full thrust 2 s into the flight: nothing before, nothing after."""
    put(model, motor_ignition=2.0, motor_thrust=30.0)
    config = control_config(model)
    times, values = np.array(config.authority_time), np.array(config.authority)
    end = 2.0 + model.numeric("motor_time").data.max()
    for t in (0.0, 1.999, end, end + 5.0):
        assert interpolate(t, times, values) == 0.0
    assert interpolate(2.0, times, values) > 10.0


def test_recorded_flow_and_thrust_are_those_that_act(model: mujoco.MjModel) -> None:
    """Airspeed of the centre of mass in gusts that drift with `wind_speed`, by MuJoCo's books."""
    put(model, wind_speed=8, wind_azimuth=0.4, wind_turbulence=0.3, motor_thrust=30)
    put(model, motor_ignition=6)
    native.bind(model)
    data = still(model)
    data.qvel[:6] = 12, -7, 40, 1.5, -2.0, 4.0
    mujoco.mj_forward(model, data)
    vehicle = model.body("vehicle").id
    flow = Flow(model, data, data.qpos[:3], data.qvel[:3], data.qpos[3:7], data.qvel[3:6])
    flow.derive(5_000_000_000)
    com = data.subtree_com[vehicle]
    arm = com - data.xpos[vehicle]
    rotation = data.xmat[vehicle].reshape(3, 3)
    velocity = data.qvel[:3] + np.cross(rotation @ data.qvel[3:6], arm)
    heading = np.array([np.cos(0.4), np.sin(0.4), 0])
    modes = model.numeric("wind_modes").data
    gust = air.gust(modes, modes.size // 7, *(com - 8 * 5.0 * heading))
    exponent = model.numeric("wind_exponent").data[0]
    wind = 8 * (com[2] / 10) ** exponent * heading + 8 * 0.3 * np.array(gust)
    # the forces act on the axis; the gimbal askew puts the centre of mass about 1 mm beside it
    assert flow.signals["vehicle/airspeed"] == pytest.approx(
        np.linalg.norm(velocity - wind), rel=5e-4
    )
    cosine = rotation[:, 2] @ (velocity - wind) / np.linalg.norm(velocity - wind)
    assert flow.signals["vehicle/angle_of_attack"] == pytest.approx(np.arccos(cosine), rel=5e-4)
    assert flow.thrust == 0.0  # not lit yet
