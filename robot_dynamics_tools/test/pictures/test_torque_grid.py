# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Maps over two joints: each value is the library's at that point, and has its properties.

The figures of maps, and the tool that draws them.
"""

import re

import numpy as np
import numpy.testing as npt
import pytest
from report_page import ReportPage
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.worst_gravity import worst_gravity
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics.planar import two_link as planar
from robot_dynamics.planar.two_link import PlanarTwoLink
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics_tools.animation.torque_tour import torque_frames
from robot_dynamics_tools.commands.torque_map import main
from robot_dynamics_tools.pictures.map_report import panel_verdict
from robot_dynamics_tools.pictures.stick_figure import side_view, StickFigure, tool_link
from robot_dynamics_tools.pictures.torque_grid import (
    gravity_efforts,
    inertia_diagonal,
    make_grid,
    motion_efforts,
    rigid_body_efforts,
)
from robot_dynamics_tools.pictures.torque_map import map_figure, MapPanel
from robot_dynamics_tools.pictures.workspace_map import limit_ratios, map_gravity, smoothed
from robots import robot_path, robot_urdf

pytest.importorskip('matplotlib')
from matplotlib.image import imread  # noqa: E402

DEFAULT = load_arm(default_arm_urdf())
ROBOTS = ('panda', 'tiago_no_hand')
"""A mimic joint, and a slide under a continuous one."""


@pytest.fixture(scope='module', params=ROBOTS)
def arm(request):
    return load_arm(robot_urdf(request.param))


# --- the values ----------------------------------------------------------------------------------

def test_values_are_those_of_the_library_at_each_point(arm):
    arm = arm.with_friction(make_friction(arm.joint_names, [0.8], [1.5]))
    v, a = np.random.default_rng(2).normal(0.0, 1.0, (2, arm.joint_count))
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


@pytest.fixture(scope='module')
def grid():
    return make_grid(DEFAULT, samples=41)


def figure_of(grid, limit):
    values = gravity_efforts(DEFAULT, grid)[..., 0]
    return map_figure('title', DEFAULT, grid, [
        MapPanel('Effort at joint1', values, 'N·m', True, limit)])


def texts_of(axes):
    return [text.get_text() for text in axes.texts]


def limit_contour(axes):
    """Return the points of the contours that are drawn in the thickest black line."""
    return [path.vertices for contour in axes.collections for path in contour.get_paths()
            if list(contour.get_linewidths())[:1] == [2.4] and len(path.vertices)]


def test_axes_have_names_and_units(grid):
    axes, bar = figure_of(grid, 40.0).axes
    assert axes.get_xlabel() == 'position of joint1 [rad]'
    assert axes.get_ylabel() == 'position of joint2 [rad]'
    assert bar.get_ylabel() == '[N·m]'
    ticks = [label.get_text() for label in axes.get_xticklabels()]
    assert {'−1\xa0π', '−0.5\xa0π', '0\xa0π', '0.5\xa0π', '1\xa0π'} <= set(ticks)


def test_the_limit_is_a_contour_where_the_effort_is_the_limit(grid):
    axes = figure_of(grid, 40.0).axes[0]
    assert 'hatched: beyond the limit, 40 N·m' in texts_of(axes)
    paths = limit_contour(axes)
    assert paths
    values = gravity_efforts(DEFAULT, make_grid(DEFAULT, samples=41))[..., 0]
    fine = np.concatenate(paths)
    rows = np.abs(grid.y[:, None] - fine[:, 1]).argmin(axis=0)
    columns = np.abs(grid.x[:, None] - fine[:, 0]).argmin(axis=0)
    slope = 65.8 * (grid.x[1] - grid.x[0])
    npt.assert_allclose(np.abs(values[rows, columns]), 40.0, rtol=0.0, atol=1.2 * slope)


def test_without_a_limit_that_matters_nothing_is_hatched(grid):
    assert 'within the limit of 150 N·m everywhere' in texts_of(figure_of(grid, 150.0).axes[0])
    axes = figure_of(grid, np.inf).axes[0]
    assert not [text for text in texts_of(axes) if 'limit' in text]
    assert not limit_contour(axes)


# --- the tool ------------------------------------------------------------------------------------

@pytest.mark.parametrize(('arguments', 'said'), [
    (['gravity', '--payload', '8', '--samples', '21'], 'Effort at joint1 from -207 to 207 N·m'),
    (['inertia', '--samples', '15'], r'Inertia at joint2 from 0\.53 to 0\.53 kg·m²'),
    (['motion', '--velocity', '0.5', '0.3', '--acceleration', '0.1', '0.2', '--pose', '1', '1',
      '--samples', '15'], 'Effort at joint2 from '),
    (['--urdf', 'PANDA', '--joints', 'panda_joint2', 'panda_joint4', '--at', 'panda_joint1',
      'panda_joint2', 'panda_joint4', 'panda_finger_joint1', '--samples', '15'],
     'Effort at panda_finger_joint1 from .* N'),
])
def test_pictures_are_drawn(tmp_path, capsys, arguments, said):
    path = tmp_path / 'x.png'
    urdf = str(robot_path('panda'))
    assert main([urdf if one == 'PANDA' else one for one in arguments] + ['-o', str(path)]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f'{path}: ')
    assert re.search(said, out), out
    pixels = imread(path)[..., :3]
    assert min(pixels.shape[:2]) > 300
    assert 0.1 < (pixels.min(axis=2) < 0.9).mean() < 0.95


def test_the_animation_begins_with_gravity_at_the_first_position():
    grid = make_grid(DEFAULT, samples=5)
    frame = next(torque_frames(DEFAULT, grid, [0, 1]))
    assert frame.seconds == pytest.approx(8.0 / 36.0)
    assert frame.pixels.shape == (344, 960, 3)
    still = rigid_body_efforts(RigidBody(DEFAULT), grid, np.ones(2), np.ones(2), 0.0)
    npt.assert_allclose(
        still + gravity_efforts(DEFAULT, grid),
        RigidBody(DEFAULT).inverse_dynamics_batch(
            grid.positions.reshape(-1, 2), np.ones((25, 2)), np.ones((25, 2))).reshape(5, 5, 2))


@pytest.mark.parametrize(('arguments', 'message'), [
    (['-o', 'x.gif'], "'x.gif', an animation, expected 'motion' without --velocity"),
    (['--joints', 'joint1', 'elbow'],
     "joints has 'elbow', expected joints out of ['joint1', 'joint2']"),
    (['--velocity', '1', '2'],
     "--velocity and --acceleration are given with 'gravity', expected 'motion'"),
    (['-o', 'x.jpg'], "'x.jpg', expected a name that ends in one of"),
])
def test_mistakes_are_reported_in_one_line(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith('torque_map: ')
    assert err.count('\n') == 1
    assert message in err


@pytest.mark.parametrize(('values', 'limit', 'grade', 'words'), [
    ([-7.0, 8.0], 10.0, Grade.GOOD, 'at most 80 % of the limit of 10 N·m'),
    ([-8.1, 8.0], 10.0, Grade.CHECK, 'at most 81 %'),
    ([-11.0, 8.0, 1.0, 12.0], 10.0, Grade.BAD, 'above the limit at 50.0 % of the positions'),
    ([1.0, 2.0], np.inf, Grade.UNKNOWN, 'no effort limit'),
])
def test_the_verdict_on_an_effort_or_an_inertia(values, limit, grade, words):
    found = panel_verdict(MapPanel('Effort', np.array([values]), 'N·m', True, limit))
    assert found.grade is grade
    assert words in found.text
    grades = [panel_verdict(MapPanel('Inertia', np.array([[1.0, high]]), 'kg·m²', False)).grade
              for high in (2.9, 3.1)]
    assert grades == [Grade.GOOD, Grade.CHECK]


def test_the_report_of_a_map(tmp_path, capsys):
    path, what = tmp_path / 'map.html', 'workspace'
    assert main([what, '--payload', '3', '--samples', '21', '-o', str(path)]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f'{path}: ')
    assert '% of the positions tried can be held' in out
    page = ReportPage(path.read_text(encoding='utf-8'))
    assert page.is_complete
    assert len(page.links) == 1
    for words in (
            'Verdict on ', 'the planar two-link arm', f'command torque_map {what} --payload 3'):
        assert words in page.text
