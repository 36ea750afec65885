# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Maps over two joints: each value is the library's at that point, and has its properties."""

import re

import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.worst_gravity import worst_gravity
from robot_dynamics.planar import two_link as planar
from robot_dynamics.planar.two_link import PlanarTwoLink
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics_tools.pictures.stick_figure import side_view, StickFigure, tool_link
from robot_dynamics_tools.pictures.torque_grid import (
    gravity_efforts,
    inertia_diagonal,
    make_grid,
    motion_efforts,
)
from robot_dynamics_tools.pictures.workspace_map import limit_ratios, map_gravity, smoothed
from robots import robot_urdf

DEFAULT = load_arm(default_arm_urdf())
ROBOTS = ('panda', 'tiago_no_hand')
"""A mimic joint, and a slide under a continuous one."""


@pytest.fixture(scope='module', params=ROBOTS)
def arm(request):
    return load_arm(robot_urdf(request.param))


def motion_of(arm):
    return np.random.default_rng(2).normal(0.0, 1.0, (2, arm.joint_count))


# --- the values ----------------------------------------------------------------------------------

def test_values_are_those_of_the_library_at_each_point(arm):
    arm = arm.with_friction(make_friction(arm.joint_names, [0.8], [1.5]))
    v, a = motion_of(arm)
    home = np.clip(np.linspace(0.3, -0.4, arm.joint_count), arm.limits.lower, arm.limits.upper)
    grid = make_grid(arm, arm.joint_names[1:3], home, samples=9)
    gravity, motion = gravity_efforts(arm, grid), motion_efforts(arm, grid, v, a)
    inertia = inertia_diagonal(arm, grid)
    body, dynamics = RigidBody(arm), ArmDynamics(arm)
    for row, column in np.random.default_rng(4).integers(0, 9, (12, 2)):
        q = grid.positions[row, column]
        assert (q[1], q[2]) == (grid.x[column], grid.y[row])
        npt.assert_array_equal(np.delete(q, [1, 2]), np.delete(home, [1, 2]))
        npt.assert_allclose(gravity[row, column], body.gravity(q), rtol=0.0, atol=1e-9)
        npt.assert_allclose(
            motion[row, column], dynamics.inverse_dynamics(q, v, a), rtol=0.0, atol=1e-9)
        npt.assert_allclose(
            inertia[row, column], np.diag(body.mass_matrix(q)), rtol=0.0, atol=1e-9)


# --- the grid ------------------------------------------------------------------------------------

def test_grids_cover_the_limits_and_a_turn_where_there_are_none():
    grid = make_grid(DEFAULT, samples=5)
    npt.assert_allclose(grid.x, np.linspace(-np.pi, np.pi, 5))
    panda = load_arm(robot_urdf('panda'))
    grid = make_grid(panda, ('panda_joint4', 'panda_finger_joint1'), samples=5)
    assert grid.joints == (3, 7)
    npt.assert_allclose(grid.x[[0, -1]], [panda.limits.lower[3], panda.limits.upper[3]])
    npt.assert_allclose(grid.y[[0, -1]], [panda.limits.lower[7], panda.limits.upper[7]])


def test_without_names_the_joints_with_the_most_gravity_are_taken():
    ur10 = load_arm(robot_urdf('ur10'))
    joints = make_grid(ur10, samples=3).joints
    assert [ur10.joint_names[j] for j in joints] == ['shoulder_lift_joint', 'elbow_joint']


@pytest.mark.parametrize(('joints', 'position', 'message'), [
    (('joint1', 'joint1'), (), "joints has 'joint1' twice"),
    ((), (1.0,), "position has 1 values, expected 2, one for each of ['joint1', 'joint2']"),
    ((), (1.0, np.nan), 'position[1] (joint2) is nan'),
])
def test_mistakes_name_the_joints(joints, position, message):
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        make_grid(DEFAULT, joints, position)
    with pytest.raises(InvalidInputError, match='expected at least two joints'):
        make_grid(load_arm(planar_arm_urdf([1.0], [1.0], [0.5], [0.1])))


# --- the arm as a line, and its workspace --------------------------------------------------------

def test_stick_figures_are_where_the_arm_is():
    figure = StickFigure(DEFAULT, tool_link(DEFAULT))
    q = np.array([0.4, -0.9])
    places = planar.forward_kinematics(PlanarTwoLink(), q)
    points = figure.points(q)
    npt.assert_allclose(points[:, [0, 2]], [*places.joints, places.tip], atol=1e-12)
    npt.assert_allclose(points[:, 1], 0.0, atol=1e-12)
    npt.assert_allclose(figure.tip(q[None])[0], points[-1], atol=1e-12)
    npt.assert_allclose(side_view(DEFAULT, points), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope='module')
def loaded():
    """Return the default arm with a payload that it cannot hold in every pose."""
    return DEFAULT.with_payloads([make_payload('tool0', 8.0)])


def test_places_have_the_ratios_of_the_poses_that_reach_them(loaded):
    found = map_gravity(loaded, 'tool0', positions=4000, cells=24)
    body, figure = RigidBody(loaded), StickFigure(loaded, 'tool0')
    assert found.is_plane
    rng = np.random.default_rng(1)
    known = 0
    for q in rng.uniform(-np.pi, np.pi, (300, 2)):
        x, _, z = figure.points(q)[-1]
        column = int(np.searchsorted(found.across, x)) - 1
        row = int(np.searchsorted(found.up, z)) - 1
        if not (0 <= row < len(found.up) - 1 and 0 <= column < len(found.across) - 1):
            continue
        if np.isnan(found.most[row, column]):
            continue
        ratio = limit_ratios(loaded, body.gravity(q)[None])[0]
        # Another pose in the same cell may differ by the change of gravity across the cell.
        assert found.least[row, column] - 0.15 < ratio < found.most[row, column] + 0.15
        known += 1
    assert known > 250


def test_the_workspace_ends_where_the_arm_ends(loaded):
    found = map_gravity(loaded, 'tool0', positions=4000, cells=24)
    for edges in (found.across, found.up):
        npt.assert_allclose(edges[[0, -1]], [-1.8, 1.8], atol=0.16)
    assert (found.least <= found.most)[~np.isnan(found.most)].all()
    worst = (worst_gravity(loaded).effort / loaded.limits.effort).max()
    assert np.nanmax(found.most) == pytest.approx(worst, rel=0.02)
    assert np.nanmax(found.most) <= worst + 1e-9
    assert 0.3 < found.held < 0.7


def test_without_any_effort_limit_there_is_nothing_to_compare_with():
    arm = load_arm(default_arm_urdf().replace('effort="150.0"', 'effort="0"').replace(
        'effort="60.0"', 'effort="0"'))
    with pytest.raises(InvalidInputError, match=r"no effort limit at any of .*'joint2'"):
        map_gravity(arm, 'tool0')
    half = load_arm(default_arm_urdf().replace('effort="150.0"', 'effort="0"'))
    found = map_gravity(half, 'tool0', positions=500, cells=8)
    assert np.nanmax(found.most) == pytest.approx(11.772 / 60.0, rel=0.01)


def test_an_arm_in_space_is_mapped_by_distance_and_height():
    found = map_gravity(load_arm(robot_urdf('ur10')), 'tool0', positions=2000, cells=20)
    assert not found.is_plane
    assert found.across[0] >= 0.0
    assert found.held == 1.0
    assert np.nanmax(found.most) < 1.0


def test_a_smoothed_map_keeps_values_and_its_edge():
    x = np.arange(41) - 20.0
    radius = np.hypot(x[:, None], x)
    smooth, reached = smoothed(np.where(radius < 15.0, 0.7 + 0.01 * x, np.nan))
    assert len(reached) == 4 * (len(x) + 2)  # four per cell, and a cell at each edge
    fine = (np.arange(len(reached)) + 0.5) / 4.0 - 0.5 * len(reached) / 4.0
    away = np.hypot(fine[:, None], fine)
    npt.assert_allclose(np.where(away < 10.0, smooth - 0.7 - 0.01 * fine, 0.0), 0.0, atol=1e-3)
    assert away[reached > 0.5].max() < 15.6
    assert away[reached < 0.5].min() > 14.4
