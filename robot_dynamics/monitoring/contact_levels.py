# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Levels of external efforts, per joint, above which a contact is assumed: θ = a + b |q̇|."""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray

OTHER_CAUSES = 'a changed payload, a limit stop or stiction'


@dataclass(frozen=True, eq=False)
class ContactLevels:
    """
    The levels of n joints.

    `effort` (n,) [N·m] or [N] is a, 0 for a joint without a level; `per_velocity` (n,) is b, in
    [N·m·s/rad] or [N·s/m].
    """

    effort: FloatArray
    per_velocity: FloatArray

    def at(self, v: FloatArray) -> FloatArray:
        """Return the levels (..., n) at velocities, infinite for joints without a level."""
        level = self.effort + self.per_velocity * np.abs(v)
        return np.where(self.effort > 0.0, level, np.inf)
