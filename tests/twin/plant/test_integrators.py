"""Observed orders of the integrators against closed forms and SciPy, and their chronology."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twin.config import Converge
from twin.errors import TwinError
from twin.experiments.convergence import flights
from twin.physics import native
from twin.plant.plant import Plant
from twin.plant.steps.adams_bashforth import AdamsBashforth, coefficients
from twin.plant.steps.integrators import NAMES, make

# Coefficients as printed in E. Hairer et al., Solving Ordinary Differential Equations I, §III.1
PRINTED = {
    1: [1],
    2: [3 / 2, -1 / 2],
    3: [23 / 12, -16 / 12, 5 / 12],
    4: [55 / 24, -59 / 24, 37 / 24, -9 / 24],
}

OSCILLATOR = """
<mujoco>
  <option timestep="0.01" gravity="0 0 0"><flag constraint="disable"/></option>
  <worldbody><body><joint name="j" type="slide" axis="1 0 0" stiffness="9" damping="0.6"/>
    <geom size="0.1" mass="1"/></body></worldbody>
  <actuator><general name="f" joint="j" dyntype="filter" dynprm="0.5"/></actuator>
</mujoco>"""

TUMBLER = """
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody><body name="b"><freejoint/>
    <inertial pos="0.02 -0.01 0.03" mass="1" diaginertia="0.099 0.08 0.03"/></body></worldbody>
</mujoco>"""
INERTIA = np.array([0.099, 0.08, 0.03])
RATE = np.array([1.0, 2.0, 0.7])  # rad/s, about no principal axis


def oscillator_error(name: str | AdamsBashforth, h: float, jitter: float = 0.0) -> float:
    """Worst error at 2 s of x'' + 0.6 x' + 9 x = a, a' = 2(1 − a), against its exact solution."""
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    data.qpos[0], data.qvel[0] = 0.3, 0.0
    stepper = make(name) if isinstance(name, str) else name
    n = round(2.0 / h)
    rng = np.random.default_rng(11)
    steps = np.full(n, h)
    if jitter:
        steps *= 1 + rng.uniform(-jitter, jitter, n)
    for dt in steps:
        stepper.step(model, data, 1, None if not jitter else float(dt))
    t = steps.sum()
    A = np.array([[0, 1, 0, 0], [-9, -0.6, 1, 0], [0, 0, -2, 2], [0, 0, 0, 0.0]])
    w, v = np.linalg.eig(A)
    truth = (v @ (np.exp(w * t) * np.linalg.solve(v, [0.3, 0, 0, 1]))).real
    return float(max(abs(data.qpos[0] - truth[0]), abs(data.qvel[0] - truth[1])))


def tumbling(name: str, h: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    model = mujoco.MjModel.from_xml_string(TUMBLER)
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qvel[3:] = RATE
    # the centre of mass rests, the origin beside it does not
    data.qvel[:3] = np.cross(RATE, [-0.02, 0.01, -0.03])
    make(name).step(model, data, round(time / h))
    return data.qvel[3:].copy(), data.qpos[3:].copy()


def euler_equations(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Rate and attitude of the torque-free body by SciPy's DOP853."""

    def slope(_, y):
        w, q = y[:3], y[3:]
        turn = 0.5 * np.array(
            [
                -q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                q[0] * w[2] + q[1] * w[1] - q[2] * w[0],
            ]
        )
        return np.concatenate([np.cross(INERTIA * w, w) / INERTIA, turn])

    y = solve_ivp(slope, (0, time), [*RATE, 1, 0, 0, 0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return y[:3], y[3:]


def observed_order(errors: list[float], ratio: float = 2.0) -> float:
    return float(np.log(errors[0] / errors[-1]) / np.log(ratio) / (len(errors) - 1))


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_equal_steps_give_the_printed_coefficients(order):
    out = np.empty(order)
    coefficients(0.25 * np.arange(order), 0.25, out)
    np.testing.assert_allclose(out / 0.25, PRINTED[order], rtol=1e-14)


def test_variable_coefficients_integrate_polynomials_of_their_order_exactly():
    ages = np.array([0.0, 0.3, 0.35, 0.9])
    for order in (2, 3, 4):
        out = np.empty(order)
        coefficients(ages[:order], 0.2, out)
        for power in range(order):
            exact = 0.2 ** (power + 1) / (power + 1)
            assert out @ (-ages[:order]) ** power == pytest.approx(exact, rel=1e-12)
    # field notes: (1 + ρ/2, −ρ/2)
    coefficients(np.array([0.0, 0.3]), 0.2, out[:2])
    assert out[:2] / 0.2 == pytest.approx([1 + 1 / 3, -1 / 3], rel=1e-14)


@pytest.mark.parametrize(
    ("name", "order"), [("ab1", 1), ("ab2", 2), ("ab3", 3), ("ab4", 4), ("rk4", 4)]
)
def test_observed_order_on_a_forced_oscillator(name, order):
    errors = [oscillator_error(name, h) for h in (0.02, 0.01, 0.005)]
    assert observed_order(errors) == pytest.approx(order, abs=0.15)  # next-order term at 0.02 s


@pytest.mark.parametrize(
    ("name", "order"), [("ab1", 1), ("ab2", 2), ("ab3", 3), ("ab4", 4), ("rk4", 4)]
)
def test_observed_order_of_rate_and_attitude_of_a_tumbling_body(name, order):
    truth = euler_equations(4.0)
    errors = []
    for h in (0.02, 0.01, 0.005):
        rate, attitude = tumbling(name, h, 4.0)
        errors.append([np.abs(rate - truth[0]).max(), np.abs(attitude - truth[1]).max()])
    for column in np.array(errors).T:
        assert observed_order(list(column)) == pytest.approx(order, abs=0.25)


def test_tumbling_body_stays_within_1e_7_degrees_per_second_of_dop853_over_30_s():
    truth, _ = euler_equations(30.0)
    rate, _ = tumbling("rk4", 0.005, 30.0)
    assert np.degrees(np.abs(rate - truth).max()) < 1e-7
    rate, _ = tumbling("ab4", 0.001, 30.0)  # the step of a real-time run
    assert np.degrees(np.abs(rate - truth).max()) < 1e-7


def test_jittered_steps_keep_second_order_only_with_variable_coefficients():
    hs = (0.01, 0.005, 0.0025, 0.00125)
    kept = [oscillator_error(AdamsBashforth(2), h, 0.8) for h in hs]
    lost = [oscillator_error(AdamsBashforth(2, variable=False), h, 0.8) for h in hs]
    assert observed_order(kept) == pytest.approx(2.0, abs=0.2)
    # jitter is random, so the first-order error is a random walk: order between ½ and 1½
    assert observed_order(lost) == pytest.approx(1.0, abs=0.5)
    assert lost[-1] > 10 * kept[-1]


@pytest.mark.parametrize("order", [3, 4])
def test_jittered_steps_keep_higher_orders_too(order):
    errors = [oscillator_error(AdamsBashforth(order), h, 0.5) for h in (0.01, 0.005, 0.0025)]
    assert observed_order(errors) == pytest.approx(order, abs=0.35)


def test_the_derivative_is_asked_for_at_strictly_increasing_times_and_once_per_step():
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    data = mujoco.MjData(model)
    asked = []
    mujoco.set_mjcb_passive(lambda m, d: asked.append(d.time))
    try:
        stepper = make("ab4")
        stepper.step(model, data, 1)
        startup = len(asked)
        stepper.step(model, data, 20)
    finally:
        mujoco.set_mjcb_passive(None)
    assert np.all(np.diff(asked) > 0)
    assert asked[startup:] == pytest.approx(0.01 * np.arange(1, 21), abs=1e-12)
    assert startup == 15


def test_memory_restarts_when_time_was_moved():
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    data = mujoco.MjData(model)
    stepper = make("ab3")
    results = []
    for _ in range(2):
        mujoco.mj_resetData(model, data)
        data.ctrl[0], data.qpos[0] = 1.0, 0.3
        stepper.step(model, data, 50)
        results.append(data.qpos[0])
    assert results[0] == results[1]


def test_adams_bashforth_1_moves_motor_activations_as_mujoco_does():
    xml = OSCILLATOR.replace(
        '<general name="f" joint="j" dyntype="filter" dynprm="0.5"/>',
        '<dcmotor joint="j" resistance="10" motorconst="0.38 0.38" input="pos"'
        ' controller="1.8 0 0.01 2.5 0 4.8"/>'
        '<general joint="j" dyntype="filterexact" dynprm="0.003"/>',
    )
    acts = []
    for name in ("euler", "ab1"):
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.1
        make(name).step(model, data, 10)
        acts.append(data.act.copy())
    np.testing.assert_allclose(acts[0], acts[1], rtol=1e-9)


def test_constraints_and_sensors_work_under_adams_bashforth():
    xml = """
    <mujoco><option timestep="0.001"/>
    <default><geom type="capsule" size="0.02" fromto="0 0 0 .3 0 0" contype="0"/></default>
    <worldbody>
      <body name="a"><joint name="a" axis="0 1 0"/><geom/><site name="tip" pos=".3 0 0"/></body>
      <body name="c" pos="0 0 0.2"><joint name="c" axis="0 1 0"/><geom/></body>
    </worldbody>
    <equality><joint joint1="c" joint2="a" solref="0.01 1"/></equality>
    <sensor><jointpos joint="a"/><velocimeter site="tip"/></sensor></mujoco>"""
    end = []
    for name in ("rk4", "ab2"):
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        make(name).step(model, data, 600)
        mujoco.mj_forward(model, data)
        end.append(np.concatenate([data.qpos, data.sensordata]))
    np.testing.assert_allclose(end[0], end[1], atol=1e-4)  # second order at 1 ms
    assert abs(end[1][0] - end[1][1]) < 1e-3


def test_what_only_mj_step_can_advance_is_refused():
    delayed = '<sensor><jointpos joint="j" delay="0.02" nsample="3"/></sensor></mujoco>'
    xml = OSCILLATOR.replace("</mujoco>", delayed)
    model = mujoco.MjModel.from_xml_string(xml)
    with pytest.raises(TwinError, match="delay buffers"):
        make("ab2").step(model, mujoco.MjData(model))


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(TwinError, match=r"ab5.*implicitfast, euler, rk4, ab1"):
        make("ab5")


@pytest.mark.parametrize("name", NAMES)
def test_every_integrator_counts_time(name):
    model = mujoco.MjModel.from_xml_string(OSCILLATOR)
    data = mujoco.MjData(model)
    stepper = make(name).fresh()
    stepper.step(model, data, 3)
    stepper.step(model, data, 2, dt=0.005)
    assert data.time == pytest.approx(0.04, abs=1e-15)
    assert model.opt.timestep == 0.01


@pytest.fixture(scope="module")
def steered():
    """Positions each 0.2 s of a launch steered at 250 Hz, by integrator, step and memory."""
    config = Converge(flight="closed-loop", duration_s=2.0)

    class Remembering(flights.StudyPlant):
        advance = Plant.advance  # as `twin fly` does: the memory goes on over commands

    def fly(name: str, dt: float, remember: bool) -> np.ndarray:
        track = []
        with pytest.MonkeyPatch.context() as patch, native.installed():
            if remember:
                patch.setattr(flights, "StudyPlant", Remembering)
            loop = flights.Loop(flights.load_for(config)(dt), name, config, 4_000_000)
            every = flights.INTERVAL_NS
            plant = loop.plant

            def keep(time_ns: int) -> None:
                if time_ns % every == 0:
                    track.append(plant.position.copy())

            loop.run(2 * 10**9, keep)
        return np.array(track)

    return fly


@pytest.mark.parametrize("name", ["ab2", "ab3"])
def test_memory_over_commands_costs_a_flight_at_1_ms_no_accuracy(steered, name):
    """Against RK4 at a quarter of the step; docs/integrators.md has the whole table."""
    truth = steered("rk4", 0.25e-3, remember=False)
    kept, renewed = (
        np.linalg.norm(steered(name, 1e-3, remember) - truth, axis=1).max()
        for remember in (True, False)
    )
    assert kept < 1.1 * renewed
    assert kept < 5e-3  # m; implicitfast errs 8 mm in 3 s (docs/convergence.md)
