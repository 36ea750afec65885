# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The map from the actuated joints of an arm to the joints of the whole tree.

q_tree = G q + q0 with constant G: G sorts the joints, makes mimic joints follow their leaders
(their row contains the multiplier) and locks joints that are not actuated (their row is zero).
By the principle of virtual work, efforts are mapped back with Gᵀ. Because G is constant,
M = Gᵀ M_tree G and C = Gᵀ C_tree G.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class JointCoordinates:
    """The map from n actuated joints to the m joints of the tree: `G` (m, n), `q0` (m,)."""

    G: FloatArray
    q0: FloatArray

    def __post_init__(self) -> None:
        m, n = self.G.shape
        identity = m == n and np.array_equal(self.G, np.eye(n)) and not self.q0.any()
        permutation = m == n and np.array_equal(self.G.T @ self.G, np.eye(n)) and (
            np.isin(self.G, (0.0, 1.0)).all())
        object.__setattr__(self, 'is_identity', bool(identity))
        object.__setattr__(self, 'is_permutation', bool(permutation))

    is_identity: bool = False
    is_permutation: bool = False

    def position(self, q: FloatArray) -> FloatArray:
        """Positions of the tree, shape (m,), or (samples, m) from (samples, n)."""
        return q if self.is_identity else q @ self.G.T + self.q0

    def rate(self, v: FloatArray) -> FloatArray:
        """Velocities or accelerations of the tree, shape (m,) or (samples, m)."""
        return v if self.is_identity else v @ self.G.T

    def effort(self, tau: FloatArray) -> FloatArray:
        """Efforts at the actuated joints, (n,) or (samples, n), for efforts at all joints."""
        return tau if self.is_identity else tau @ self.G

    def form(self, A: FloatArray) -> FloatArray:
        """Gᵀ A G: a matrix over all joints of the tree mapped to the actuated joints."""
        return A if self.is_identity else self.G.T @ A @ self.G
