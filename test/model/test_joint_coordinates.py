# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Which maps from actuated joints to those of the tree are the identity or a permutation."""

import numpy as np
import pytest
from robot_dynamics.model.arm import JointCoordinates


@pytest.mark.parametrize(('G', 'q0', 'identity', 'permutation'), [
    (np.eye(3), (0, 0, 0), True, True),
    (np.eye(3)[[2, 0, 1]], (0, 0, 0), False, True),
    (np.eye(3), (0, 0.5, 0), False, True),
    (np.eye(3)[:, :2], (0, 0, 0), False, False),
    (np.diag([1.0, -1.0, 1.0]), (0, 0, 0), False, False),
    (np.diag([1.0, 2.0, 1.0]), (0, 0, 0), False, False),
    (np.array([[1.0, 0.0], [1.0, 0.0]]), (0, 0), False, False),
    (np.array([[0.6, 0.8], [-0.8, 0.6]]), (0, 0), False, False),
])
def test_identity_and_permutation_are_recognized(G, q0, identity, permutation):
    x = JointCoordinates(G, np.array(q0, dtype=float))
    assert (x.is_identity, x.is_permutation) == (identity, permutation)
