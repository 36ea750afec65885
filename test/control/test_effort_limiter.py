# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of an effort before it is published: properties of the limits and of the rate limit.

Effort limits of a command: the load of the joint, with the compensation by the robot.
"""

import math
from typing import NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.safety.effort_bounds import EffortBounds, NOTHING, RobotEffort
from robot_dynamics.control.safety.effort_limiter import EffortLimiter, EffortLimits

N = 2
LOWER, UPPER, SPEED, MARGIN, RATE = -1.0, 1.5, 2.0, 0.01, 1000.0

LONGEST_STEP = 0.05
"""[s] for which an effort may change at the rate limit since the last one."""

laws = settings(max_examples=100)


def guard(
    lower: float = LOWER, upper: float = UPPER, velocity: float = SPEED, rate: float = RATE,
) -> EffortLimiter:
    return EffortLimiter(EffortLimits(
        np.full(N, lower), np.full(N, upper), np.full(N, velocity), rate))


def vectors(size: float) -> st.SearchStrategy[np.ndarray]:
    numbers = st.floats(-size, size, allow_subnormal=False) | st.sampled_from(
        [0.0, -0.0, size, -size])
    return st.lists(numbers, min_size=N, max_size=N).map(np.array)


class Step(NamedTuple):
    """The arguments of a call of the guard, with the result of `hold`."""

    effort: np.ndarray
    hold: np.ndarray
    q: np.ndarray
    v: np.ndarray
    dt: float


class Guarded(NamedTuple):
    """The result of a call of the guard, and whether each limit has changed it."""

    effort: np.ndarray
    by_position: bool
    by_velocity: bool
    by_rate: bool


def guarded_by(one: EffortLimiter, step: Step) -> Guarded:
    effort, hold, *rest = step
    result, active = one.apply(effort, lambda: hold, *rest), one.active
    assert (active == ()) == bool((result == effort).all())
    return Guarded(result, *(
        name in active for name in ('position limit', 'velocity limit', 'effort rate')))


STEPS = st.builds(
    Step, vectors(300.0), vectors(50.0), vectors(3.0), vectors(4.0),
    st.floats(-1.0, 1.0) | st.sampled_from([0.0, 0.001, 0.002, LONGEST_STEP]))


def span(dt: float) -> float:
    """Return the largest change of an effort at the rate limit, with a margin for rounding."""
    return RATE * min(max(dt, 0.0), LONGEST_STEP) + 1e-12


# --- the rate of change --------------------------------------------------------------------------

@laws
@given(st.lists(STEPS | st.none(), min_size=2, max_size=20))
def test_efforts_in_a_row_keep_to_the_rate_limit(steps):
    """For any requested efforts, and any time since the last one; None is a restart."""
    one = guard()
    last: np.ndarray | None = None
    for step in steps:
        if step is None:
            one.last = last = None
            continue
        effort = guarded_by(one, step).effort
        if last is None:
            assert effort.tolist() == step.hold.tolist()
        else:
            assert (np.abs(effort - last) <= span(step.dt)).all()
        last = effort


@laws
@given(STEPS, STEPS)
def test_within_the_rate_an_effort_is_unchanged_and_otherwise_part_of_the_way(first, second):
    one = guard(-np.inf, np.inf, np.inf)
    start = guarded_by(one, first).effort
    effort, by_position, by_velocity, by_rate = guarded_by(one, second)
    reachable = RATE * min(max(second.dt, 0.0), LONGEST_STEP)
    way = second.effort - start
    longest = np.abs(way).max()
    if longest <= reachable - 1e-9:
        assert effort.tolist() == second.effort.tolist()
        assert not by_rate
    elif longest > reachable + 1e-9:  # all joints change in proportion
        assert effort == pytest.approx(start + reachable / longest * way, abs=1e-9)
        assert by_rate
    assert not by_position
    assert not by_velocity


# --- the limits ----------------------------------------------------------------------------------

def forbidden(step: Step) -> np.ndarray:
    """Return the sign of the forbidden push on each joint; 0 for none, 2 for both signs."""
    signs = np.zeros(N)
    for j in range(N):
        up = step.q[j] > UPPER - MARGIN
        down = step.q[j] < LOWER + MARGIN
        if abs(step.v[j]) > SPEED:
            up, down = up or step.v[j] > 0.0, down or step.v[j] < 0.0
        signs[j] = 2 if up and down else int(up) - int(down)
    return signs


def toward(step):
    """Return a step in which no joint moves away from a limit that it is beyond."""
    at = (step.q > UPPER - MARGIN).astype(float) - (step.q < LOWER + MARGIN)
    return step._replace(v=np.where(at * step.v < 0.0, -step.v, step.v))


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_joint_that_moves_away_from_a_limit_is_braked_by_20_per_second(sign):
    one = guard(rate=1e9)
    one.last = np.zeros(N)
    for push, is_held in ((1.99, False), (2.01, True)):
        guarded = guarded_by(one, Step(
            np.full(N, sign * push), np.zeros(N), np.full(N, sign * 9.0),
            np.full(N, -sign * 0.1), 0.01))
        assert (guarded.by_position, guarded.by_velocity) == (is_held, False)
        assert guarded.effort.any() != is_held


@laws
@given(st.floats(0.5, 3.0), st.floats(-0.4, 0.4), vectors(9.0), vectors(50.0))
def test_the_acceleration_of_a_joint_without_a_limit_stays_as_it_is(inertia, coupling, a, passive):
    """The first joint, at its limit, is not accelerated, although the second one drives it."""
    M, still, one = np.array([[inertia, coupling], [coupling, 0.6]]), np.ones(2), guard(rate=1e9)
    one.last = still
    limited = one.apply(
        still + passive + M @ np.array([1.0 + abs(a[0]), a[1]]), lambda: still,
        np.array([UPPER, 0.0]), np.zeros(2), LONGEST_STEP, lambda q, v: (M, passive))
    assert np.linalg.solve(M, limited - still - passive) == pytest.approx([0.0, a[1]], abs=1e-9)


@laws
@given(st.lists(STEPS, min_size=1, max_size=10))
def test_a_push_that_a_limit_forbids_only_ever_fades(steps):
    """It decreases by the fraction of all changes that the rates permit; no push begins."""
    one = guard()
    for step in map(toward, steps):
        last = step.hold if one.last is None else one.last
        before, signs = last - step.hold, forbidden(step)
        push, wanted = guarded_by(one, step).effort - step.hold, step.effort - step.hold
        held = (signs == 2) | (np.sign(wanted) == signs)
        change = np.abs(np.where(held, step.hold, step.effort) - last).max()
        left = max(1.0 - span(step.dt) / change, 0.0) if change > 0.0 else 1.0
        for sign in (1.0, -1.0):
            fading = left * np.maximum(sign * before, 0.0)
            assert (sign * push <= fading + 2e-11)[(signs == sign) | (signs == 2)].all()


@laws
@given(STEPS)
def test_only_a_push_past_the_limit_is_reduced(step):
    """With a rate that allows any step: exactly to the gravity torque; other efforts unchanged."""
    one, step = guard(rate=1e9), toward(step)
    one.last = np.zeros(N)
    effort, by_position, by_velocity, by_rate = guarded_by(one, step._replace(dt=LONGEST_STEP))
    push, signs = step.effort - step.hold, forbidden(step)
    held = (push != 0.0) & ((signs == 2) | (np.sign(push) == signs))
    assert effort == pytest.approx(np.where(held, step.hold, step.effort), abs=1e-9)
    assert (by_position or by_velocity) == held.any()
    assert not by_rate


@settings(max_examples=30)
@given(st.lists(st.builds(
    Step, *(vectors(1e300) for _ in range(4)), st.floats(-1e300, 1e300)), max_size=10))
def test_finite_efforts_stay_finite(steps):
    one = guard()
    with np.errstate(over='ignore'):
        for step in steps:
            assert np.isfinite(guarded_by(one, step).effort).all()


LIMIT = np.array([10.0, 40.0, np.inf])
FAR = 1e6
"""An effort beyond all bounds."""

more_laws = settings(max_examples=80)


def triples(size: float) -> st.SearchStrategy[np.ndarray]:
    numbers = st.floats(-size, size) | st.sampled_from([0.0, 10.0, -10.0, size, -size])
    return st.lists(numbers, min_size=3, max_size=3).map(np.array)


# --- a robot that compensates gravity ------------------------------------------------------------

@more_laws
@given(triples(200.0), triples(100.0))
def test_command_and_joint_stay_within_the_limit_or_gravity_alone_exceeds_it(command, gravity):
    bounded, _ = EffortBounds(LIMIT).bounded(command, RobotEffort(gravity, 0.0))
    assert (np.abs(bounded) <= LIMIT).all()
    assert (np.abs(bounded + gravity) <= np.maximum(LIMIT, np.abs(gravity)) + 1e-9).all()


@more_laws
@given(triples(100.0), st.sampled_from([1.0, -1.0]))
def test_a_robot_that_compensates_gravity_leaves_the_rest_of_the_limit(gravity, sign):
    """The largest command loads either the drive or the joint with its limit, and no less."""
    bounded, clamped = EffortBounds(LIMIT).bounded(
        np.full(3, sign * FAR), RobotEffort(gravity, 0.0))
    for j in (0, 1):
        load = max(sign * bounded[j], sign * (bounded[j] + gravity[j]))
        if sign * gravity[j] <= LIMIT[j]:
            assert load == pytest.approx(LIMIT[j], abs=1e-9)
        else:
            assert bounded[j] == 0.0
    assert clamped.tolist() == [True, True, False]


@more_laws
@given(triples(200.0), triples(100.0))
def test_what_is_within_the_bounds_is_unchanged(command, gravity):
    bounds, robot = EffortBounds(LIMIT), RobotEffort(gravity, 0.0)
    bounded, clamped = bounds.bounded(command, robot)
    again, none = bounds.bounded(bounded, robot)
    assert again.tolist() == bounded.tolist()
    assert not none.any()
    assert clamped.tolist() == (bounded != command).tolist()
    is_possible = (np.abs(command) <= LIMIT) & (
        np.abs(command + gravity) <= LIMIT - 1e-9)  # the sum is rounded
    assert not (clamped & is_possible).any()


# --- the scale of the limits ---------------------------------------------------------------------

@pytest.mark.parametrize(('hold', 'low', 'high'), [
    (3.0, -5.0, 5.0), (7.0, -5.0, 7.0), (-7.0, -7.0, 5.0), (12.0, -5.0, 10.0),
    (-12.0, -10.0, 5.0)])
def test_a_scaled_limit_extends_to_what_holds_the_arm(hold, low, high):
    bounds, holds = EffortBounds(np.array([10.0]), 0.5), np.array([hold])
    assert bounds.bounded(np.array([FAR]), NOTHING, holds)[0].tolist() == [high]
    assert bounds.bounded(np.array([-FAR]), NOTHING, holds)[0].tolist() == [low]
    assert bounds.bounded(np.array([FAR]), NOTHING)[0].tolist() == [10.0]
    assert bounds.bounded(np.array([-FAR]), NOTHING)[0].tolist() == [-10.0]


@given(st.lists(
    st.tuples(*(st.floats(width=32) for _ in range(3))), min_size=1, max_size=30),
    st.sampled_from([0.0, 0.25, 1.0]))
def test_efforts_within_the_scaled_limits_are_clear(efforts, scale):
    """The result must not depend on the efforts that were tested before."""
    bounds = EffortBounds(LIMIT, scale)
    for effort in efforts:
        is_within = all(
            math.isfinite(x) and abs(x) <= limit for x, limit in zip(effort, bounds.scaled))
        with np.errstate(invalid='ignore'):
            assert bounds.range.contains(list(effort)) == is_within
