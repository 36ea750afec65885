# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An arm whose dry friction yields before it slides, in lock-step with the loop.

The plant is a LuGre model in its simplest form: a bristle of stiffness F_c / d per joint, with 0.2
of its critical damping, which slides at F_c (C. Canudas de Wit, H. Olsson, K. J. Åström,
P. Lischinsky, IEEE Trans. Automatic Control 40(3), 1995). Its rotors are unknown to the loop.
"""

from typing import Any, NamedTuple

from lock_step_loop import LockStep, STEP
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel

SUBSTEPS = 20
MICRO_DAMPING = 0.2
COULOMB = {
    'panda': [0.6, 0.6, 0.5, 0.9, 0.9, 0.9, 0.6], 'ur10': [8.0, 8.0, 5.0, 2.0, 2.0, 1.5],
    'ur5': [6.0, 6.0, 4.0, 1.2, 1.2, 1.2], 'default': [4.0, 1.5],
    'xarm7': [1.0] * 7, 'z1': [1.0, 2.0, 1.0, 1.0, 1.0, 1.0]}
"""F_c [N·m]; that of xarm7 and z1 is of their descriptions."""
VISCOUS = {'xarm7': 10.0, 'z1': [1.0, 2.0, 1.0, 1.0, 1.0, 1.0]}
ROTORS = {
    'ur10': [1.0, 1.0, 0.6, 0.1, 0.1, 0.1], 'ur5': [0.6, 0.6, 0.4, 0.05, 0.05, 0.05],
    'panda': [0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2]}
"""[kg·m²] at the joints."""


class Case(NamedTuple):
    """An arm with its presliding distance [rad], and the loop: rate [Hz], delay [ms]."""

    arm: str
    rate: int
    delay: int
    distance: float
    given: float = 1.0
    """Friction that is given, by the true one."""
    has_rotors: bool = False


class BristledArm(LockStep):
    """An arm with bristles, and a loop that knows its friction."""

    def __init__(
        self, arm: ArmModel, case: Case, coulomb: FloatArray | None = None,
        rotors: FloatArray | None = None, **options: Any,
    ) -> None:
        """F_c [N·m] and rotors [kg·m²] (n,) are those of the tables unless they are given."""
        n = arm.joint_count
        self.coulomb = np.array(COULOMB[case.arm]) if coulomb is None else coulomb
        self.viscous = np.ones(n) * VISCOUS.get(case.arm, 0.0)
        friction = make_friction(
            arm.joint_names, coulomb=(case.given * self.coulomb).tolist(),
            viscous=self.viscous.tolist())
        super().__init__(arm.with_friction(friction), rate=case.rate, delay=case.delay, **options)
        self._z, self._d = np.zeros(n), case.distance
        if rotors is None:
            rotors = np.array(ROTORS[case.arm]) if case.has_rotors else np.zeros(n)
        self._rotors = np.diag(rotors)

    def _move(self, effort: FloatArray) -> None:
        M = self._body.mass_matrix(self.q) + self._rotors
        h = self._body.nonlinear(self.q, self.v)
        K, dt = self.coulomb / self._d, STEP / SUBSTEPS
        D = 2.0 * MICRO_DAMPING * np.sqrt(K * np.diag(M))
        bristle, drive = dt * (D + dt * K), dt * (effort - h)
        A = M + np.diag(dt * self.viscous)
        diagonal = np.einsum('ii->i', A)  # a view
        slides, dK = diagonal.copy(), dt * K
        for _ in range(SUBSTEPS):  # implicit in the velocity; `yields` is from 0 to 2
            yields = 1.0 - np.sign(self.v) * self._z / self._d
            diagonal[:] = slides + bristle * yields
            self.v = np.linalg.solve(A, M @ self.v + drive - dK * self._z)
            yields = 1.0 - np.sign(self.v) * self._z / self._d
            self._z = np.minimum(np.maximum(
                self._z + dt * self.v * yields, -self._d), self._d)
            self.q = self.q + dt * self.v
