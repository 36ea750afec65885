# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of two joints, and what the tests of them compare."""

from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
from robot_dynamics.trajectories import JointTrajectory, make_trajectory, Reference

JOINTS = ('shoulder', 'elbow')
EPOCH = 1_700_000_000_123_456_789
SECOND = 1_000_000_000
REST = Reference(np.zeros(2), np.zeros(2), np.zeros(2))

values = st.floats(-10.0, 10.0)
vectors = st.lists(values, min_size=2, max_size=2).map(np.array)
spans = st.floats(0.05, 20.0)
laws = settings(max_examples=60)


def trajectory(
    times: Any = (1.0, 2.0), q: Any = ((0.1, 0.2), (0.3, 0.4)), v: Any = (), a: Any = (),
    names: Any = JOINTS,
) -> JointTrajectory:
    return make_trajectory(names, times, q, v, a, JOINTS)


def smooth(times: Any, seed: int = 1) -> JointTrajectory:
    """Return random points with all fields, at rest at the end."""
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1.0, 1.0, (3, len(times), 2))
    v[-1] = a[-1] = 0.0
    return trajectory(times, q, v, a)


def assert_same(left: Reference, right: Reference, tolerance: float = 1e-9) -> None:
    for x, y in zip(left, right):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance)
