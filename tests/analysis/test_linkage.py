"""Physics fitted with `mujoco.sysid`, against motions that come from closed forms, not MuJoCo."""

import mujoco
import numpy as np
import pytest

from analysis.linkage.fit import fit_linkage
from analysis.linkage.problem import DELAY, Knob, LinkageError, LinkageProblem, Moves
from analysis.transfer_function import TransferFunctionModel

# 1e-3 kg m² per axis, driven by a spring to the command and damped: a second-order system
INERTIA, STIFFNESS, DAMPING, LATE = 1e-3, 1.6, 0.05, 0.006
SCENE = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="gimbal_x" axis="1 0 0" damping="0.02"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>
    <body pos="1 0 0"><joint name="gimbal_y" axis="0 1 0" damping="0.02"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>
  </worldbody>
  <actuator><position name="a" joint="gimbal_x" kp="1"/><position name="b" joint="gimbal_y" kp="1"/>
  </actuator>
</mujoco>
"""
NOISE = np.radians(0.05)


def build(values):
    model = mujoco.MjModel.from_xml_string(SCENE)
    stiffness = values["stiffness"]
    model.actuator_gainprm[:, 0] = stiffness
    model.actuator_biasprm[:, 1] = -stiffness
    model.dof_damping[:] = values["damping"]
    return model


def knobs(*names):
    every = {
        "stiffness": Knob("stiffness", 1.0, 0.2, 5.0, "N·m/rad"),
        "damping": Knob("damping", 0.02, 0.004, 0.2, "N·m·s/rad"),
        DELAY: Knob(DELAY, 1e-3, -5e-3, 0.05, "s"),
    }
    return [every[n] for n in names]


@pytest.fixture(scope="module")
def moves():
    """Steps of the closed form, read with noise, an offset and 6 ms of delay."""
    rng = np.random.default_rng(0)
    t = np.arange(3000) * 1e-3
    levels = np.vstack([[0.0, 0.0], rng.uniform(-0.14, 0.14, (11, 2))])
    command = levels[(t // 0.25).astype(int)]
    omega = np.sqrt(STIFFNESS / INERTIA)
    truth = TransferFunctionModel.second_order(omega, DAMPING / 2.0 / np.sqrt(STIFFNESS * INERTIA))
    angle = truth.simulate(command, 1e-3)
    late = round(LATE / 1e-3)
    angle = np.vstack([np.zeros((late, 2)), angle[:-late]])
    angle += np.array([0.01, -0.02])  # the potentiometers' zeros
    angle += rng.normal(0.0, NOISE, angle.shape)
    rows = slice(0, None, 4)
    return Moves(command, t[rows], angle[rows], np.arange(1, 12) * 0.25)


def first_half(moves):
    keep = moves.time < 1.5
    return Moves(moves.control[:1500], moves.time[keep], moves.angle[keep], moves.changes[:5])


@pytest.mark.thorough
def test_stiffness_damping_and_delay_of_a_closed_form_are_found_within_their_intervals(moves):
    """99.9 % intervals; and MuJoCo's semi-implicit steps of 1 ms are half a step late."""
    fit = fit_linkage(moves, knobs("stiffness", "damping", DELAY), build)
    for e, true in zip(fit.estimates, (STIFFNESS, DAMPING, LATE), strict=True):
        half_step = 5e-4 if e.name == DELAY else 0.01 * true
        assert abs(e.value - true) < 3.3 * e.std + half_step
        assert e.std < 0.02 * true
    assert min(fit.held_out) > 97.0  # 0.05° of some 5°
    assert max(fit.start) < 90.0
    assert fit.warnings == ()


def test_a_wrong_scale_of_the_potentiometers_leaves_noise_only_at_the_true_parameters(moves):
    """Readings 1 % too large, which alone is 1.1 times the noise; 8 %: steps of 1 ms leave 5 %."""
    scaled = Moves(moves.control, moves.time, 1.01 * moves.angle, moves.changes)
    problem = LinkageProblem(
        scaled, tuple(knobs("stiffness", "damping", DELAY)), build, ("gimbal_x", "gimbal_y")
    )
    truth = np.log([STIFFNESS, DAMPING / 0.02]).tolist()
    # MuJoCo's semi-implicit step is half a step ahead of the closed form
    left = problem.left(np.array([*truth, (LATE + 5e-4) / 1e-3]))[:, :, 0]
    assert left.std() == pytest.approx(1.01 * NOISE, rel=0.08)


@pytest.mark.thorough
def test_moves_held_out_do_not_enter_the_fit(moves):
    """Spoiling every held-out reading changes their fit and nothing else."""
    moves = first_half(moves)
    spoilt = moves.angle.copy()
    spoilt[moves.held_out] += 1.0 * np.sin(40.0 * moves.time[moves.held_out, None])
    one = fit_linkage(moves, knobs("stiffness"), lambda v: build({**v, "damping": DAMPING}), most=2)
    other = fit_linkage(
        Moves(moves.control, moves.time, spoilt, moves.changes),
        knobs("stiffness"),
        lambda v: build({**v, "damping": DAMPING}),
        most=2,
    )
    assert other.value("stiffness") == one.value("stiffness")
    assert max(other.held_out) < 50.0
    assert any("poor fit" in w for w in other.warnings)


@pytest.mark.thorough
def test_a_value_that_the_recording_asks_beyond_its_bound_is_said(moves):
    low = [Knob("stiffness", 0.5, 0.2, 0.9, "N·m/rad"), *knobs("damping")]
    fit = fit_linkage(first_half(moves), low, build, most=4)
    assert any("ended at its bound" in w for w in fit.warnings)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"knobs": []}, "no parameter"),
        ({"joints": ("gimbal_x", "gimbal_z")}, "no joint 'gimbal_z'"),
        ({"changes": np.array([0.1])}, "1 moves"),
        ({"control": np.zeros((100, 3))}, "3 commands for a model of 2"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_one_line(moves, change, says):
    given = Moves(
        change.get("control", moves.control),
        moves.time,
        moves.angle,
        change.get("changes", moves.changes),
    )
    with pytest.raises(LinkageError, match=says):
        fit_linkage(
            given,
            change.get("knobs", knobs("stiffness", "damping")),
            build,
            change.get("joints", ("gimbal_x", "gimbal_y")),
        )


def test_a_start_outside_its_bounds_is_refused():
    with pytest.raises(LinkageError, match="not within 1 to 2"):
        Knob("k", 3.0, 1.0, 2.0, "1")
