# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of maps, and the tool that draws them."""

import re

import numpy as np
import numpy.testing as npt
import pytest
from report_page import ReportPage
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.animation.torque_tour import torque_frames
from robot_dynamics_tools.commands.torque_map import main
from robot_dynamics_tools.pictures.map_report import panel_verdict
from robot_dynamics_tools.pictures.torque_grid import (
    gravity_efforts,
    make_grid,
    rigid_body_efforts,
)
from robot_dynamics_tools.pictures.torque_map import map_figure, MapPanel
from robots import robot_path

pytest.importorskip('matplotlib')
from matplotlib.image import imread  # noqa: E402

DEFAULT = load_arm(default_arm_urdf())


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
