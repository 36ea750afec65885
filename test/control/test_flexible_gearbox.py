# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Flexible gearboxes of a UR10: the arm comes to rest.

The plant has a rotor and a link per joint, with a spring of little damping between them (M. W.
Spong, "Modeling and Control of Elastic Joint Robots", ASME J. Dynamic Systems, Measurement, and
Control 109(4), 1987). The loop knows the rotors, and measures on their side.
"""

from collections import deque
from typing import Any

from lock_step_loop import FIRST_STAMP, middle, MS, smooth_arm, STEP
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ROTORS = np.array([1.0, 1.0, 0.6, 0.1, 0.1, 0.1])
"""[kg·m²] at the joints."""
RIGID = 1e6
"""[N·m/rad]"""
DAMPING_RATIO = 0.02
SUBSTEPS = 20


class Plant:
    """Links (q, v) and rotors (q_m, v_m) with springs of stiffness K [N·m/rad] between them."""

    def __init__(self, arm: ArmModel, stiffness: FloatArray) -> None:
        self._body, self._K = UncheckedArmDynamics(arm).rigid_body, stiffness
        self.q = middle(arm)
        self.v, self.v_m = np.zeros_like(self.q), np.zeros_like(self.q)
        self.q_m = self.q + self._body.gravity(self.q) / stiffness
        inertia = np.minimum(np.diag(self._body.mass_matrix(self.q)), ROTORS)
        self._D = 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)

    def step(self, effort: FloatArray) -> None:
        M = self._body.mass_matrix(self.q)
        h = self._body.nonlinear(self.q, self.v)
        n, dt = len(h), STEP / SUBSTEPS
        coupling = np.diag(dt * (self._D + dt * self._K))
        A = np.block([[M + coupling, -coupling], [-coupling, np.diag(ROTORS) + coupling]])
        inverse = np.linalg.inv(A)
        for _ in range(SUBSTEPS):  # implicit in the velocities
            spring = self._K * (self.q_m - self.q)
            u = inverse @ np.concatenate((
                M @ self.v + dt * (spring - h), ROTORS * self.v_m + dt * (effort - spring)))
            self.v, self.v_m = u[:n], u[n:]
            self.q, self.q_m = self.q + dt * self.v, self.q_m + dt * self.v_m


@pytest.mark.parametrize('stiffness', [5e3, 14e3])
@pytest.mark.parametrize(('rate', 'delay'), [(125, 0), (125, 8), (500, 4)])
def test_wrists_with_flexible_gearboxes_come_to_rest(
    stiffness: float, rate: int, delay: int, seen: Any,
) -> None:
    loop = check_rest([RIGID] * 3 + [stiffness] * 3, rate, delay, seen)
    assert rate < 500 or str(loop.controller.laws.adaptation) == ''


@pytest.mark.parametrize('size', [0.2, 0.35, 0.5])
@pytest.mark.parametrize(('rate', 'delay', 'stiffness'), [(125, 0, 14e3), (500, 4, 40e3)])
def test_gearboxes_of_the_shoulder_make_it_lower_its_gains(
    rate: int, delay: int, stiffness: float, size: float, seen: Any,
) -> None:
    """The rotor is a ninth of the inertia: fast motions see nine times the gain."""
    loop = check_rest([stiffness] * 6, rate, delay, seen, 0.01, 8.0, size)
    assert "'shoulder_lift_joint' oscillated with" in str(loop.controller.laws.adaptation)
    assert loop.controller.laws.adaptation.take_notice() == str(loop.controller.laws.adaptation)
    assert loop.controller.laws.adaptation.take_notice() == ''
    loop.controller.set_options(loop.controller.options)
    assert str(loop.controller.laws.adaptation) == ''


def check_rest(
    stiffness: list[float], rate: int, delay: int, seen: Any, error: float = 1e-3,
    seconds: float = 4.0, size: float = 0.35,
) -> ControlLoop:
    bare = smooth_arm('ur10')
    plant = Plant(bare, np.array(stiffness))
    loop = ControlLoop.of_arm(bare.with_reflected_inertia(ROTORS))
    goal = plant.q_m + size * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    pending: deque[tuple[int, FloatArray]] = deque()
    effort, speeds = None, []
    for k in range(round(1000 * seconds)):
        if k == 200:
            loop.follow(make_trajectory(
                bare.joint_names, [0.0], [goal.tolist()], (), (), bare.joint_names))
        if k % (1000 // rate) == 0:
            answer = loop.answer(FIRST_STAMP + k * MS, plant.q_m, plant.v_m).effort
            assert answer is not None
            pending.append((k + delay, answer))
        while pending and pending[0][0] <= k:
            effort = pending.popleft()[1]
        if effort is not None:
            plant.step(effort)
        speeds.append(max(np.abs(plant.v).max(), np.abs(plant.v_m).max()))
    seen(f'{max(speeds[-1000:]):.2g} rad/s, error {np.abs(plant.q_m - goal).max():.2g} rad')
    assert loop.supervisor.fault_count == 0
    assert max(speeds[-1000:]) < 1e-3
    assert np.abs(plant.q_m - goal).max() < error
    return loop
