# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of maps, and the tool that draws them."""

from itertools import product
import re

import numpy as np
import numpy.testing as npt
import pytest
from report_page import ReportPage
from robot_dynamics.model.arm import load_arm
from robot_dynamics.pictures.map_report import panel_verdict
from robot_dynamics.pictures.torque_grid import gravity_efforts, make_grid
from robot_dynamics.pictures.torque_map import (
    angle_ticks,
    even_poses,
    map_figure,
    MapPanel,
)
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.reporting.html_page import Grade
from robot_dynamics.tools.torque_map import main
from robots import robot_path

pytest.importorskip('matplotlib')
from matplotlib.collections import QuadMesh  # noqa: E402
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
    assert ticks == ['−π', '−π/2', '0', 'π/2', 'π']


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


def test_poses_start_at_their_points_and_have_the_shape_of_the_arm(grid):
    values = gravity_efforts(DEFAULT, grid)[..., 0]
    pose = np.array([[0.3, 1.1]])
    axes = map_figure('', DEFAULT, grid, [MapPanel('', values, 'N·m', True)], pose).axes[0]
    line = next(line.get_xydata() for line in axes.lines if len(line.get_xydata()) == 3)
    npt.assert_allclose(line[0], pose[0])
    upper, lower = np.diff(line, axis=0)
    angles = [np.arctan2(*upper), np.arctan2(*lower)]
    npt.assert_allclose(angles, [0.3, 0.3 + 1.1], atol=1e-9)
    assert np.linalg.norm(lower) / np.linalg.norm(upper) == pytest.approx(0.8)


def parts_of(path):
    """Return the parts of a path of matplotlib, (m, 2) each."""
    return np.split(path.vertices, np.flatnonzero(path.codes == path.MOVETO)[1:])


def along(points):
    """Return points between points (m, 2), four per line."""
    return np.vstack([points[:1], *(
        start + (end - start) * np.linspace(0.25, 1.0, 4)[:, None]
        for start, end in zip(points, points[1:]))])


def points_in(text, points):
    """Return which of the points (m, 2) [pixel] are within the box of a rotated text."""
    angle = np.radians(text.get_rotation())
    text.set_rotation(0.0)
    size = text.get_window_extent().size
    text.set_rotation(np.degrees(angle))
    middle = text.axes.transData.transform(text.get_position())
    turned = (points - middle) @ np.array([
        [np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.all(np.abs(turned) < 0.5 * size, axis=1)


@pytest.mark.parametrize(('joint', 'limit'), [(0, 40.0), (1, 30.0)])
def test_labels_cross_no_line_and_no_hatched_area(joint, limit):
    grid = make_grid(DEFAULT)
    values = gravity_efforts(DEFAULT, grid)[..., joint]
    figure = map_figure('', DEFAULT, grid, [MapPanel('', values, 'N·m', True, limit)])
    figure.draw_without_rendering()
    axes = figure.axes[0]
    hatched = np.argwhere(np.abs(values) > limit)
    lines = [along(part) for contour in axes.collections
             if not isinstance(contour, QuadMesh) and not contour.get_hatch()
             for path in contour.get_paths() for part in parts_of(path)]
    lines += [along(line.get_xydata()) for line in axes.lines]
    points = axes.transData.transform(np.vstack([
        *lines, np.column_stack([grid.x[hatched[:, 1]], grid.y[hatched[:, 0]]])]))
    labels = [text for text in axes.texts if re.fullmatch(r'−?[\d.]+', text.get_text())]
    assert len(labels) >= 4
    for label in labels:
        assert not points_in(label, points).any(), label.get_text()


def test_a_constant_panel_is_a_line_of_text(grid):
    values = gravity_efforts(DEFAULT, grid)[..., 0]
    figure = map_figure('', DEFAULT, grid, [
        MapPanel('Effort at joint1', values, 'N·m', True),
        MapPanel('Inertia at joint2', np.full_like(values, 0.53), 'kg·m²', False)])
    assert len(figure.axes) == 2  # map and colour bar
    assert figure.get_supxlabel() == 'Inertia at joint2: 0.53 kg·m² at all positions'


def test_even_poses_are_the_middles_of_equal_fields(grid):
    poses = even_poses(grid, 2)
    middles = (-0.5 * np.pi, 0.5 * np.pi)
    npt.assert_allclose(sorted(map(tuple, poses)), list(product(middles, repeat=2)))


@pytest.mark.parametrize(('low', 'high', 'places'), [
    (-np.pi, np.pi, {'−π': -1.0, '−π/2': -0.5, '0': 0.0, 'π/2': 0.5, 'π': 1.0}),
    (-1.7, 4.8, {'−π/2': -0.5, '0': 0.0, 'π/2': 0.5, 'π': 1.0, '3π/2': 1.5}),
    (-3.0 * np.pi, 3.0 * np.pi, {
        '−3π': -3.0, '−2π': -2.0, '−π': -1.0, '0': 0.0, 'π': 1.0, '2π': 2.0, '3π': 3.0}),
])
def test_angles_are_named_as_fractions_of_pi(low, high, places):
    angles, names = angle_ticks(low, high)
    assert names == list(places)
    assert angles == pytest.approx([np.pi * part for part in places.values()])


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


def test_without_arguments_the_path_of_the_picture_is_printed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([]) == 0
    path = tmp_path / 'out' / 'planar_arm_gravity.png'
    assert path.exists()
    out, err = capsys.readouterr()
    assert str(path) in out
    assert err.splitlines()[-1].split() == ['100', '%', '3', '/', '3', 'steps']


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--joints', 'joint1', 'elbow'],
     "joints has 'elbow', expected joints out of ['joint1', 'joint2']"),
    (['--at', 'elbow'], "--at has 'elbow', expected joints out of ['joint1', 'joint2']"),
    (['motion', '--velocity', '1'], 'velocity has 1 values, expected 2'),
    (['--velocity', '1', '2'],
     "--velocity and --acceleration are given with 'gravity', expected 'motion'"),
    (['--samples', '1'], '--samples is 1, expected a number in [3, 1001]'),
    (['--payload', '-1'], 'payload.inertia.m is -1'),
    (['--link', 'hand'], "'hand', expected one of the links ['base_link'"),
    (['--urdf', 'nowhere.urdf'], "'nowhere.urdf', which cannot be read"),
    (['-o', 'x.gif'], "'x.gif', expected a name that ends in one of"),
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
