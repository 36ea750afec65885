# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm that `safe_motion` simulates."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody

HOLDING = 1e6
"""Inertia of a joint that sticks, by the largest inertia of the arm."""
MODE_CHANGES = 20
"""Changes between sliding and sticking in a step, at most."""


class Plant:
    """
    An arm with viscous and Coulomb friction in steps of the semi-implicit Euler method.

    Friction is implicit, so that stiff friction is stable and a joint sticks if Coulomb friction
    can hold it. `ArmSimulation` is the exact solution, but three to nine times slower.
    """

    def __init__(self, arm: ArmModel, q: FloatArray) -> None:
        self.load(arm)
        self._viscous, self._coulomb = arm.friction.viscous, arm.friction.coulomb
        self._is_rough = bool(self._viscous.any() or self._coulomb.any())
        self.q, self.v = q.copy(), np.zeros_like(q)

    def load(self, arm: ArmModel) -> None:
        """Continue with the bodies of this arm."""
        self.arm = arm
        self.body = UncheckedRigidBody(arm)

    def step(self, tau: FloatArray, h: float) -> None:
        """Continue by h [s] under the effort tau (n,)."""
        q = self.q + 0.5 * h * self.v
        if self._is_rough:
            v = self._velocity_after(q, tau, h)
        else:
            v = self.v + h * self.body.acceleration(q, self.v, tau)
        self.q, self.v = self.q + 0.5 * h * (self.v + v), v

    def _velocity_after(self, q: FloatArray, tau: FloatArray, h: float) -> FloatArray:
        """Return v with M (v - v_0) = h (tau - C v_0 - g - F_v v) - F, |F| <= h F_c."""
        M = self.body.mass_matrix(q)
        momentum = M @ self.v + h * (tau - self.body.nonlinear(q, self.v))
        A, largest = M + h * np.diag(self._viscous), h * self._coulomb
        holding = HOLDING * A.diagonal().max()
        direction = np.sign(self.v)
        sticks = (direction == 0.0) & (largest > 0.0)
        for _ in range(MODE_CHANGES):
            v = np.linalg.solve(A + holding * np.diag(sticks), momentum - largest * direction)
            breaks = sticks & (np.abs(holding * v) > largest)
            stops = ~sticks & (largest > 0.0) & (v * direction < 0.0)
            if not (breaks.any() or stops.any()):
                break
            direction = np.where(breaks, np.sign(v), np.where(stops, 0.0, direction))
            sticks = (sticks & ~breaks) | stops
        return np.where(sticks, 0.0, v)
