# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The observer of joints without a signal, alone and in the real loop."""

from lock_step_loop import directions, frozen, LockStep, middle, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.frozen_joint_observer import FrozenJointObserver, UNKNOWN_EFFORT
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from simulated_arms import released

DT = 0.002
MARKS = [[1], [2]]


def observed(
    arm: ArmModel, plant_arm: ArmModel, marks: list[int], error: float, seconds: float,
) -> tuple[FrozenJointObserver, ArmSimulation, list[float]]:
    """
    Hold an arm by feedback of the estimate, whose first position is wrong by `error`.

    Return observer, plant and the errors of the estimated positions.
    """
    dynamics, n = UncheckedArmDynamics(arm), arm.joint_count
    q = middle(arm, 0.4)
    mask = np.isin(np.arange(n), marks)
    plant = released(plant_arm, q)
    observer = FrozenJointObserver(mask, dynamics, np.where(mask, q + error, q), np.zeros(n))
    errors = []
    for _ in range(round(seconds / DT)):
        body = dynamics.rigid_body
        effort = body.mass_matrix(observer.q) @ (
            100.0 * (q - observer.q) - 20.0 * observer.v) + body.gravity(observer.q)
        plant.step(effort, DT)
        observer.update(dynamics, effort, DT, plant.q.copy(), plant.v.copy())
        errors.append(float(np.abs(observer.q - plant.q).max()))
    return observer, plant, errors


@pytest.mark.parametrize('name', ['ur10', 'panda'])
@pytest.mark.parametrize('marks', MARKS)
def test_the_estimate_converges_to_the_true_position(name, marks):
    """Gravity and coupling at the other joints show it."""
    observer, plant, errors = observed(*2 * [smooth_arm(name)], marks, 0.01, 4.0)
    assert max(errors) < 0.1
    assert errors[-1] < 0.003
    assert np.abs(plant.v).max() < 0.03
    assert observer.is_valid


def test_friction_that_the_model_lacks_makes_the_estimate_invalid():
    """As soon as the efforts of the other joints contradict the model."""
    arm = smooth_arm('ur10')
    friction = 2.0 * UNKNOWN_EFFORT * arm.limits.effort
    sticky = arm.with_friction(make_friction(arm.joint_names, coulomb=friction.tolist()))
    dynamics, q = UncheckedArmDynamics(arm), middle(arm, 0.4)
    v = np.full(6, 0.3)
    plant = released(sticky, q, v)
    observer = FrozenJointObserver(np.arange(6) == 1, dynamics, q, v)
    for _ in range(50):
        effort = dynamics.rigid_body.gravity(plant.q)
        plant.step(effort, DT)
        observer.update(dynamics, effort, DT, plant.q.copy(), plant.v.copy())
    assert not observer.is_valid
    assert observer.is_held
    known = FrozenJointObserver(np.arange(6) == 1, UncheckedArmDynamics(sticky), q, v)
    assert not known.is_valid


def test_noise_makes_the_estimate_invalid():
    """Noise is no friction: nothing holds the joint."""
    arm = smooth_arm('ur10')
    dynamics, q, rng = UncheckedArmDynamics(arm), middle(arm, 0.4), np.random.default_rng(1)
    observer = FrozenJointObserver(np.arange(6) == 1, dynamics, q, np.zeros(6))
    effort = dynamics.rigid_body.gravity(q)
    for _ in range(100):
        observer.update(dynamics, effort, DT, q, 0.02 * rng.normal(size=6))
    assert not observer.is_valid
    assert not observer.is_held



@pytest.mark.parametrize('name', ['ur5', 'ur10', 'panda'])
@pytest.mark.parametrize('j', [0, 1, 2, 3])
@pytest.mark.parametrize('seconds', [0.3, 0.6])
def test_an_arm_without_friction_is_held_although_a_joint_is_frozen(name, j, seconds):
    """
    Gravity would topple it within one second.

    Nothing shows a slow motion of a joint about a vertical axis, as the first one.
    """
    arm = smooth_arm(name)
    one = LockStep(arm, q=middle(arm, 0.4), rate=500.0)
    one.run(0.2)
    one.follow(one.q + 1.2 * directions(arm.joint_count))
    one.run(seconds)
    one.sensor = frozen(j)
    trace = one.run(5.0)
    assert (np.abs(trace.v) <= 1.2 * arm.limits.velocity).all()
    assert one.loop.supervisor.mode is Mode.FAULT
    assert trace.last(2.0).speed.max() < 0.05


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


def test_without_another_joint_or_without_inertia_there_is_no_estimate():
    arm = smooth_arm('ur10')
    dynamics, q, zero = UncheckedArmDynamics(arm), middle(arm, 0.4), np.zeros(6)
    assert not FrozenJointObserver(np.ones(6, dtype=bool), dynamics, q, zero).is_valid
    observer = FrozenJointObserver(np.arange(6) == 1, dynamics, q, zero)
    observer.update(dynamics, np.full(6, np.nan), DT, q, zero)
    assert not observer.is_valid


@pytest.mark.parametrize('j', [2, 3])
def test_a_person_who_guides_an_arm_with_a_frozen_joint_is_not_taken_for_friction(j):
    """Nothing holds the joint: the arm is released to its brakes as without the person."""
    arm = smooth_arm('ur10')
    one = LockStep(arm, q=middle(arm, 0.4), rate=500.0, command='hand_guiding')
    one.push = lambda t: 0.1 * arm.limits.effort * (np.arange(6) == (j + 1) % 3)
    one.run(0.5)
    one.sensor = frozen(j)
    one.run(1.0)
    one.push = lambda t: 0.0
    one.run(4.0)
    assert one.loop.supervisor.mode is Mode.FAULT
    assert one.loop.signals.frozen._observer.is_held  # the push has disturbed the other joints
    assert one.loop.supervisor.limiter.last is None
