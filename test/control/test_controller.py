# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a measured state to efforts, without ROS: modes, limits, references, payloads."""

from controller_bench import (
    ARM,
    gravity_with,
    LIMIT,
    LOAD,
    make_controller,
    NAMES,
    NOW,
    options,
    Q,
    SECOND,
    set_point,
    update,
    V,
    ZERO,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.braking import braked
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import default_options
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point

# --- the equation of motion ----------------------------------------------------------------------

@pytest.mark.parametrize('compensates', [(), ('friction',)])
@pytest.mark.parametrize('scale', [[1.0], [2.0, 0.5]])
def test_the_equation_of_motion_is_in_units_of_the_command(compensates, scale):
    """It has the friction that is compensated, minus what the drives of the robot add."""
    drive = make_effort_calibration(NAMES, scale)
    arm = (ARM if drive is None else ARM.with_drive(drive)).with_friction(
        make_friction(NAMES, viscous=[3.0, 2.0]))
    controller = Controller(arm, options(
        effort_convention=EffortConvention(robot_compensates=compensates)))
    update(controller, NOW, Q, V)
    controller.follow(set_point(Q.tolist(), V.tolist()), 0)
    output = update(controller, NOW, Q, V)
    M, h = output.motion_equation(Q, V)
    a, s, body = np.array([2.0, -3.0]), np.array(scale), ArmDynamics(arm).rigid_body
    friction = output.law.friction
    assert friction == pytest.approx([1.5, 0.6])
    tau = body.inverse_dynamics(Q, V, a) - body.gravity(Q) + friction
    assert M @ a + h == pytest.approx((tau - s * friction * len(compensates)) / s)


# --- missing velocity, bad states ----------------------------------------------------------------

@pytest.mark.parametrize('mode', ['gravity_compensation', 'none'])
def test_another_command_ends_the_reference(mode):
    controller = make_controller()
    update(controller, NOW, Q, ZERO)
    controller.follow(set_point([1.0, 0.2]), 0)
    controller.set_options(options(command=mode))
    controller.set_options(options())
    output = update(controller, NOW, Q, ZERO)
    assert output.reference is None
    assert output.command.tolist() == output.holding_effort().tolist()


# --- events: stops, set-points, faults -----------------------------------------------------------

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


def test_a_stop_begins_with_at_most_twice_the_velocity_limit():
    one = Controller(ARM, default_options(ARM))
    for v, expected in ((19.0, 19.0), (500.0, 20.0)):  # the limit is 10 rad/s
        one.followed.end()
        one.followed.stop(NOW, Q, np.array([v, -v]))
        assert one.trajectory.sample(NOW).velocity == pytest.approx([expected, -expected])


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


# --- payloads ------------------------------------------------------------------------------------

def test_a_replaced_transition_continues_from_its_present_payload():
    controller = make_controller()
    done: list[tuple[Payload, ...]] = []
    controller.set_payloads([LOAD], 2.0, done.append)
    update(controller, NOW, Q, ZERO)
    midway = update(controller, NOW + SECOND, Q, ZERO).command
    controller.set_payloads([], 1.0, done.append)
    bare = gravity_with([])
    for seconds, expected in ((1.0, midway), (1.5, 0.5 * (midway + bare)), (2.0, bare)):
        output = update(controller, NOW + round(seconds * SECOND), Q, ZERO)
        assert output.command == pytest.approx(expected, abs=1e-9)
    assert output.command.tolist() == bare.tolist()
    assert done == [()]  # the first load was never completely active


# --- no command without a bound ------------------------------------------------------------------

LOAD = make_payload('tool0', 5.0, (0.05, 0.0, 0.1), np.diag((0.01, 0.02, 0.02)))
COMPENSATES_GRAVITY = EffortConvention(robot_compensates=('gravity',))

few = settings(max_examples=50)
angles = st.lists(st.floats(-np.pi, np.pi), min_size=2, max_size=2).map(np.array)


# --- the hold ------------------------------------------------------------------------------------

@few
@given(angles, st.floats(0.0, 1.0), st.sampled_from(['computed_torque', 'gravity_compensation']),
       st.sampled_from([EffortConvention(), COMPENSATES_GRAVITY]))
def test_without_a_reference_the_command_is_the_hold(q, scale, mode, semantics):
    one = make_controller(command=mode, effort_limit_fraction=scale, effort_convention=semantics)
    output = update(one, NOW, q, ZERO)
    assert output.command.tolist() == output.holding_effort().tolist()


@few
@given(angles, angles, st.floats(0.0, 1.0), st.sampled_from([None, LOAD]), st.booleans())
def test_command_and_hold_are_within_the_limits_with_what_the_robot_adds(
    q, goal, scale, load, robot_holds,
):
    one = make_controller(
        effort_limit_fraction=scale,
        effort_convention=COMPENSATES_GRAVITY if robot_holds else EffortConvention())
    one.set_payloads([] if load is None else [load], 0.0, lambda _: None)
    update(one, NOW, q, ZERO)
    one.follow(set_point(goal), 0)
    output = update(one, NOW, q, ZERO)
    holding = output.holding_effort()
    assert (np.abs(output.command) <= np.maximum(scale * LIMIT, np.abs(holding))).all()
    for effort in (output.command, holding):
        assert (np.abs(effort) <= LIMIT).all()
        if robot_holds:
            assert (np.abs(effort + output.robot_gravity) <= np.maximum(
                LIMIT, np.abs(output.robot_gravity)) + 1e-9).all()


# --- non-finite numbers --------------------------------------------------------------------------

@pytest.mark.parametrize('size', [1e155, 1e200, 1e300])
def test_a_non_finite_effort_is_rejected_without_side_effects(size):
    one = make_controller()
    before = update(one, NOW, Q, ZERO)
    one.follow(set_point(Q), 0)
    with np.errstate(all='ignore'), pytest.raises(NonFiniteEffortError) as caught:
        update(one, NOW, Q, np.full(2, size))
    assert 'position [0.8, 0.5] are not finite' in str(caught.value)
    one.followed.end()
    after = update(one, NOW, Q, ZERO)
    assert after.command.tolist() == before.holding_effort().tolist()
