# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Gearboxes whose dry friction yields before it slides, and whose rotors the loop does not know.

The plant is independent of `ArmSimulation`: the LuGre model in its simplest form, a bristle of
stiffness F_c / d per joint with MICRO_DAMPING of its critical damping, which slides at F_c
(C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, IEEE Trans. Automatic Control 40(3),
1995).
"""

from collections import deque

from benchmarks.safe_motion_plant import Plant
from benchmarks.safe_motion_scene import Scene
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel

GEARBOX = 'gearbox'
FRICTION = 0.025
"""F_c that is given to the loop, by the effort limit, if the description of the arm has none."""
GIVEN = (0.6, 1.4)
"""F_c that is given, by the true one."""
DISTANCES = (1e-4, 5e-3)
"""Presliding distance d [rad]."""
FASTEST = 500.0
"""[rad/s²]: effort limit / largest rotor inertia."""
MICRO_DAMPING = 0.2
SUBSTEPS = 20
REST_SPEED, REST_CHANGE = 1e-3, 0.05
"""Largest speed [rad/s] at the end, and change of the effort by F_c."""
SLOWEST = 100
"""[Hz]: slowest joint states at which a run is judged by these two bounds."""
_LAST = 1000


class GearedPlant(Plant):
    """An arm with bristles and rotors: F_c (n,) [N·m], d [rad], and J (n,) [kg·m²]."""

    def __init__(
        self, arm: ArmModel, q: FloatArray, coulomb: FloatArray, distance: float,
        rotors: FloatArray,
    ) -> None:
        super().__init__(arm, q)
        self.coulomb, self._d, self._rotors = coulomb, distance, np.diag(rotors)
        self._z = np.zeros_like(q)
        self._efforts: deque[FloatArray] = deque(maxlen=_LAST)
        self._speeds: deque[float] = deque(maxlen=_LAST)

    def step(self, tau: FloatArray, h: float) -> None:
        """Continue by h [s] under the effort tau (n,); implicit in the velocity."""
        M = self.body.mass_matrix(self.q) + self._rotors
        nonlinear, dt = self.body.nonlinear(self.q, self.v), h / SUBSTEPS
        K, q, v = self.coulomb / self._d, self.q, self.v
        D = 2.0 * MICRO_DAMPING * np.sqrt(K * np.diag(M))
        for _ in range(SUBSTEPS):
            A = M + np.diag(dt * (self._viscous + (D + dt * K) * self._yielding(v)))
            v = np.asarray(np.linalg.solve(A, M @ v + dt * (tau - nonlinear - K * self._z)))
            self._z = np.clip(self._z + dt * v * self._yielding(v), -self._d, self._d)
            q = q + dt * v
        self.q, self.v = q, v
        self._efforts.append(tau)
        self._speeds.append(float(np.abs(v).max()))

    def free_speed(self, q: FloatArray, given: FloatArray, reaction: float) -> FloatArray:
        """
        Return the speed (n,) that no feedback prevents, which acts after a reaction time [s].

        A bristle releases F_c d / 2, and friction given (n,) too large accelerates until then.
        """
        M = self.body.mass_matrix(q) + self._rotors
        m = 1.0 / np.diagonal(np.linalg.inv(M))
        surplus = np.maximum(given - self.coulomb, 0.0)
        return np.asarray(np.sqrt(self.coulomb * self._d / m) + surplus * reaction / m)

    def _yielding(self, v: FloatArray) -> FloatArray:
        return np.clip(1.0 - np.sign(v) * self._z / self._d, 0.0, 2.0)

    @property
    def is_calm(self) -> bool:
        """Whether the arm was at rest in the last second, and the effort constant."""
        change = np.ptp(np.array(self._efforts), axis=0) / self.coulomb
        return bool(max(self._speeds) <= REST_SPEED and change.max() <= REST_CHANGE)


def given_friction(arm: ArmModel) -> ArmModel:
    """Return the arm with friction that is known to the loop."""
    if arm.friction.coulomb.any():
        return arm
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 0.0)
    return arm.with_friction(make_friction(
        arm.joint_names, coulomb=np.maximum(FRICTION * limit, 0.01).tolist(),
        viscous=arm.friction.viscous.tolist()))


def gearbox(scene: Scene) -> None:
    """Replace the plant by gearboxes with another friction, and in half of the runs rotors."""
    rng, arm = scene.rng, scene.arm
    n = arm.joint_count
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 0.0)
    rotors = rng.uniform(0.1, 1.0, n) * limit / FASTEST if rng.uniform() < 0.5 else np.zeros(n)
    distance = float(np.exp(rng.uniform(*np.log(DISTANCES))))
    coulomb = np.maximum(arm.friction.coulomb, 0.01) / rng.uniform(*GIVEN)
    scene.plant = GearedPlant(arm, scene.motion.start, coulomb, distance, rotors)
    scene.has_unknown_load = True
    if scene.hand is not None:
        scene.hand.dry, scene.hand.rotors = coulomb, np.diag(rotors)
