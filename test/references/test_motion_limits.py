# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of references: the effort that gravity leaves within the limits, in the workspace."""

from dataclasses import replace
from functools import cache

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import random_states
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.motion_limits import WorkspaceInertia
from robots import JOINTS, robot_urdf

ARMS = ('default', 'ur10', 'panda')
EFFORT_FRACTION = 0.5  # of the remaining effort, and of its rate, for acceleration and jerk
SHORT_STOP = 0.2  # [s] that a stop takes at least, if it is shorter than in the whole workspace
ELSEWHERE = 1.15
"""Share of the allowed effort at poses that were not sampled; 1.097 was measured."""
GAIN = 1.35
"""Largest growth of one joint's limit by a heavier load; 1.28 was measured (panda)."""

laws = settings(max_examples=20)


@cache
def arm_of(name: str) -> ArmModel:
    return load_arm(robot_urdf(name))


@cache
def workspace(name: str) -> WorkspaceInertia:
    return WorkspaceInertia(ArmDynamics(arm_of(name)))


def rate(name: str) -> FloatArray:
    return arm_of(name).limits.effort / 0.1


def available(effort: FloatArray, gravity: FloatArray) -> FloatArray:
    """Return the effort available for acceleration, infinite if the arm cannot be held."""
    rest = EFFORT_FRACTION * (effort - np.abs(gravity))
    return np.where(can_hold(effort, gravity)[..., np.newaxis], rest, np.inf)


def can_hold(effort: FloatArray, gravity: FloatArray) -> BoolArray:
    return np.asarray((np.abs(gravity) <= 0.9 * effort).all(axis=-1))


@pytest.mark.parametrize('name', ARMS)
def test_limits_are_within_the_effort_at_every_sampled_pose(name):
    effort, at = arm_of(name).limits.effort, workspace(name)
    limits = at.motion_limits(effort, rate(name))
    share = float(can_hold(effort, at.gravity).mean())
    ratio = (at.mass @ limits.acceleration / available(effort, at.gravity)).max()
    assert ratio <= share * (1.0 + 1e-9)
    assert name != 'default' or ratio >= share * (1.0 - 1e-9)  # the effort is used
    assert (at.mass @ limits.jerk <= (1.0 + 1e-9) * EFFORT_FRACTION * rate(name)).all()


@pytest.mark.parametrize('name', ['ur10', 'panda'])
@settings(laws, max_examples=10)
@given(seed=st.integers(1, 2**31))
def test_any_acceleration_within_the_limits_needs_at_most_its_fraction(name, seed):
    body, effort = ArmDynamics(arm_of(name)).rigid_body, arm_of(name).limits.effort
    limits = workspace(name).motion_limits(effort, rate(name))
    for q in random_states(arm_of(name), 5, seed)[0]:
        M, g = body.mass_matrix(q), body.gravity(q)
        most = ELSEWHERE * available(effort, g)
        assert (np.abs(M) @ limits.acceleration <= most).all()
        assert (np.abs(M) @ limits.jerk <= ELSEWHERE * EFFORT_FRACTION * rate(name)).all()


def test_without_effort_limits_half_the_speed_is_reached_in_200_ms_with_a_jerk_of_50_ms():
    """A motion that the sender has planned may take 88 % of the speed, and 1.5 times the rest."""
    none = np.full(2, np.inf)
    for velocity, half in ((np.array([10.0, 4.0]), [5.0, 2.0]), (none, [1.0, 1.0])):
        arm = arm_of('default')
        arm = replace(arm, limits=replace(arm.limits, velocity=velocity))
        limits = WorkspaceInertia(ArmDynamics(arm)).motion_limits(none, none)
        assert limits.velocity == pytest.approx(np.array(half))
        assert limits.acceleration == pytest.approx(5.0 * limits.velocity)
        assert limits.jerk == pytest.approx(20.0 * limits.acceleration)
        assert limits.whole.velocity == pytest.approx(1.76 * limits.velocity)
        assert limits.whole.acceleration == pytest.approx(1.5 * limits.acceleration)
        assert limits.whole.jerk == pytest.approx(1.5 * limits.jerk)
    weak = workspace('default').motion_limits(np.zeros(2), np.zeros(2))
    assert weak.acceleration == pytest.approx(1e-3 * 5.0 * weak.velocity)


@pytest.mark.parametrize('name', ['default', 'panda'])
@settings(laws, max_examples=10)
@given(light=st.floats(0.1, 2.0), factor=st.floats(1.0, 3.0),
       place=st.tuples(*[st.floats(-0.2, 0.2)] * 3))
def test_a_heavier_payload_does_not_make_the_arm_faster(name, light, factor, place):
    arm = arm_of(name)
    found = []
    for mass in (light, light * factor):
        load = make_payload(arm.link_names[-1], mass, place, 0.01 * mass * np.eye(3))
        loaded = WorkspaceInertia(ArmDynamics(arm.with_payloads([load])))
        # A load that cannot be held in some poses has larger limits in the other poses.
        assume(can_hold(arm.limits.effort, loaded.gravity).all())
        found.append(loaded.motion_limits(arm.limits.effort, rate(name)))
    for lighter, heavier in ((found[0].acceleration, found[1].acceleration),
                             (found[0].jerk, found[1].jerk)):
        assert (heavier / lighter).min() <= 1.0 + 1e-9
        assert (heavier / lighter).max() <= GAIN


def test_a_load_that_changes_is_within_the_limits_with_both_loads():
    arm = arm_of('default')
    load = make_payload('tool0', 5.0, (0.05, 0.0, 0.1), 0.01 * np.eye(3))
    loaded = WorkspaceInertia(ArmDynamics(arm.with_payloads([load])))
    effort, empty = arm.limits.effort, workspace('default')
    both = loaded.heavier(empty).motion_limits(effort, rate('default'))
    holds = can_hold(effort, np.maximum(empty.gravity, loaded.gravity))
    assert holds.any()
    for at in (empty, loaded):
        most = (1.0 + 1e-9) * available(effort, at.gravity)
        assert (at.mass @ both.acceleration <= most)[holds].all()
    assert (both.velocity == empty.motion_limits(effort, rate('default')).velocity).all()


def test_a_tenth_of_the_effort_is_left_by_the_largest_friction():
    arm = arm_of('default')
    effort = arm.limits.effort
    at = WorkspaceInertia(ArmDynamics(arm.with_friction(
        make_friction(arm.joint_names, coulomb=effort))))
    holds = can_hold(effort, at.gravity)
    used = (at.mass @ at.motion_limits(effort, rate('default')).acceleration / effort)[holds]
    assert used.max() == pytest.approx(0.05 * holds.mean())


# ---------------------------------------------------------------------- braking

@pytest.mark.parametrize('name', ['xarm7', 'default'])
def test_a_stop_brakes_with_the_limits_of_its_poses(name):
    """At its start the effort suffices; joints that stop in 0.2 s anyway keep their limits."""
    arm = load_arm(default_arm_urdf() if name == 'default' else robot_urdf(name),
                   JOINTS.get(name, ()))
    body = ArmDynamics(arm).unchecked.rigid_body
    effort = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 100.0)
    rate = 10.0 * effort
    limits = WorkspaceInertia(ArmDynamics(arm)).motion_limits(effort, rate)
    rng = np.random.default_rng(1)
    low, high = np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0)
    stronger = 0
    for _ in range(100):
        q = rng.uniform(low, high)
        v = rng.uniform(-1.0, 1.0, len(q)) * 2.0 * limits.velocity * rng.integers(0, 2, len(q))
        found = limits.with_braking(body, effort, rate, q, v)
        a, jerk = found.braking.acceleration, found.braking.jerk
        assert (a >= limits.acceleration).all()
        assert (jerk >= limits.jerk).all()
        slow = np.abs(v) <= SHORT_STOP * limits.acceleration
        assert (a[slow] == limits.acceleration[slow]).all()
        assert (a <= np.maximum(limits.acceleration, np.abs(v) / SHORT_STOP) * (1 + 1e-12)).all()
        assert (found.lowered.acceleration == limits.lowered.acceleration).all()
        moves = a > limits.acceleration
        stronger += moves.any()
        if moves.any():  # the others brake at the same time with their own limits at most
            M, g = np.abs(body.mass_matrix(q)), body.gravity(q)
            free = effort + np.where(slow, -np.abs(g), np.sign(v) * g)
            free = np.maximum(free, 0.1 * effort)
            assert (M[:, moves] @ a[moves] <= 0.5 * free * (1 + 1e-9)).all()
            assert (M[:, moves] @ np.where(jerk > limits.jerk, jerk, 0.0)[moves] <= (
                0.5 * rate * (1 + 1e-9))).all()
    assert stronger > 10
