# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Friction of gears and drives: its law, in inverse and forward dynamics, and presliding."""

from controller_bench import ARM, NAMES, update
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

laws = settings(deadline=None, max_examples=40, derandomize=True)
values = st.floats(-5.0, 5.0)


def gears(**changes):
    return make_friction(NAMES, **{
        'sigmoid': [1.5, 0.5], 'sigmoid_velocity': [0.05, 0.1], 'load_coefficient': [0.1, 0.3],
        'presliding_distance': [0.01, 0.0], **changes})


def arm_with_gears(**changes):
    return ARM.with_friction(gears(viscous=[0.5], coulomb=[1.0], **changes))


def test_the_law_by_hand():
    effort = gears().effort(np.array([0.05, -0.2]), np.array([10.0, -4.0]))
    by_hand = [(1.5 + 0.1 * 10.0) * np.tanh(1.0), (0.5 + 0.3 * 4.0) * np.tanh(-2.0)]
    assert effort == pytest.approx(np.array(by_hand), rel=1e-14)


@laws
@given(st.lists(values, min_size=6, max_size=6))
def test_forward_dynamics_inverts_inverse_dynamics(numbers):
    q, v, a = np.array(numbers).reshape(3, 2)
    v = v + np.where(v == 0.0, 0.1, 0.0)
    dynamics = ArmDynamics(arm_with_gears())
    tau = dynamics.inverse_dynamics(q, v, a)
    assert dynamics.forward_dynamics(q, v, tau) == pytest.approx(a, rel=1e-8, abs=1e-8)
    assert dynamics.inverse_dynamics_batch(q[None], v[None], a[None])[0] == pytest.approx(
        tau, rel=1e-12)
    terms = dynamics.terms(q, v, a)
    assert terms.effort == pytest.approx(tau, rel=1e-9, abs=1e-9)


def tracked_friction(friction, v, error, rate, load):
    """Return the compensation by the formula on the page friction.md."""
    def sign(width):
        return np.clip(np.tanh(v / width) + error / 0.025, -1.0, 1.0)

    return (friction.viscous * (v + rate * error) + friction.dry(v) * sign(0.01) + friction.offset
            + (friction.sigmoid + friction.load_coefficient * np.abs(load))
            * sign(friction.sigmoid_velocity))


@pytest.mark.parametrize('mode', ['reference', 'measured'])
def test_computed_torque_has_it(mode):
    arm = arm_with_gears()
    controller = Controller(arm, ControllerOptions(make_gains(NAMES), friction_compensation=mode))
    q, v = np.array([0.5, -0.3]), np.array([0.2, -0.1])
    update(controller, 1, q, v)
    controller.follow(make_trajectory(
        NAMES, [0.0], [[1.0, 0.2]], [[0.1, -0.1]], [[0.3, 0.4]], NAMES), 1)
    output = update(controller, 2_000_000_000, q, v)
    terms = output.terms
    load = terms.inertial + terms.coriolis + terms.gravity
    if mode == 'measured':
        expected = arm.friction.effort(v, load)
    else:
        gains = make_gains(NAMES)
        reference = output.reference
        expected = tracked_friction(
            arm.friction, reference.velocity, reference.position - q, gains.ratio, load)
    assert terms.friction == pytest.approx(expected, rel=1e-9)
    assert output.computed_torque == pytest.approx(load + expected, rel=1e-9)
    assert np.abs(expected).min() > 0.5


# --- presliding ----------------------------------------------------------------------------------

def turning_motion(speed=1.0):
    """Return a reciprocating motion, (m, 2), and its velocity."""
    t = np.linspace(0.0, 4.0 * np.pi / speed, 4001)
    q = 0.1 * np.sin(speed * t)
    return np.column_stack([q, q]), np.column_stack([0.1 * speed * np.cos(speed * t)] * 2)


def test_after_a_turn_the_sign_changes_over_twice_the_distance():
    q, v = turning_motion()
    z = presliding_state(q, v, np.array([0.01, 0.0]))
    assert np.abs(z).max() <= 1.0
    turn = int(np.argmax(q[:, 0]))
    moved = q[turn, 0] - q[turn:turn + 600, 0]
    assert z[turn:turn + 600, 0] == pytest.approx(np.maximum(1.0 - moved / 0.01, -1.0), abs=1e-9)
    # with zero presliding distance it is the smooth sign of velocity
    assert z[:, 1] == pytest.approx(np.tanh(v[:, 1] / 0.01), abs=1e-12)


def test_the_speed_of_a_motion_does_not_matter():
    q, v = turning_motion()
    d = np.array([0.01, 0.03])
    assert presliding_state(*turning_motion(0.1), d) == pytest.approx(
        presliding_state(*turning_motion(10.0), d), abs=1e-9)
    assert presliding_state(q[:0], v[:0], d).shape == (0, 2)


def test_friction_along_a_motion_is_that_of_single_states_far_from_its_turns():
    q, v = turning_motion()
    dynamics = ArmDynamics(arm_with_gears())
    load = np.full_like(q, 3.0)
    along, single = dynamics.friction_along(q, v, load), dynamics.arm.friction.effort(v, load)
    slides = np.abs(presliding_state(q, v, np.array([0.01, 0.01]))[:, 0]) == 1.0
    sliding = slides & (np.abs(v[:, 0]) > 0.005)  # at the reversal both signs are valid
    assert 0.5 < sliding.mean() < 1.0
    assert along[sliding, 0] == pytest.approx(single[sliding, 0], rel=1e-12)
    assert np.abs(along - single)[~slides, 0].max() > 0.5
