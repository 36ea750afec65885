# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An arm under `cartesian_impedance` without the supervisor: steps, pushes and walls."""

from collections import deque
from collections.abc import Callable

from controller_bench import update
from lock_step_loop import FIRST_STAMP, middle, MS, smooth_arm
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control import ControlLaw, Controller, make_gains
from robot_dynamics.control.options import ControllerOptions, default_effort_rates
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link, rotation_vector
from robot_dynamics.task_space.inverse_kinematics import joints_at
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

POSES = {
    'ur10': [0.0, -1.2, 1.6, -1.9, -1.57, 0.3], 'kinova': [0.0, 3.7, 2.0, 1.0, 2.0, 1.2],
    'panda': [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785], 'z1': [0.0, 1.2, -1.2, 0.4, 0.2, 0.0],
    'xarm7': [0.0, -0.3, 0.0, 0.9, 0.0, 1.2, 0.0]}
ROBOTS = tuple(POSES)
ROTORS = 0.005
"""[kg·m²] per N·m of the effort limit of a joint, which is usual for harmonic drives."""
LARGEST_LIMIT = 300.0
DEPTH = 0.03
"""[m] of the reference behind the wall, and of the start before it."""
STIFFNESS = np.array([500.0] * 3 + [30.0] * 3)
"""Of the frame [N/m] and [N·m/rad], the default."""
DIVERGED = 100.0
"""[rad/s] at which a run ends."""
FINE = 20
"""Steps of the plant per ms in contact."""


def rotored(arm: ArmModel, least: float = 0.0) -> ArmModel:
    """Return an arm with usual rotors, and at least this inertia [kg·m²] at each joint."""
    limit = np.minimum(arm.limits.effort, LARGEST_LIMIT)
    return arm.with_reflected_inertia(np.maximum(ROTORS * limit, least))


class CartesianArm:
    """An arm without friction, with states at a rate [Hz] and efforts `delay` [ms] late."""

    def __init__(
        self, robot: str, rate: int, delay: int, rotors: bool, law: ControlLaw | None = None,
    ) -> None:
        """`law` replaces that of the command."""
        arm = smooth_arm(robot)
        self.arm = rotored(arm) if rotors else arm
        self.kinematics = FrameKinematics(self.arm, last_link(self.arm))
        self.body = UncheckedArmDynamics(self.arm).rigid_body
        self.controller = Controller(self.arm, ControllerOptions(
            make_gains(arm.joint_names), command='cartesian_impedance', scales_gains=True,
            stops_and_holds=True, effort_rate=default_effort_rates(arm)), law=law)
        self.q = np.array(POSES.get(robot, middle(arm)))
        self.v = np.zeros_like(self.q)
        self._period, self._delay, self._k = round(1e3 / rate), delay, 0
        self._tau = self.body.gravity(self.q)
        self._pending: deque[tuple[int, FloatArray]] = deque()
        self.push: Callable[[FloatArray], FloatArray | float] = lambda q: 0.0
        """Effort (n,) of the environment at q (n,)."""

    def run(self, seconds: float, fine: int = 1) -> FloatArray:
        """Continue; return position and velocity after each ms, (m, 2, n)."""
        rows, h = [], 1e-3 / fine
        for _ in range(round(1e3 * seconds)):
            if self._k % self._period == 0:
                self._pending.append((self._k + self._delay, update(
                    self.controller,
                    FIRST_STAMP + self._k * MS, self.q, self.v).command))
            while self._pending and self._pending[0][0] <= self._k:
                self._tau = self._pending.popleft()[1]
            for _ in range(fine):
                q = self.q + 0.5 * h * self.v
                v = self.v + h * self.body.acceleration(q, self.v, self._tau + self.push(q))
                self.q, self.v = self.q + 0.5 * h * (self.v + v), v
            rows.append((self.q, self.v))
            self._k += 1
            if not np.abs(self.v).max() < DIVERGED:
                break
        return np.array(rows)

    def follow(self, translation: FloatArray, rotation: FloatArray) -> None:
        """Move the reference to a pose in one step."""
        goal = joints_at(self.arm, self.kinematics, self.q, translation, rotation)
        names = self.arm.joint_names
        self.controller.follow(make_trajectory(names, [0.0], [goal], (), (), names))

    def step(self, axis: int, size: float, seconds: float) -> FloatArray:
        """Step by size [m] or [rad] along or about an axis; return the share of the way (m,)."""
        self.run(0.1)
        p, R = self.kinematics.pose(self.q)
        d = np.zeros(6)
        d[axis] = size
        self.follow(p + d[:3], pin.exp3(d[3:]) @ R)
        way = []
        for q, _ in self.run(seconds):
            p_now, R_now = self.kinematics.pose(q)
            moved = np.concatenate([p_now - p, rotation_vector(R_now @ R.T)])
            way.append(moved[axis] / size)
        return np.array(way)

    def press_on_a_wall(
        self, stiffness: float, normal: npt.ArrayLike = (0.0, 0.0, 1.0),
    ) -> FloatArray:
        """
        Fall onto a wall, without friction; return the energy (m,), 1 at the start.

        `normal` (3,) is the side of the frame. The energy is that of the motion, of the wall, and
        of the spring of the law, which ends behind the wall. Directions with little inertia have
        a softer spring than K, and a moving reference works on the arm: the energy is that of the
        spring at the joints, from when the reference has stopped.
        """
        n = np.asarray(normal) / np.linalg.norm(normal)
        self.run(0.1)
        p, R = self.kinematics.pose(self.q)
        height = n @ p - DEPTH

        def depth(q: FloatArray) -> float:
            return max(height - float(n @ self.kinematics.pose(q)[0]), 0.0)

        def push(q: FloatArray) -> FloatArray:
            p, _, J = self.kinematics.jacobian(q)
            return np.asarray(stiffness * max(height - float(n @ p), 0.0) * (n @ J[:3]))

        self.push = push
        goal = p - 2.0 * DEPTH * n
        self.follow(goal, R)
        start = 0.5 * float(STIFFNESS[:3] @ (goal - p)**2)
        self.run(0.5, FINE)
        reference = self.controller.reference
        while reference.velocity.any() or reference.acceleration.any():
            self.run(0.1, FINE)
            reference = self.controller.reference
        rows = self.run(2.0, FINE)
        law, dynamics, energy = (
            self.controller.laws.with_reference, self.controller.dynamics, [])
        for q, v in rows:
            e = reference.position - q
            energy.append(
                self.body.kinetic_energy(q, v) + 0.5 * float(e @ law.gains(dynamics, q)[0] @ e)
                + 0.5 * stiffness * depth(q)**2)
        return np.array(energy) / start
