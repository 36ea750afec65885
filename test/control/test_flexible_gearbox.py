# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Flexible gearboxes of a UR10: the arm comes to rest.

The plant has a rotor and a link per joint, with a spring of little damping between them (M. W.
Spong, "Modeling and Control of Elastic Joint Robots", ASME J. Dynamic Systems, Measurement, and
Control 109(4), 1987). The loop knows the rotors, and measures on their side.
"""

from typing import Any

from lock_step_loop import directions, LockStep, smooth_arm, STEP
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop

ROTORS = np.array([1.0, 1.0, 0.6, 0.1, 0.1, 0.1])
"""[kg·m²] at the joints."""
RIGID = 1e6
"""[N·m/rad]"""
DAMPING_RATIO = 0.02
SUBSTEPS = 20


class FlexibleArm(LockStep):
    """Rotors (q, v) and links (q_l, v_l) with springs of stiffness K [N·m/rad] between them."""

    def __init__(self, stiffness: FloatArray, rate: float, delay: int) -> None:
        bare = smooth_arm('ur10')
        super().__init__(
            bare.with_reflected_inertia(ROTORS), true_arm=bare, rate=rate, delay=delay)
        self._K, self.q_l, self.v_l = stiffness, self.q, self.v
        self.q = self.q + self._body.gravity(self.q) / stiffness
        inertia = np.minimum(np.diag(self._body.mass_matrix(self.q_l)), ROTORS)
        self._D = 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)
        self.speeds: list[float] = []

    def _move(self, effort: FloatArray) -> None:
        M = self._body.mass_matrix(self.q_l)
        h = self._body.nonlinear(self.q_l, self.v_l)
        n, dt = len(h), STEP / SUBSTEPS
        coupling = np.diag(dt * (self._D + dt * self._K))
        A = np.block([[M + coupling, -coupling], [-coupling, np.diag(ROTORS) + coupling]])
        inverse = np.linalg.inv(A)
        for _ in range(SUBSTEPS):  # implicit in the velocities
            spring = self._K * (self.q - self.q_l)
            u = inverse @ np.concatenate((
                M @ self.v_l + dt * (spring - h), ROTORS * self.v + dt * (effort - spring)))
            self.v_l, self.v = u[:n], u[n:]
            self.q_l, self.q = self.q_l + dt * self.v_l, self.q + dt * self.v
        self.speeds.append(float(np.abs(u).max()))


@pytest.mark.parametrize(('rate', 'delay', 'stiffness'), [(125, 8, 5e3), (500, 4, 14e3)])
def test_wrists_with_flexible_gearboxes_come_to_rest(stiffness, rate, delay, seen):
    loop = check_rest([RIGID] * 3 + [stiffness] * 3, rate, delay, seen)
    assert rate < 500 or str(loop.controller.laws.oscillation) == ''


def test_gearboxes_of_the_shoulder_make_it_lower_its_gains(seen):
    """The rotor is a ninth of the inertia: fast motions see nine times the gain."""
    loop = check_rest([40e3] * 6, 500, 4, seen, 0.01, 13.0)
    assert str(loop.controller.laws.oscillation).startswith("'shoulder_")
    loop.controller.set_options(loop.controller.options)
    assert str(loop.controller.laws.oscillation) == ''


def test_lowered_gains_do_not_let_an_unknown_load_fall(seen):
    """30 N·m act on the shoulder from 1.5 s on."""
    one = FlexibleArm(np.full(6, 60e3), 500, 4)
    goal = one.q + 0.35 * directions(6)
    one.push = lambda t: -30.0 * np.eye(6)[1] * (t > 1.5)
    one.run(0.2)
    one.follow(goal)
    farthest = float(np.abs(one.run(5.8).last(4.0).q - goal).max())
    seen(f'{farthest:.3f} rad')
    assert one.loop.supervisor.fault_count == 0
    assert farthest < 0.5


def check_rest(
    stiffness: list[float], rate: int, delay: int, seen: Any, error: float = 1e-3,
    seconds: float = 4.0,
) -> ControlLoop:
    one = FlexibleArm(np.array(stiffness), rate, delay)
    goal = one.q + 0.35 * directions(6)
    one.run(0.2)
    one.follow(goal)
    one.run(seconds - 0.2)
    speed = max(one.speeds[-1000:])
    seen(f'{speed:.2g} rad/s, error {np.abs(one.q - goal).max():.2g} rad')
    assert one.loop.supervisor.fault_count == 0
    assert speed < 1e-3
    assert np.abs(one.q - goal).max() < error
    return one.loop
