# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The times of the motions of one joint."""

import random

import pytest
from robot_dynamics.references.jerk_profile import Bounds, duration, end
from robot_dynamics.references.joint_planner import JointPlanner, PlannerLimits

CASES = 300


def random_planner(r: random.Random) -> JointPlanner:
    """Return a joint that moves within limits, which a random scale lowers for its motion."""
    v, a, jerk = r.uniform(0.5, 3.0), r.uniform(2.0, 15.0), r.uniform(30.0, 300.0)
    full, s = Bounds(-v, v, -a, a, jerk), r.choice([1.0, 0.5, 0.3])
    lowered = Bounds(-0.95 * v * s, 0.95 * v * s, -a * s**2, a * s**2, jerk * s**3)
    state = (r.uniform(-1.0, 1.0), 0.9 * r.uniform(-v, v), 0.5 * r.uniform(-a, a))
    return JointPlanner(state, PlannerLimits(-3.0, 3.0, full, full, lowered, s))


def test_a_motion_that_may_end_later_ends_at_this_time_at_the_goal():
    r = random.Random(1)
    for _ in range(CASES):
        one, goal = random_planner(r), r.uniform(-2.0, 2.0)
        earliest = duration(one.to_rest(goal)) + r.uniform(0.2, 2.0)
        phases = one.to_rest(goal, earliest)
        assert duration(phases) == pytest.approx(earliest, abs=1e-9)
        assert end(phases, one.q, one.v, one.a)[:3] == pytest.approx((goal, 0.0, 0.0), abs=1e-6)


def test_a_stop_is_the_earliest_motion_to_rest():
    r = random.Random(2)
    for _ in range(CASES):
        one = random_planner(r)
        where = end(one.stop, one.q, one.v, one.a)[0]
        for goal in (where, r.uniform(-2.0, 2.0)):
            assert duration(one.to_rest(goal)) >= duration(one.stop) - 1e-9
