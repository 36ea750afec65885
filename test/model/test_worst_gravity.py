# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The search of the largest gravity effort, compared with brute force and closed forms."""

import numpy as np
from one_joint_arm import arm_of, inertial, link_behind
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.worst_gravity import (
    QUICK,
    sample_positions,
    search_box,
    THOROUGH,
    worst_gravity,
)
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf

# 3R with twisted axes, a prismatic and a mimic joint: all kinds that the search distinguishes.
MIXED = arm_of(
    inertial(2.0, xyz='0.1 0 0.3'), geometry='', axis='0.3 1 0.2', more=f"""
  {link_behind(inertial(1.5, xyz="0 0.2 0.4"), name="a")}
  <link name="b">{inertial(1.0, xyz="0.2 0 0.1")}</link>
  <joint name="to_b" type="prismatic"><parent link="a"/><child link="b"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-0.2" upper="0.5" effort="9" velocity="1"/></joint>
  <link name="c">{inertial(0.5, xyz="0 0.1 0.3")}</link>
  <joint name="to_c" type="revolute"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="2" effort="9" velocity="1"/>
    <mimic joint="hinge" multiplier="0.5" offset="0.2"/></joint>""")


def grid_of(arm, points):
    low, high = search_box(arm)
    axes = [np.linspace(a, b, points) for a, b in zip(low, high)]
    return np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, arm.joint_count)


def brute_force(arm, q):
    return np.abs(RigidBody(arm).gravity_batch(q)).max(axis=0)


@pytest.mark.parametrize('search', [QUICK, THOROUGH], ids=['quick', 'thorough'])
def test_the_default_arm_against_brute_force_and_closed_form(search):
    arm = load_arm(default_arm_urdf())
    worst = worst_gravity(arm, search).effort
    # Both links horizontal: (m1 r1 + m2 (l1 + r2)) g, and m2 r2 g.
    np.testing.assert_allclose(
        worst, [9.81 * (5.0 * 0.5 + 3.0 * 1.4), 9.81 * 3.0 * 0.4], rtol=1e-6)
    grid = brute_force(arm, grid_of(arm, 361))
    assert np.all(worst >= (1.0 - 1e-6) * grid)
    np.testing.assert_allclose(worst, grid, rtol=1e-4)


def test_slides_and_mimic_joints_against_brute_force():
    arm = load_arm(MIXED)
    worst = worst_gravity(arm).effort
    grid = brute_force(arm, grid_of(arm, 41))
    assert np.all(worst >= 0.999 * grid)
    np.testing.assert_allclose(worst, grid, rtol=0.02)


@pytest.mark.parametrize('robot', ['ur10', pytest.param('xarm7', marks=pytest.mark.soak)])
def test_real_arms_against_thirty_thousand_random_positions(robot):
    arm = load_arm(robot_urdf(robot))
    low, high = search_box(arm)
    rng = np.random.default_rng(7)
    random = brute_force(arm, low + rng.random((30_000, arm.joint_count)) * (high - low))
    for search, fraction in ((QUICK, 0.99), (THOROUGH, 0.999)):
        assert np.all(worst_gravity(arm, search).effort >= fraction * random - 1e-9)


def test_its_positions_are_within_the_limits_and_give_its_efforts():
    arm = load_arm(robot_urdf('panda'))
    worst = worst_gravity(arm)
    low, high = search_box(arm)
    body = RigidBody(arm)
    np.testing.assert_array_equal(worst_gravity(arm).position, worst.position)  # always the same
    for i, q in enumerate(worst.position):
        assert np.all((low <= q) & (q <= high))
        assert abs(body.gravity(q)[i]) == pytest.approx(worst.effort[i], abs=1e-9)


def test_samples_are_spread_over_the_limits():
    """Each quarter of the range of each joint contains a fair share of the poses."""
    open_slide = load_arm(arm_of(limit='<limit lower="-inf" upper="inf"/>', kind='prismatic'))
    np.testing.assert_array_equal(search_box(open_slide), [[-1.0], [1.0]])
    arm = load_arm(robot_urdf('panda'))
    low, high = search_box(arm)
    fraction = (sample_positions(arm, 400) - low) / (high - low)
    assert fraction.min() >= 0.0
    assert fraction.max() < 1.0
    for column in fraction.T:
        counts, _ = np.histogram(column, bins=4, range=(0.0, 1.0))
        assert counts.min() >= 90
