# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Rotors and friction at the joints, against MuJoCo's `armature`, `damping` and `frictionloss`.

MuJoCo's dry friction is a soft constraint: a joint at rest creeps under a load, at a rate set by
`solref` and `solimp` (MuJoCo's documentation, chapter "Computation", "Constraint model"). Motions
with dry friction agree within this softness, and more closely the harder the constraint is.
"""

from collections.abc import Sequence
from typing import NamedTuple

from engines import Array, MujocoEngine
import numpy as np
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robots import robot_urdf
from simulated_arms import released

DOWN = (0.0, 0.0, -9.81)


class Pair(NamedTuple):
    arm: ArmModel
    mujoco: MujocoEngine


def pair(urdf: str, gravity: Sequence[float] = DOWN, **friction: Sequence[float]) -> Pair:
    """Return an arm with only this friction, and MuJoCo's model of it, still without friction."""
    arm = load_arm(urdf, gravity=gravity)
    mujoco = MujocoEngine(urdf, gravity)
    assert mujoco.joint_names == list(arm.joint_names)
    return Pair(arm.with_friction(make_friction(arm.joint_names, **friction)), mujoco)


# --- rotors and viscous friction -----------------------------------------------------------------


def runge_kutta(
    mujoco: MujocoEngine, q: Array, v: Array, tau: Array, duration: float, h: float,
) -> list[tuple[Array, Array]]:
    """Return position and velocity after each step of h [s] of MuJoCo's RK4."""
    model, data = mujoco.model, mujoco.data
    model.opt.integrator, model.opt.timestep = mujoco.mj.mjtIntegrator.mjINT_RK4, h
    mujoco.mj.mj_resetData(model, data)
    data.qpos[mujoco.position], data.qvel[mujoco.velocity] = q, v
    data.qfrc_applied[mujoco.velocity] = tau
    rows = []
    for _ in range(round(duration / h)):
        mujoco.mj.mj_step(model, data)
        rows.append((data.qpos[mujoco.position].copy(), data.qvel[mujoco.velocity].copy()))
    return rows


@pytest.mark.parametrize(('name', 'viscous', 'steps', 'bound'), [
    ('default', [0.5, 0.2], (8e-3, 4e-3, 2e-3), 1e-9),
    pytest.param('ur10', [5.0, 5.0, 3.0, 0.5, 0.5, 0.5], (2e-3, 1e-3, 5e-4), 1e-9,
                 marks=pytest.mark.soak),
])
def test_mujocos_motion_converges_to_ours_with_its_order(name, viscous, steps, bound):
    arm, mujoco = pair(robot_urdf(name), viscous=viscous)
    mujoco.model.dof_damping[mujoco.velocity] = viscous
    n = arm.joint_count
    q, v, tau = np.full(n, 0.4), np.full(n, 0.3), np.full(n, 0.5)
    simulation = released(arm, q, v, max_step=2.5e-4)
    end = simulation.step(tau, 0.48).position
    errors = [np.abs(runge_kutta(mujoco, q, v, tau, 0.48, h)[-1][0] - end).max() for h in steps]
    assert errors[-1] < bound, errors
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 3.5).all(), errors


# --- dry friction --------------------------------------------------------------------------------

def with_frictionloss(
    mujoco: MujocoEngine, loss: Sequence[float], time_constant: float, impedance: float,
) -> None:
    """Enable only the dry friction of MuJoCo's constraints, with this softness."""
    model, disable = mujoco.model, mujoco.mj.mjtDisableBit
    model.opt.disableflags = (
        disable.mjDSBL_CONTACT | disable.mjDSBL_LIMIT | disable.mjDSBL_REFSAFE)
    model.opt.tolerance, model.opt.iterations = 1e-14, 200
    model.dof_frictionloss[mujoco.velocity] = loss
    model.dof_solref[:] = time_constant, 1.0
    model.dof_solimp[:] = impedance, impedance, 1e-3, 0.5, 2.0


DRY = {
    'default': ([40.0, 15.0], [3.0, 0.4], [3.0, -2.0]),
    'ur10': (
        [120.0, 120.0, 60.0, 4.0, 4.0, 4.0], [0.0, -1.5, 0.3, 0.2, 0.1, 0.1],
        [1.0, -1.0, 1.0, 1.0, -1.0, 1.0]),
}
on_dry_arms = pytest.mark.parametrize(
    'name', ['default', pytest.param('ur10', marks=pytest.mark.soak)])
HARD = (1e-3, 0.9999)


@on_dry_arms
def test_a_motion_that_friction_ends_is_reached_as_mujocos_hardens(name):
    """Both slide and stop in the first half; at the end MuJoCo's joints still creep."""
    loss, q, v = DRY[name]
    arm, _ = pair(robot_urdf(name), coulomb=loss)
    zero = np.zeros(arm.joint_count)
    simulation = released(arm, q, v)
    ours = [simulation.step(zero, 1e-3) for _ in range(600)]
    stop = next(k for k, state in enumerate(ours) if not state.velocity.any())
    assert 20 <= stop <= 400
    assert np.abs(ours[-1].position - q).max() > 0.02  # the joints moved
    assert ours[-1].position.tolist() == ours[stop].position.tolist()  # and then stuck

    errors, drifts = [], []
    for softness in ((4e-2, 0.9), (1e-2, 0.99), HARD):
        _, mujoco = pair(robot_urdf(name))
        with_frictionloss(mujoco, loss, *softness)
        rows = runge_kutta(mujoco, np.array(q), np.array(v), zero, 0.6, 2e-4)[4::5]
        errors.append(max(
            np.abs(row[0] - state.position).max() for row, state in zip(rows, ours)))
        drifts.append(np.abs(rows[-1][0] - rows[stop + 100][0]).max())

    assert errors[0] > 4.0 * errors[1] > 16.0 * errors[2]
    assert errors[2] < 1e-3
    assert drifts[0] > 30.0 * drifts[1] > 300.0 * drifts[2] > 0.0
