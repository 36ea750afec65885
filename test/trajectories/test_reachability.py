# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Reachability analysis of random constraints, compared with vertices of their polygons."""

from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.trajectories.reachability import fastest_states, Rows


def corners(normals: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return the vertices (k, 2) of the polygon normals @ z <= bounds, z >= 0."""
    normals = np.vstack((normals, [[-1.0, 0.0], [0.0, -1.0]]))
    bounds = np.append(bounds, [0.0, 0.0])
    found = []
    for pair in combinations(range(len(bounds)), 2):
        lines = normals[list(pair)]
        if abs(np.linalg.det(lines)) > 1e-9:
            z = np.linalg.solve(lines, bounds[list(pair)])
            if (normals @ z <= bounds + 1e-9).all():
                found.append(z)
    return np.array(found)


def largest(normals: np.ndarray, bounds: np.ndarray, extra: np.ndarray, axis: int) -> float:
    """Return the largest x (axis 0) or y (axis 1) with two further constraints x, y <= extra."""
    z = corners(np.vstack((normals, np.eye(2))), np.append(bounds, extra))
    return float(z[:, axis].max())


@settings(max_examples=50)
@given(st.integers(0, 2**32), st.integers(1, 9), st.integers(1, 5))
def test_states_are_those_of_linear_programs(seed, m, k):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, m, k))
    c = rng.uniform(0.1, 2.0, (m, k))
    caps = np.append(0.0, rng.uniform(0.2, 3.0, m))
    caps[-1] = 0.0
    normals = np.stack((a, b), axis=2)
    controllable = np.zeros(m + 1)
    for i in reversed(range(m)):
        controllable[i] = largest(
            normals[i], c[i], np.array([caps[i], controllable[i + 1]]), 0)
    expected = np.zeros(m + 1)
    for i in range(m):
        expected[i + 1] = largest(
            np.vstack((normals[i], [-1.0, 0.0])), np.append(c[i], 1e-12 - expected[i]),
            np.array([expected[i], controllable[i + 1]]), 1)
    assert fastest_states(Rows(a, b, c), caps) == pytest.approx(expected, abs=1e-6)
