# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectories with tolerances and a result, in lock-step with an arm."""

from functools import cache, partial
import math
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st
from lock_step_loop import directions, FIRST_STAMP, LockStep, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.trajectory_goal import (
    default_tolerances,
    ResultCode,
    Tolerances,
    TrajectoryGoal,
)
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory

WAY = 0.3
"""[rad] of the motions."""


@pytest.fixture
def bench() -> LockStep:
    return held(smooth_arm('default'))


def held(arm: ArmModel, **options: Any) -> LockStep:
    """Return an arm that has been held for a while."""
    bench = LockStep(arm, **{'q': middle(arm, 0.3), **options})
    bench.run(0.3)
    return bench


def plan(bench: LockStep, seconds: float = 1.5, way: float = WAY) -> JointTrajectory:
    """Return a motion from rest to rest, as a planner sends it: velocities and accelerations."""
    q, zero = bench.q, [0.0 * bench.q] * 2
    return make_trajectory(
        bench.arm.joint_names, [0.0, seconds], [q, q + way * directions(len(q))], zero, zero)


def tight(bench: LockStep, **changes: Any) -> Tolerances:
    n = len(bench.q)
    return Tolerances(**{
        'path': np.full(n, 0.02), 'path_velocity': np.full(n, np.inf),
        'goal': np.full(n, 0.005), 'goal_velocity': np.full(n, np.nan), **changes})


def cancel(bench: LockStep, goal: Any) -> float:
    """Cancel a goal; return the time [s] until the end of the planned stop."""
    bench.loop.goals.cancel(goal)
    return 1e-9 * (bench.loop.controller.trajectory.end_ns - FIRST_STAMP) - 1e-3 * bench.k


# ---------------------------------------------------------------------- results

@pytest.mark.parametrize('name', ['default', 'panda'])
def test_a_plan_succeeds_within_its_tolerances(name):
    bench = held(smooth_arm(name))
    ends: list[int] = []
    trajectory = plan(bench)
    goal = bench.loop.execute(trajectory, 0, tight(bench), lambda: ends.append(bench.k))
    bench.run(1.4)
    assert goal.result is None
    bench.run(0.4)
    assert goal.result == (ResultCode.SUCCESSFUL, '', False)
    assert len(ends) == 1
    assert bench.q == pytest.approx(trajectory.points[-1].position, abs=0.005)
    assert bench.loop.goals.goal is None


def test_progress_has_the_reference_of_its_state(bench):
    goal = bench.loop.execute(plan(bench))
    trace = bench.run(0.75)
    k = (goal.progress.stamp_ns - FIRST_STAMP) // MS - round(1e3 * trace.t[0])
    assert goal.progress.position == pytest.approx(trace.q[k - 1], abs=1e-12)  # after its step
    assert goal.progress.desired.position == pytest.approx(trace.q[k], abs=0.01)
    assert np.abs(goal.progress.desired.velocity).min() > 0.1


def test_a_push_violates_a_path_tolerance_and_the_arm_stops(bench):
    goal = bench.loop.execute(plan(bench), 0, tight(bench, path=np.full(len(bench.q), 1e-3)))
    push = np.zeros(len(bench.q))
    push[0] = 0.05 * min(bench.arm.limits.effort[0], 100.0)
    bench.push = lambda t: push
    bench.run(1.0)
    code, message, _ = goal.result
    assert code is ResultCode.PATH_TOLERANCE_VIOLATED
    assert 'expected at most 1 mrad' in message
    assert any(name in message for name in bench.arm.joint_names)
    assert bench.loop.goals.interruption == message
    bench.push = lambda t: 0.0
    bench.run(2.0)
    assert bench.run(0.1).speed.max() < 1e-3


def test_without_a_goal_time_the_goal_waits_for_any_time(bench):
    goal = bench.loop.execute(plan(bench), 0, tight(
        bench, goal=np.full(2, 1e-15), goal_time=math.inf))
    bench.run(8.0)
    assert goal.result is None


def test_a_tolerance_of_the_velocity_replaces_the_rest(bench):
    goal = bench.loop.execute(plan(bench), 0, tight(
        bench, goal_velocity=np.full(2, 1e-9), goal_time=0.05))
    bench.run(1.7)
    code, message, _ = goal.result
    assert code is ResultCode.GOAL_TOLERANCE_VIOLATED
    assert 'the velocity of ' in message


# ---------------------------------------------------------------------- ends

@pytest.mark.parametrize(('name', 'share'), [('default', 0.15), ('ur10', 0.5), ('panda', 0.85)])
def test_a_cancelled_goal_ends_at_rest_soon_after_the_planned_stop(name, share):
    bench = held(smooth_arm(name))
    goal = bench.loop.execute(plan(bench, 1.0), 0, tight(bench))
    bench.run(share)
    stop = cancel(bench, goal)
    assert goal.result is None
    trace = bench.run(stop + 0.05)
    assert goal.result.is_canceled
    assert trace.speed[-1] < 0.03
    assert np.abs(bench.run(0.5).q - bench.q).max() < 2e-3


@cache
def stopping() -> LockStep:
    """Return an arm in a planned stop."""
    bench = held(smooth_arm('default'))
    goal = bench.loop.execute(plan(bench))
    bench.run(0.2)
    cancel(bench, goal)
    return bench


@settings(max_examples=60)
@given(
    rate=st.floats(30.0, 1000.0), speed=st.floats(0.0, 0.1), phase=st.floats(0.0, 0.02),
    vibrates=st.booleans())
@example(500.0, 0.0195, 0.0, False)
@example(500.0, 0.0205, 0.0, False)
def test_a_joint_is_at_rest_if_it_moves_less_than_0_4_mrad_in_20_ms(rate, speed, phase, vibrates):
    """A joint that creeps, or one that is where it was 20 ms ago but has moved meanwhile."""
    bench = stopping()
    goal = TrajectoryGoal(bench.loop.controller, tight(bench))
    goal.cancel()
    end_ns = bench.loop.controller.trajectory.end_ns
    rate = max(rate, 250.0) if vibrates else rate
    times = np.arange(-0.1, 0.5, 1.0 / rate) + phase
    q = bench.q[0] + (1e-3 * np.sin(2.0 * np.pi * 50.0 * times) if vibrates else speed * times)
    for t, one in zip(times, q):
        goal.judge(end_ns + round(1e9 * t), np.array([one, bench.q[1]]), np.zeros(2))
    if vibrates or speed > 0.0202:
        assert goal.result is None
    elif speed < 0.0198:
        assert goal.result.is_canceled


def test_a_cancelled_arm_that_does_not_come_to_rest_is_a_violation_after_five_seconds(bench):
    goal = bench.loop.execute(plan(bench))
    bench.run(0.2)
    end_ns = FIRST_STAMP + bench.k * MS + round(1e9 * cancel(bench, goal))
    for seconds, is_over in ((4.99, False), (5.01, True)):
        for k in (-2, -1, 0):
            goal.judge(end_ns + round(1e9 * seconds) + k * MS, bench.q + 0.1 * k, np.zeros(2))
        assert (goal.result is not None) == is_over
    assert goal.result[:2] == (
        ResultCode.GOAL_TOLERANCE_VIOLATED,
        'cancelled, but the arm is not at rest 5 s after its stop')


def test_a_new_goal_ends_the_one_before(bench):
    first = bench.loop.execute(plan(bench, 1.0), 0, tight(bench))
    bench.run(0.5)
    back = plan(bench, 2.0, 0.0)
    second = bench.loop.execute(JointTrajectory(back.joint_names, back.points[1:]))
    goal = back.points[-1].position.round(4).tolist()
    assert first.result == (
        ResultCode.INVALID_GOAL, f'another goal has replaced this one: {goal}', False)
    bench.run(3.0)
    assert second.result.code is ResultCode.SUCCESSFUL


@pytest.mark.parametrize(('end', 'words'), [
    (lambda bench: bench.loop.stop(), '~/stop was called'),
    (lambda bench: bench.follow(bench.q), 'another goal has replaced this one'),
    (lambda bench: bench.loop.deactivate(bench.now), 'the node was deactivated'),
    (lambda bench: setattr(bench, 'sensor', None), 'fault state_timeout'),
    (lambda bench: bench.loop.goals.end(Ending(Kind.HOLD, 'another model was loaded')),
     'another model was loaded')])
def test_what_ends_the_motion_ends_the_goal_with_its_reason(bench, end, words):
    goal = bench.loop.execute(plan(bench))
    bench.run(0.5)
    end(bench)
    bench.run(0.1)
    code, message, is_canceled = goal.result
    assert (code, is_canceled) == (ResultCode.INVALID_GOAL, False)
    assert words in message


@pytest.mark.parametrize(('name', 'code'), [
    ('following_error', ResultCode.PATH_TOLERANCE_VIOLATED),
    ('position_limit', ResultCode.INVALID_GOAL)])
def test_the_fault_determines_the_code_not_its_message(bench, name, code):
    goal = bench.loop.execute(plan(bench))
    bench.run(0.5)
    bench.loop.end(bench.now, Ending.by(
        Fault(name, 'unlike following_error, a message has any words')))
    assert goal.result[:2] == (
        code, f'fault {name}: unlike following_error, a message has any words')
    assert bench.loop.goals.goal is None


# ---------------------------------------------------------------------- refusals

def test_a_plan_that_would_be_slowed_down_is_refused(bench):
    q, names = bench.q, bench.arm.joint_names
    first = bench.loop.execute(plan(bench))
    bench.run(0.1)

    def path(seconds: float) -> JointTrajectory:
        return make_trajectory(names, [0.0, seconds], [q, q + WAY * directions(len(q))])

    fastest = 0.01 * bench.loop.controller.prepare(path(0.01))[1]
    with pytest.raises(TrajectoryError, match='times its duration, expected the duration itself'):
        bench.loop.execute(path(fastest / 1.01))
    assert bench.loop.controller.prepare(path(1.001 * fastest))[1] < 1.001
    bench.run(1.9)
    assert first.result.code is ResultCode.SUCCESSFUL


def test_a_plan_that_starts_elsewhere_is_refused(bench):
    q, names = bench.q, bench.arm.joint_names
    zero = [[0.0] * len(q)] * 2
    first = bench.loop.execute(plan(bench, 4.0))
    bench.run(0.1)
    near, far = (make_trajectory(
        names, [0.0, 4.0], [q + way * directions(len(q)), q], zero, zero) for way in (0.14, 0.18))
    with pytest.raises(TrajectoryError, match=r'0\.5\d* s late, expected at most 0.5 s'):
        bench.loop.execute(far)
    assert bench.loop.goals.goal is first
    assert first.result is None
    bench.loop.execute(near)


# ---------------------------------------------------------------------- tolerances

NAMES = ('a', 'b', 'c')


def test_default_tolerances_are_those_of_the_goal_only():
    tolerances = default_tolerances(NAMES)
    assert np.isinf(tolerances.path).all()
    assert tolerances.goal.tolist() == [0.01] * 3
    assert tolerances.goal_time == 5.0
    given = default_tolerances(NAMES, np.array([0.0, 0.1, 0.2]))
    assert given.goal.tolist() == [math.inf, 0.1, 0.2]


# --- references that were sent before a stop, a fault or a restart of the states -----------------

@pytest.mark.parametrize(('end', 'words'), [
    (lambda loop: loop.stop(), '~/stop was called'),
    (lambda loop: loop.end(1.0, Ending.by(Fault('broken', 'words'))), 'fault broken: words'),
    (lambda loop: loop.end(1.0, Ending(Kind.HOLD, 'restarted')), 'restarted')])
@pytest.mark.parametrize('is_goal', [True, False])
def test_what_ends_the_motion_refuses_a_goal_that_was_sent_before(end, words, is_goal):
    """It comes while the trajectory is prepared, or before its goal is executed."""
    bench = held(smooth_arm('default'))
    names = bench.arm.joint_names
    trajectory = make_trajectory(names, [0.0], [bench.q + 0.3], [], [], names)
    loop, sent = bench.loop, bench.loop.goals.epoch
    end(loop)
    bench.run(0.1)  # the fault has ended
    if is_goal:
        begin = partial(loop.goals.execute, trajectory, 0, None, lambda: None, sent)
    else:
        begin = partial(loop.follow, trajectory)
        prepare = loop.controller.prepare

        def prepare_while_it_ends(trajectory: JointTrajectory) -> Any:
            prepared = prepare(trajectory)
            end(loop)
            bench.run(0.1)
            return prepared
        loop.controller.prepare = prepare_while_it_ends
    with pytest.raises(TrajectoryError, match=words):
        begin()
    assert loop.goals.goal is None
    assert np.ptp(bench.run(0.5).q, axis=0).max() < 1e-3
