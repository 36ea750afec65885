# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The motion of an arm with viscous friction, compared with MuJoCo's integration."""

from engines import Array, MujocoEngine
import numpy as np
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robots import robot_urdf
from simulated_arms import released


def runge_kutta(
    mujoco: MujocoEngine, q: Array, v: Array, tau: Array, duration: float, h: float,
) -> Array:
    """Return the position after a motion in steps of h [s] of MuJoCo's RK4."""
    model, data = mujoco.model, mujoco.data
    model.opt.integrator, model.opt.timestep = mujoco.mj.mjtIntegrator.mjINT_RK4, h
    mujoco.mj.mj_resetData(model, data)
    data.qpos[mujoco.position], data.qvel[mujoco.velocity] = q, v
    data.qfrc_applied[mujoco.velocity] = tau
    for _ in range(round(duration / h)):
        mujoco.mj.mj_step(model, data)
    return np.array(data.qpos[mujoco.position])


@pytest.mark.parametrize(('name', 'viscous', 'steps', 'bound'), [
    ('default', [0.5, 0.2], (8e-3, 4e-3, 2e-3), 1e-9),
    pytest.param('ur10', [5.0, 5.0, 3.0, 0.5, 0.5, 0.5], (2e-3, 1e-3, 5e-4), 1e-9,
                 marks=pytest.mark.soak),
])
def test_mujocos_motion_converges_to_ours_with_its_order(name, viscous, steps, bound):
    urdf = robot_urdf(name)
    arm, mujoco = load_arm(urdf), MujocoEngine(urdf)
    assert mujoco.joint_names == list(arm.joint_names)
    arm = arm.with_friction(make_friction(arm.joint_names, viscous=viscous))
    mujoco.model.dof_damping[mujoco.velocity] = viscous
    n = arm.joint_count
    q, v, tau = np.full(n, 0.4), np.full(n, 0.3), np.full(n, 0.5)
    simulation = released(arm, q, v, max_step=2.5e-4)
    end = simulation.step(tau, 0.48).position
    errors = [np.abs(runge_kutta(mujoco, q, v, tau, 0.48, h) - end).max() for h in steps]
    assert errors[-1] < bound, errors
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 3.5).all(), errors
