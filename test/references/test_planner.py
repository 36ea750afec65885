# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Plans of all joints stay in their hull and within limits, also if goals and scale change.

A reference that ends in motion: each joint stops at once, within its limits.
"""

from collections.abc import Iterator
import math
import random
from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st
from jerk_motion import evaluate
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.jerk_profile import (
    Bounds,
    duration,
    end,
    Extremes,
    extremes,
    stop,
    to_rest,
)
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.planner import (
    Plan,
    plan_stop,
    plan_to_goal,
    plan_to_path,
    plan_with_target,
    without_creep,
)
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.quintics import quintic_via_points
from sampled_references import at, generator, laws, NAMES, NOW, ns, samples, SECOND, ZERO

FOLLOW_TIME = 0.1
BOX = 2.0
"""Largest size of starts and goals [rad]."""
HULL = 1e-8
"""Tolerance of positions [rad]."""
RATIO = 1.001

counts = pytest.mark.parametrize('count', [150, pytest.param(100_000, marks=pytest.mark.soak)])


class Case(NamedTuple):
    """One plan, and what it was planned for; `goals` (m, n) are all permitted goals."""

    kind: str
    start: Reference
    limits: MotionLimits
    plan: Plan
    goals: FloatArray

    def joints(self) -> Iterator['JointCase']:
        for j in range(len(self.start.position)):
            state = tuple(float(x[j]) for x in self.start)
            yield JointCase(
                self, j, state, extremes(self.plan.phases[j], *state),
                *(bounds_of(x, j) for x in (self.limits, self.limits.whole)))


class JointCase(NamedTuple):
    case: Case
    j: int
    state: tuple[float, float, float]
    found: Extremes
    full: Bounds
    whole: Bounds

    def stop(self, bounds: Bounds) -> Extremes:
        return extremes(stop(*self.state[1:], bounds), *self.state)

    def is_inside(self, q_min: float, q_max: float, tolerance: float = HULL) -> bool:
        """Return whether positions are within the limits, or not further beyond than the start."""
        limits, q = self.case.limits, self.state[0]
        return bool(min(limits.lower[self.j], q) - tolerance <= q_min
                    and q_max <= max(limits.upper[self.j], q) + tolerance)

    def earliest_stop(self) -> tuple[Extremes, Bounds]:
        """Return the earliest stop, with the whole limits if it would pass a limit."""
        stopping, v = self.stop(self.full), self.state[1]
        if self.is_inside(stopping.q_min, stopping.q_max, 1e-9) and (
                min(self.whole.v_min, v) - 1e-9 <= stopping.v_min
                and stopping.v_max <= max(self.whole.v_max, v) + 1e-9):
            return stopping, self.full
        return self.stop(self.whole), self.whole


def bounds_of(limits: MotionLimits, j: int) -> Bounds:
    v, a, jerk = (float(x[j]) for x in (limits.velocity, limits.acceleration, limits.jerk))
    return Bounds(-v, v, -a, a, jerk)


def random_limits(r: random.Random, n: int) -> MotionLimits:
    v = np.array([10.0 ** r.uniform(-0.5, 0.5) for _ in range(n)])
    a = v * np.array([10.0 ** r.uniform(-0.3, 1.2) for _ in range(n)])
    jerk = a * np.array([10.0 ** r.uniform(0.3, 1.7) for _ in range(n)])
    size = [r.uniform(0.3, 3.0) if r.random() < 0.6 else math.inf for _ in range(2 * n)]
    return MotionLimits(-np.array(size[:n]), np.array(size[n:]), v, a, jerk)


def cases(count: int, scaled: bool = True) -> Iterator[Case]:
    """Yield plans: sequences of 3 to 6, each from a random time of the one before."""
    r, done = random.Random(count), 0
    while done < count:
        n = r.randint(2, 7)
        limits = random_limits(r, n)
        moves = [r.random() < 0.8 for _ in range(n)]
        state = Reference(position_in(r, limits), *(
            np.array([r.uniform(-0.95, 0.95) * most * is_moving
                      for most, is_moving in zip(values, moves)])
            for values in (limits.velocity, limits.acceleration)))
        for _ in range(r.randint(3, 6)):
            done += 1
            scale = r.choice([1.0, r.uniform(0.05, 1.0)]) if scaled else 1.0
            case = random_case(r, state, limits.slower(scale))
            if case is None:
                continue
            yield case
            t = case.plan.duration * r.choice([r.random(), r.random(), 1.2])
            state = Reference(*np.array([
                evaluate(case.plan.phases[j.j], t, *j.state) for j in case.joints()]).T)


def position_in(r: random.Random, limits: MotionLimits) -> FloatArray:
    """Return random positions within the limits, of which a third are at a limit."""
    return np.array([
        r.choice([r.uniform(*box), r.uniform(*box), r.choice(box)])
        for box in zip(np.maximum(limits.lower, -BOX), np.minimum(limits.upper, BOX))])


def random_case(r: random.Random, start: Reference, limits: MotionLimits) -> Case | None:
    """Return a random plan; None if a path cannot be met."""
    kind = r.choice(['goal', 'goal', 'later', 'stream', 'stop', 'target', 'path'])
    goal = position_in(r, limits)
    if kind == 'stop':
        return Case(kind, start, limits, plan_stop(start, limits), start.position[np.newaxis])
    if kind in ('goal', 'later', 'stream'):
        arrival = 0.0 if kind == 'goal' else r.uniform(0.0, 3.0)
        start = without_creep(start)
        plan = plan_to_goal(start, goal, limits, arrival, kind == 'stream')
        return Case(kind, start, limits, plan, goal[np.newaxis])
    if kind == 'target':
        return target_case(r, start, limits, goal)
    v = limits.whole.velocity * [r.uniform(-0.5, 0.5) for _ in goal]
    path = [(t, Reference(goal + (t - 1.0) * v, v, 0.0 * v)) for t in np.geomspace(0.01, 20.0, 24)]
    plan = plan_to_path(start, path, limits)
    if plan is None:
        return None
    goals = [state.position for t, state in path if t <= plan.duration + 1e-6]
    return Case(kind, start, limits, plan, np.array(goals))


def target_case(
    r: random.Random, start: Reference, limits: MotionLimits, goal: FloatArray,
) -> Case:
    whole, time = limits.whole, r.choice([0.002, 0.02, 0.1])
    if r.random() < 0.6:
        goal = start.position + [r.uniform(-0.1, 0.1) for _ in goal]
    speed, change = r.choice([0.2, 0.5, 1.0]), r.choice([0.0, 1.0])
    target = Reference(
        goal, whole.velocity * [speed * r.uniform(-1.0, 1.0) for _ in goal],
        limits.acceleration * [change * r.uniform(-1.0, 1.0) for _ in goal])
    goals, held = [], np.clip(goal, limits.lower, limits.upper)
    for j, state in enumerate(zip(*target)):
        now, path = end([(-time, 0.0)], *state), [(time + FOLLOW_TIME, 0.0)]
        found = extremes([*path, *stop(*end(path, *now)[1:], bounds_of(limits, j))], *now)
        goals.append((found.q_min, found.q_max, held[j]))
    return Case(
        'target', start, limits, plan_with_target(start, target, time, limits, FOLLOW_TIME),
        np.array(goals).T)


# --- laws ----------------------------------------------------------------------------------------

@counts
def test_any_plan_stays_in_its_hull_and_within_its_limits_and_ends_at_its_goal(count):
    for case in cases(count):
        end = case.plan.end
        if case.kind in ('goal', 'later', 'stream', 'path'):
            assert end.position == pytest.approx(case.goals[-1], abs=HULL), case.kind
        if case.kind != 'path':
            assert end.velocity == pytest.approx(0.0 * end.position, abs=1e-7), case.kind
            assert end.acceleration == pytest.approx(0.0 * end.position, abs=1e-7), case.kind
        for joint in case.joints():
            assert all(map(math.isfinite, joint.found))
            check_hull(joint)
            check_limits(joint)


def check_hull(joint: JointCase) -> None:
    """Check that the joint stays in the hull of its start, its earliest stop and its goals."""
    hull, goals = joint.earliest_stop()[0], joint.case.goals[:, joint.j]
    assert joint.found.q_min >= min(hull.q_min, *goals) - HULL, joint.case.kind
    assert joint.found.q_max <= max(hull.q_max, *goals) + HULL, joint.case.kind


def check_limits(joint: JointCase) -> None:
    """Check velocity, acceleration and jerk; only the start, or its stop, may exceed a limit."""
    bounds, found, a = joint.earliest_stop()[1], joint.found, joint.state[2]
    stopping = joint.stop(joint.full)
    if joint.case.kind in ('target', 'path'):
        bounds = joint.whole
    assert found.v_max <= RATIO * max(bounds.v_max, stopping.v_max)
    assert found.v_min >= RATIO * min(bounds.v_min, stopping.v_min)
    assert found.a_max <= RATIO * max(bounds.a_max, a)
    assert found.a_min >= RATIO * min(bounds.a_min, a)
    assert all(abs(j) <= RATIO * bounds.jerk for _, j in joint.case.plan.phases[joint.j])
    stops = [joint.stop(each) for each in (joint.full, joint.whole)]
    if joint.case.kind != 'path' and any(
            joint.is_inside(each.q_min, each.q_max, 0.0) for each in stops):
        assert joint.is_inside(found.q_min, found.q_max), joint.case.kind


@counts
def test_a_plan_takes_little_longer_than_the_slowest_joint_alone(count):
    """`test_jerk_profile.py` compares the motion of one joint with another library."""
    ratios = []
    for case in cases(count, scaled=False):
        if case.kind == 'goal' and all(
                joint.earliest_stop()[1] is joint.full for joint in case.joints()):
            T = max(duration(to_rest(float(case.goals[0, joint.j]) - joint.state[0],
                                     *joint.state[1:], joint.full)) for joint in case.joints())
            ratios.append(case.plan.duration / T if T > 0.0 else 1.0)
    assert len(ratios) > count / 10
    assert np.median(ratios) <= 1.3
    assert max(ratios) <= 2.0


BOUNDS = [Bounds(-1.0, 1.0, -5.0, 5.0, 90.0)] * 2
CURVE = quintic_via_points(
    NAMES, [0.0, 1.0, 2.0, 3.0, 4.0],
    [[0.0, 0.0], [0.5, 0.6], [1.2, 0.4], [1.5, -0.4], [0.8, -0.6]])


def end_of(one: ReferenceGenerator) -> float:
    return (one.active.end_ns - NOW) / SECOND


# --- along a path --------------------------------------------------------------------------------

@laws
@given(st.floats(0.05, 3.9))
def test_a_stop_on_a_path_is_the_earliest_stop_of_each_joint(t):
    one = generator()
    one.start(CURVE, NOW, ZERO, ZERO)
    before = at(one, t)
    one.stop(ns(t), ZERO, ZERO)
    for old, new in zip(before, at(one, t)):
        assert new == pytest.approx(old, abs=1e-9)
    end = end_of(one)
    found = samples(one, t, end + 0.1, 400)
    assert not found.v[-1].any()
    assert (np.abs(found.a) <= np.maximum(5.0, np.abs(before.acceleration)) + 1e-6).all()
    assert found.jerk <= 1.001 * 90.0
    for j, bounds in enumerate(BOUNDS):
        # A joint that accelerates continues to do so until the jerk has removed its acceleration.
        path = stop(before.velocity[j], before.acceleration[j], bounds)
        assert duration(path) <= end - t + 1e-6
        exact = extremes(path, before.position[j], before.velocity[j], before.acceleration[j])
        q = found.q[:, j]
        assert exact.q_min - 1e-9 <= q.min() <= q.max() <= exact.q_max + 1e-9
        assert (q.min(), q.max()) == pytest.approx((exact.q_min, exact.q_max), abs=1e-4)


@laws
@given(st.floats(0.2, 3.5), st.floats(0.05, 0.95))
def test_a_second_stop_during_a_stop_changes_nothing(t, fraction):
    one = generator()
    one.start(CURVE, NOW, ZERO, ZERO)
    one.stop(ns(t), ZERO, ZERO)
    first = end_of(one)
    again = t + fraction * (first - t)
    expected = samples(one, again, first + 0.01, 100)
    one.stop(ns(again), ZERO, ZERO)
    assert end_of(one) == pytest.approx(first, abs=1e-6)
    for old, new in zip(expected, samples(one, again, first + 0.01, 100)):
        assert new == pytest.approx(old, abs=1e-5)


# --- from a measured state -----------------------------------------------------------------------

@laws
@given(st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4))
def test_a_stop_from_a_measured_state_is_within_the_limits(state):
    one, q, v = generator(), np.array(state[:2]), np.array(state[2:])
    one.stop(NOW, q, v)
    found = samples(one, 0.0, max(end_of(one), 1e-3))
    assert found.q[0].tolist() == q.tolist()
    assert found.v[0] == pytest.approx(v, abs=1e-12)
    assert (np.abs(found.v) <= np.abs(v) + 1e-9).all()
    assert np.abs(found.a).max() <= 1.001 * 5.0
    assert found.jerk <= 1.001 * 90.0
    assert not found.v[-1].any()


def test_a_stop_without_limits_holds_the_position_at_once():
    one = ReferenceGenerator(NAMES, (), None)
    one.start(CURVE, NOW, ZERO, ZERO)
    before = at(one, 1.0)
    one.stop(ns(1.0), ZERO, ZERO)
    after = at(one, 1.5)
    assert after.position.tolist() == before.position.tolist()
    assert not after.velocity.any()
