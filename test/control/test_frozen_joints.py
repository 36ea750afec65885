# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of joints without a signal, and the effort of their stop, with the real loop."""

from collections.abc import Sequence

from lock_step_loop import directions, FIRST_STAMP, frozen, LockStep, middle, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.frozen_joint_observer import FrozenJointObserver
from robot_dynamics.control.safety.frozen_joints import FrozenJoints
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robots import robot_urdf
from simulated_arms import released

DT = 0.002
HOLD = 2.5
"""[s]"""


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


def test_a_disturbance_takes_the_coupling_from_frozen_joints_only():
    """The others keep their accelerations; the frozen ones miss M_mm⁻¹ (M d)_m."""
    one, mask = in_motion(), np.isin(np.arange(6), [1, 4])
    controller, stamp = one.loop.controller, FIRST_STAMP + one.k * MS
    jammed = FrozenJoints(mask, np.full(6, stamp - 10 * MS), controller, stamp, DT, one.q, one.v)
    reference = controller.trajectory.sample(stamp)
    e, e_dot = 0.01 * np.arange(6.0), np.array([0.1, 0.05, -0.1, 0.02, 0.05, -0.03])
    output = controller.update(stamp, reference.position - e, reference.velocity - e_dot)
    K_p, K_d = controller.feedback_gains
    d = np.where(mask, 0.0, K_p * e + K_d * e_dot)
    for _ in range(2):  # ë = 0: the disturbance is steady
        effort = jammed.stopping_effort(output, DT, output.state.q, output.state.v, np.zeros(6))
    M, _ = controller.motion_equation(output, output.state.q, output.state.v)
    missing = np.linalg.solve(M, output.command - effort)
    assert missing[~mask] == pytest.approx(np.zeros(4), abs=1e-9)
    assert missing[mask] == pytest.approx(
        np.linalg.solve(M[np.ix_(mask, mask)], (M @ d)[mask]))
    assert np.abs(missing).max() > 0.1


@pytest.mark.parametrize(('coulomb', 'is_held'), [
    ((0.0, 0.0, 0.0), False), ((4.0, 4.0, 1.4), False), ((0.0, 3.4, 1.6), True)])
def test_an_arm_is_lost_after_its_hold_time_unless_friction_holds_all_frozen_joints(
    coulomb, is_held,
):
    """Joints 1 and 2 are frozen; 1 % of their limits is 3.3 and 1.5 N·m."""
    one, mask = in_motion(coulomb=(*coulomb, 0.0, 0.0, 0.0)), np.isin(np.arange(6), [1, 2])
    controller, stamp = one.loop.controller, FIRST_STAMP + one.k * MS
    jammed = FrozenJoints(mask, np.full(6, stamp - 10 * MS), controller, stamp, DT, one.q, one.v)
    still, limit = np.zeros(6), controller.arm.limits.velocity
    assert not jammed.is_lost(limit, stamp + 3_000 * MS, HOLD)  # the stop may take 3 s
    assert jammed.is_lost(limit, stamp + 3_100 * MS, HOLD)
    controller.stop()
    while not controller.has_stopped:
        stamp += 2 * MS
        controller.update(stamp, one.q, still)
        assert not jammed.is_lost(still, stamp, HOLD)
    assert not jammed.is_lost(still, stamp + round(1e9 * (HOLD - DT)), HOLD)
    assert jammed.is_lost(still, stamp + round(1e9 * (HOLD + DT)), HOLD) is not is_held
    others = np.where(mask, 0.0, (0.3 if any(coulomb[1:]) else 0.1) * limit)
    assert not jammed.is_lost(0.99 * others, stamp, HOLD)
    assert jammed.is_lost(1.01 * others, stamp, HOLD)


# --- the observer of the frozen joints -----------------------------------------------------------

@pytest.mark.parametrize(('friction', 'is_valid'), [(0.0, True), (0.02, False)])
def test_the_estimate_converges_unless_friction_contradicts_the_model(friction, is_valid):
    """Gravity and coupling at the other joints show it; friction is a share of the limits."""
    arm = smooth_arm('ur10')
    dynamics, q, mask = UncheckedArmDynamics(arm), middle(arm, 0.4), np.arange(6) == 1
    plant = released(arm.with_friction(make_friction(
        arm.joint_names, coulomb=(friction * arm.limits.effort).tolist())), q,
        None if is_valid else np.full(6, 0.3))
    observer = FrozenJointObserver(mask, dynamics, np.where(mask, q + 0.01, q), plant.v.copy())
    for _ in range(1500 if is_valid else 50):
        body = dynamics.rigid_body
        effort = body.gravity(plant.q) if not is_valid else body.mass_matrix(observer.q) @ (
            100.0 * (q - observer.q) - 20.0 * observer.v) + body.gravity(observer.q)
        plant.step(effort, DT)
        observer.update(dynamics, effort, DT, plant.q.copy(), plant.v.copy())
    assert observer.is_valid == is_valid
    assert not is_valid or np.abs(observer.q - plant.q).max() < 0.003
    assert observer.is_held != is_valid


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


@pytest.mark.parametrize('further', [[3], [0, 2, 3, 4, 5, 6]])
def test_a_further_joint_may_freeze(further):
    """Its sample is no measurement any more; if none is left, nothing can hold the arm."""
    arm = smooth_arm('panda')
    one = LockStep(arm, q=middle(arm, 0.4), rate=500.0)
    one.run(0.2)
    one.follow(one.q + 1.2 * directions(7))
    one.run(0.4)
    one.sensor = first = frozen(1)
    one.run(0.15)
    q, v = one.q.copy(), one.v.copy()
    is_further = np.isin(np.arange(7), further)
    one.sensor = lambda q_now, v_now: (
        np.where(is_further, q, first(q_now, v_now)[0]),
        np.where(is_further, v, first(q_now, v_now)[1]))
    trace = one.run(0.6)
    assert one.loop.supervisor.mode is Mode.FAULT
    marks = one.loop.signals.consistency.frozen
    assert marks.tolist() == (is_further | (np.arange(7) == 1)).tolist()
    assert len(further) > 1 or (np.abs(trace.v) <= 1.2 * arm.limits.velocity).all()


def test_a_person_who_guides_an_arm_with_a_frozen_joint_is_not_taken_for_friction():
    """Nothing holds the joint: the arm is released to its brakes as without the person."""
    arm = smooth_arm('ur10')
    one = LockStep(arm, q=middle(arm, 0.4), rate=500.0, command='hand_guiding')
    one.push = lambda t: 0.1 * arm.limits.effort * (np.arange(6) == 0)
    one.run(0.5)
    one.sensor = frozen(2)
    one.run(1.0)
    one.push = lambda t: 0.0
    one.run(4.0)
    assert one.loop.supervisor.mode is Mode.FAULT
    assert one.loop.supervisor.limiter.last is None
