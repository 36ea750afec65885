# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated arm with friction: exact solutions, stiction, convergence, stiff friction."""

import numpy as np
from optional_library import library
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robots import robot_urdf
from simulated_arms import released

# --- convergence and stiff friction --------------------------------------------------------------

def test_dry_friction_does_not_cost_the_method_its_order():
    """The sliding direction changes several times; steps are split only at these changes."""
    arm = load_arm(planar_arm_urdf(
        [5.0, 3.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], coulomb_friction=[2.0, 1.0]))

    def end(step: float) -> np.ndarray:
        simulation = released(arm, (2.5, 0.8), (0.5, -1.0), max_step=step)
        return np.concatenate(simulation.step(np.zeros(2), 1.2))

    exact = end(0.0005)
    errors = [np.abs(end(step) - exact).max() for step in (0.02, 0.01, 0.005)]
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 4.0).all(), errors


def test_stuck_joints_with_stiff_friction_act_as_fixed_joints():
    """Dry friction holds the wrists of the UR10; viscous friction would relax them fast."""
    urdf, viscous, steps = robot_urdf('ur10'), 0.3, (8e-3, 4e-3, 2e-3)
    arm = load_arm(urdf)
    arm = arm.with_friction(make_friction(arm.joint_names, [viscous], [0.0] * 3 + [100.0] * 3))
    fixed = load_arm(urdf, arm.joint_names[:3])
    fixed = fixed.with_friction(make_friction(fixed.joint_names, [viscous]))
    M = ArmDynamics(arm).rigid_body.mass_matrix(np.zeros(6))
    assert viscous * np.linalg.inv(M)[5, 5] * steps[-1] > 1.0  # friction at wrist 3 is stiff
    q0, v0 = np.array([0.2, -1.0, 0.8]), np.array([1.0, 0.6, -0.4])
    exact = released(fixed, q0, v0, 2.5e-4).step(np.zeros(3), 0.3).position
    assert np.abs(exact - q0).min() > 0.1
    errors = []
    for step in steps:
        simulation = released(arm, [*q0, 0.0, 0.0, 0.0], [*v0, 0.0, 0.0, 0.0], step)
        q, v = simulation.step(np.zeros(6), 0.3)
        assert q[3:].tolist() == v[3:].tolist() == [0.0] * 3
        errors.append(np.abs(q[:3] - exact).max())
    assert errors[-1] < 1e-9, errors
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 4.0).all(), errors


@pytest.mark.parametrize(('v0', 'tau'), [
    (0.0, 0.08),  # breaks away, and continues while friction decreases with speed
    (1.0, 0.05),  # decelerates to a speed with higher friction
])
def test_falling_friction_is_followed_where_viscous_friction_is_stiff(v0, tau):
    """J v̇ = τ − F_v v − [F_c + (F_s − F_c) exp(−(v/v_s)²)], with 23 time constants in 2 ms."""
    J, F_v, F_c, F_s, v_s, duration = 3.5e-5, 0.4, 0.02, 0.04, 0.05, 0.02
    arm = load_arm(planar_arm_urdf([0.01], [0.1], [0.05], [1e-5]), gravity=(0.0, 0.0, 0.0))
    arm = arm.with_friction(make_friction(arm.joint_names, [F_v], [F_c], [F_s], [v_s]))

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        dry = F_c + (F_s - F_c) * np.exp(-(y[1] / v_s)**2)
        return np.array([y[1], (tau - F_v * y[1] - dry) / J])

    def speed(_: float, y: np.ndarray) -> float:
        return float(y[1])

    speed.terminal, speed.direction = True, -1.0  # type: ignore[attr-defined]
    exact = library('scipy.integrate').solve_ivp(
        slope, (0.0, duration), [0.0, v0], 'Radau', events=speed, rtol=1e-11, atol=1e-13).y[:, -1]
    for step in (4e-3, 1e-3):
        simulation = released(arm, (0.0,), (v0,), step)
        before = sum(simulation.energy)
        q, v = simulation.step(np.array([tau]), duration)
        assert q == pytest.approx(exact[:1], abs=2e-8)
        assert v == pytest.approx(exact[1:], abs=1e-7 / np.sqrt(J))  # tolerance of a sub-step
        gain = sum(simulation.energy) - before
        assert simulation.work - simulation.heat == pytest.approx(gain, abs=1e-8)
