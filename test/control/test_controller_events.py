# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Events of the controller between two states: stops, lost states, faults, shifted time."""

from controller_bench import ARM, LOAD, make_controller, NAMES, NOW, Q, SECOND, update, V, ZERO
import numpy as np
import pytest
from robot_dynamics.control.braking import braked
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import default_options
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point

GAINS = make_gains(NAMES)
MS = SECOND // 1000
NOTHING_TO_STOP = 'nothing to stop: the node does not command the arm'


def make(**options: object) -> Controller:
    """Return a controller whose references have limits of velocity, acceleration and jerk."""
    return make_controller(conditions_references=True, **options)


def moving(**options: object) -> Controller:
    """Return a controller 1 s after the start of a motion of 2 s."""
    one = make(**options)
    update(one, NOW, Q, ZERO)
    one.follow(quintic_point_to_point(NAMES, Q, [1.6, 0.1], 2.0), 0)
    update(one, NOW + SECOND, Q, V)
    return one


# --- stops ---------------------------------------------------------------------------------------

def test_without_a_state_or_a_command_there_is_nothing_to_stop():
    one = make()
    assert one.has_stopped
    assert one.stop() == NOTHING_TO_STOP
    assert one.trajectory is None
    update(one, NOW, Q, V)
    assert one.has_stopped
    one = make(command='none')
    update(one, NOW, Q, V)
    assert one.stop() == NOTHING_TO_STOP
    assert one.trajectory is None


def test_a_stop_of_a_motion_begins_on_its_path_and_ends_before_the_goal_in_its_time():
    one = moving()
    before = update(one, NOW + SECOND, Q, V).reference
    assert not one.has_stopped
    assert one.stop() == 'stopping along the reference, then holding the position'
    assert not one.has_stopped
    after = update(one, NOW + SECOND, Q, V).reference
    assert after.position == pytest.approx(before.position)
    assert after.velocity == pytest.approx(before.velocity)
    end = update(one, NOW + 20 * SECOND, Q, V).reference
    assert one.has_stopped
    assert not end.velocity.any()
    assert np.abs(end.position - [1.6, 0.1]).max() > 0.01


@pytest.mark.parametrize('command', ['gravity_compensation', 'none'])
def test_a_stop_that_was_requested_holds_the_position_with_any_command(command):
    one = make(command=command, stops_and_holds=True)
    assert update(one, NOW, Q, ZERO).reference is None
    one.stop_from_state()
    for ms in (10, 1000):
        assert update(one, NOW + ms * MS, Q, ZERO).reference.position.tolist() == Q.tolist()


@pytest.mark.parametrize('command', ['computed_torque', 'joint_impedance'])
def test_friction_brakes_a_stop_from_a_measured_velocity(command):
    """Its compensation, given too large, would drive a light joint on after each fault."""
    arm = ARM.with_friction(make_friction(NAMES, coulomb=[4.0, 1.5]))
    one = Controller(arm, default_options(arm, command=command))
    update(one, NOW, Q, V)
    stop = update(one, NOW + MS, Q + 1e-3 * V, V)
    assert stop.reference.velocity == pytest.approx(V)
    assert np.abs(stop.law.friction).max() < 0.1
    one.stop()  # of the same motion
    assert np.abs(update(one, NOW + 2 * MS, Q + 2e-3 * V, V).law.friction).max() < 0.1
    one.follow(quintic_point_to_point(NAMES, Q, [1.6, 1.3], 2.0), 0)
    motion = update(one, NOW + SECOND, Q + 0.4, ZERO)
    assert motion.reference.velocity.min() > 0.3
    one.stop()
    q = motion.reference.position
    assert update(one, NOW + SECOND, q, ZERO).law.friction == pytest.approx([4.0, 1.5], rel=0.05)


def test_a_stop_does_not_begin_while_the_caller_forbids_it():
    """In a fault, for example: the reference begins where the arm is when the fault has ended."""
    one = make(stops_and_holds=True)
    one.may_hold = False
    for _ in range(2):
        assert update(one, NOW, Q, V).reference is None
        one.stop_from_state()
    one.may_hold = True
    reference = update(one, NOW + MS, Q + 0.1, ZERO).reference
    assert reference.position.tolist() == (Q + 0.1).tolist()


# --- references ----------------------------------------------------------------------------------

@pytest.mark.parametrize('timeout', [0.2, 0.4])
def test_a_set_point_with_a_velocity_is_followed_until_the_timeout(timeout):
    one = make(stream_timeout=timeout)
    update(one, NOW, ZERO, ZERO)
    one.follow(make_trajectory(NAMES, [0.0], [ZERO], [[0.2, 0.0]], (), NAMES), 0)
    velocities = []
    for ms in (200, 400, 5000):
        velocities.append(update(one, NOW + ms * MS, ZERO, ZERO).reference.velocity[0])
    assert velocities[0] > 0.15
    assert (velocities[1] > 0.15) == (timeout == 0.4)
    assert velocities[2] == 0.0


# --- terms and words -----------------------------------------------------------------------------

def test_terms_are_computed_when_they_are_read_for_the_state_of_their_output():
    """Also if other states and another load follow."""
    one, other = make(), make()
    output, read = (update(each, NOW, Q, V) for each in (one, other))
    expected = read.terms
    update(one, NOW + MS, Q + 0.3, -V)
    one.set_payloads([LOAD], 0.0, lambda _: None)
    update(one, NOW + 2 * MS, Q + 0.3, -V)
    for ours, theirs in zip(output.terms, expected):
        assert np.array_equal(ours, theirs)
    assert output.gravity_compensation.tolist() == read.gravity_compensation.tolist()
    assert output.holding_effort().tolist() == read.holding_effort().tolist()


@pytest.mark.filterwarnings('error')
def test_terms_that_are_not_finite_are_not_reported():
    one = make()
    output = update(one, NOW, Q, np.full(2, 1e200))
    assert output.terms is None  # the energy
    assert output.command == pytest.approx(output.holding_effort())
    assert update(one, NOW + MS, Q, V).terms is not None


# --- the hold in a fault -------------------------------------------------------------------------

def damping(v: np.ndarray, loads: tuple[object, ...] = (), q: np.ndarray = Q) -> np.ndarray:
    body = ArmDynamics(ARM.with_payloads(list(loads))).rigid_body  # type: ignore[arg-type]
    return np.asarray(0.5 * body.mass_matrix(q) @ (GAINS.kd * v))


@pytest.mark.parametrize('loads', [(), (LOAD,)])
def test_in_a_fault_the_arm_is_held_and_damped(loads):
    """Against the motion, with half of the damping of the feedback and the inertia of the load."""
    one, v = make(), 0.2 * V
    one.set_payloads(loads, 0.0, lambda _: None)  # type: ignore[arg-type]
    hold = update(one, NOW, Q, v).holding_effort()
    damped = braked(one, Q, v, hold)
    assert damped == pytest.approx(hold - damping(v, loads))
    assert float(v @ (damped - hold)) < 0.0  # it takes energy away
    assert braked(one, Q, ZERO, hold).tolist() == hold.tolist()


def test_a_lost_joint_is_braked_by_the_plan_whatever_it_does_to_the_others():
    one, v = make(), np.array([0.2, 0.1])
    hold = update(one, NOW, Q, v).holding_effort()
    lost, plan = np.array([False, True]), np.array([0.2, 0.1])
    for driven in (0.2, 0.5):
        damped = braked(one, Q, v * [driven / 0.2, 1.0], hold, Q, lost=lost, planned=plan)
        expected = [damping(v * [driven / 0.2, 1.0])[0], damping(v)[1]]
        assert damped == pytest.approx(hold - expected)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('v', [[1e308, -1e308], [1e307, -1e307]])
def test_damping_that_is_not_finite_is_left_out(v):
    hold = np.array([3.0, -2.0])
    assert braked(make(), Q, np.array(v), hold).tolist() == hold.tolist()
