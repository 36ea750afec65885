# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Random arms in hand guiding that a hand moves and releases, and an energy that the loop cannot see.

The friction of the plant yields before it slides (`bristled_arm`), its rotors are unknown to the
loop, and the loop knows 0.6 to 1.4 times its friction.
"""

from bristled_arm import BristledArm, Case, ROTORS
from lock_step_loop import middle, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics

ARMS = ('default', 'panda', 'ur5', 'ur10', 'xarm7')
LAST = {'panda': 3, 'xarm7': 5, 'ur5': 3, 'ur10': 3}
"""Last joint that the hand moves, the last one by default: links behind it are light."""


class Released(BristledArm):
    """An arm that a hand has moved at random speeds up to 1 rad/s, and released."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        name = ARMS[seed % len(ARMS)]
        case = Case(
            name, int(rng.choice([125, 250, 500, 1000])), int(rng.integers(5)), 1e-3,
            float(rng.choice([0.6, 1.0, 1.4])), bool(name in ROTORS and rng.uniform() < 0.5))
        arm = smooth_arm(name)
        q = middle(arm) + rng.uniform(-0.4, 0.4, arm.joint_count)
        super().__init__(arm, case, q=q, command='hand_guiding')
        self._dynamics = ArmDynamics(arm)
        goal = rng.uniform(-1.0, 1.0, arm.joint_count)
        goal[LAST.get(name, 6) + 1:] = 0.0
        goal *= rng.uniform(0.3, 1.0) / np.abs(goal).max()
        self.run(0.1)

        def hand(t: float) -> FloatArray:
            speed = goal * min(1.0, 4.0 * (t - 0.1))
            return self.inertia @ (40.0 * (speed - self.v)) + 0.4 * self.coulomb * np.sign(goal)
        self.push = hand
        self.run(0.4)
        self.push = lambda t: 0.0

    @property
    def inertia(self) -> FloatArray:
        return np.asarray(self._dynamics.mass_matrix(self.q) + self._rotors)

    @property
    def energy(self) -> float:
        """Of links, rotors and bristles [J]; the loop compensates gravity exactly."""
        bristles = self.coulomb / self._d @ self._z**2
        return float(0.5 * (self.v @ self.inertia @ self.v + bristles))


@pytest.mark.parametrize('seed', [
    *range(5), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(5, 205))])
def test_a_released_arm_gains_no_energy_and_stands_within_a_second(seed):
    one = Released(seed)
    least = one.energy
    gain = 0.84e-3 * one.coulomb.sum()  # 0.84 of the true friction along 1 mrad, where it yields
    assert np.abs(one.v).max() > 0.05
    for _ in range(100):
        one.run(0.01)
        assert one.energy <= least + gain, seed
        least = min(least, one.energy)
    assert np.abs(one.v).max() < 0.01, seed
    assert one.loop.supervisor.fault_count == 0, seed


def test_a_hand_at_a_constant_speed_feels_no_brake():
    """It pushes at 0.9 rad/s with the 40 % of 0.6 N·m that are not compensated."""
    one = BristledArm(smooth_arm('panda'), Case('panda', 500, 2, 1e-3), command='hand_guiding')
    body, start, pushes = ArmDynamics(one.arm), one.q.copy(), list[float]()

    def hand(t: float) -> FloatArray:
        way = np.zeros(7)
        way[0] = 0.9
        t = max(t - 0.2, 0.0)
        effort = body.mass_matrix(one.q) @ (
            400.0 * (start + way * t - one.q) + 40.0 * (way - one.v))
        pushes.append(float(effort[0]))
        return np.asarray(effort)
    one.push = hand
    one.run(1.0)
    assert np.mean(pushes[-300:]) == pytest.approx(0.24, abs=0.01)
