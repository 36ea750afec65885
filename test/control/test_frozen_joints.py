# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of joints without a signal, and the effort of their stop, with the real loop."""

from collections.abc import Sequence

from lock_step_loop import directions, frozen, LockStep, middle, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.frozen_joint_observer import FrozenJointObserver
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robots import robot_urdf

DT = 0.002


def in_motion(rate: float = 500.0, coulomb: Sequence[float] = ()) -> LockStep:
    """Return a UR10 that has moved for 0.3 s on its way of 1 rad at all joints."""
    arm = load_arm(robot_urdf('ur10'))
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=coulomb))
    one = LockStep(arm, q=np.array([0.0, -1.0, 1.0, 0.0, 1.0, 0.0]), rate=rate)
    one.run(0.2)
    one.follow(one.q - directions(6))
    one.run(0.3)
    return one


@pytest.mark.parametrize(('joint', 'rate'), [(0, 500.0), (1, 250.0), (3, 250.0)])
def test_the_predicted_motion_is_the_true_one(joint, rate):
    """Until the fault is found, and for 0.1 s of the stop."""
    one = in_motion(rate)
    q, v = one.q[joint], one.v[joint]
    one.sensor = frozen(joint)
    loop = one.loop
    while loop.supervisor.fault is None:
        one.run(DT)
    for share in (0.2, 0.5):
        used = loop.controller.state
        moved = abs(one.q[joint] - q)
        assert used[1][joint] == pytest.approx(one.q[joint], abs=0.004 + 0.2 * moved)
        assert used[2][joint] == pytest.approx(one.v[joint], abs=share * abs(v))
        one.run(0.1)
    assert moved > 0.01


# --- the observer of the frozen joints -----------------------------------------------------------

@pytest.mark.parametrize(('sign', 'is_friction'), [(1, True), (-1, False)])
def test_a_disturbance_of_1_percent_of_the_effort_limit_ends_the_estimate(sign, is_friction):
    """A steady one is friction, which holds the arm; another one is noise or a push."""
    arm, q = smooth_arm('default'), np.array([0.8, 0.5])
    dynamics, zero = UncheckedArmDynamics(arm), np.zeros(2)
    hold = dynamics.inverse_dynamics(q, zero, zero)
    for share, is_used in ((0.009, True), (0.012, False)):
        one = FrozenJointObserver(np.array([False, True]), dynamics, q, zero)
        for k in range(100):
            torque = hold + sign**k * share * arm.limits.effort * [1.0, 0.0]
            one.update(dynamics, torque, DT, q, zero)
        assert (one.is_used, one.is_held) == (is_used, is_friction and not is_used)


@pytest.mark.parametrize(('name', 'j'), [('ur10', 1), ('panda', 3)])
def test_an_arm_without_friction_is_held_although_a_joint_is_frozen(name, j):
    """Gravity would topple it within one second."""
    arm = smooth_arm(name)
    one = LockStep(arm, q=middle(arm, 0.4), rate=500.0)
    one.run(0.2)
    one.follow(one.q + 1.2 * directions(arm.joint_count))
    one.run(0.3)
    one.sensor = frozen(j)
    trace = one.run(2.5)
    assert (np.abs(trace.v) <= 1.2 * arm.limits.velocity).all()
    assert one.loop.supervisor.mode is Mode.FAULT
    assert trace.last(0.5).speed.max() < 0.05
