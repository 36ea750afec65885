# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Figures: a unit on every axis, distinguishable lines, and visible contents."""

import itertools
import sys
from types import SimpleNamespace

import children
import numpy as np
import pytest
from robot_dynamics.exceptions import MissingDependencyError
from robot_dynamics_tools.reporting import figures

pytest.importorskip('matplotlib')

TIMES = np.linspace(0.0, 2.0, 5001)
ONE = SimpleNamespace(joint_names=('a',), joint_kinds=('revolute',))
TWO = SimpleNamespace(joint_names=('turn', 'slide'), joint_kinds=('revolute', 'prismatic'))
"""Joints of an arm."""
WAVES = np.column_stack([np.sin(3.0 * TIMES), 0.1 * np.cos(3.0 * TIMES)])


@pytest.fixture
def figure():
    return figures.joint_figure('two joints', TWO, (
        figures.Panel(
            'Position', 'position', TIMES, {'reference': WAVES, 'measured': WAVES + 0.01},
            ('rad', 'm')),
        figures.Panel(
            'Tracking error', 'error', TIMES, {'error': 0.001 * WAVES}, ('mrad', 'mm'), 1e3),
        figures.effort_panel('Effort', TIMES, {'gravity': WAVES, 'effort': 2.0 * WAVES})))


def test_every_axis_has_its_unit(figure):
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == [
        'position [rad]', 'error [mrad]', 'effort [N·m]',
        'position [m]', 'error [mm]', 'effort [N]']
    assert [axes.get_xlabel() for axes in figure.axes[3:]] == ['time [s]'] * 3


def test_a_boundary_in_time_is_drawn_and_named_in_every_field():
    figure = figures.joint_figure(
        'two joints', TWO,
        [figures.effort_panel('Effort', TIMES, {'effort': WAVES})],
        figures.TimeBoundary(1.5, 'training', 'test'))
    for axes in figure.axes:
        assert 1.5 in [x for line in axes.lines for x in line.get_xdata() if len(
            line.get_xdata()) == 2]
        assert [text.get_text().strip() for text in axes.texts] == ['training', 'test']


def test_lines_show_the_values(figure):
    position, error, effort = figure.axes[:3]
    names = [line.get_label() for line in position.lines]
    assert names == ['reference', 'measured']
    x, y = effort.lines[1].get_data()
    assert len(x) == 2501  # of 5001: every second one, as at most 2000 are meant to be drawn
    np.testing.assert_allclose(y, 2.0 * np.sin(3.0 * np.asarray(x)), atol=1e-12)
    assert np.ptp(error.lines[0].get_ydata()) == pytest.approx(2.0, abs=0.1)  # in mrad


def linear(colour):
    """Return the linear components of red, green and blue (3,) of a colour of sRGB."""
    s = np.array([int(colour[k:k + 2], 16) / 255.0 for k in (1, 3, 5)])
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


DEUTERANOPIA = [
    [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
    [-0.011820, 0.042940, 0.968881]]
PROTANOPIA = [
    [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998]]
"""G. M. Machado et al., IEEE Trans. Visualization and Computer Graphics 15(6), 2009."""
SRGB_TO_XYZ = [
    [0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]


def lab(colour, vision):
    """Return the CIE L*a*b* (3,) of a colour as seen with a kind of colour vision."""
    xyz = np.array(SRGB_TO_XYZ) @ np.clip(np.array(vision) @ linear(colour), 0.0, 1.0)
    f = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-9))
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize('vision', [np.eye(3), DEUTERANOPIA, PROTANOPIA])
def test_colours_of_lines_differ_with_any_kind_of_colour_vision(vision):
    colours = [
        figures.BLACK, figures.ORANGE, figures.SKY, figures.GREEN, figures.BLUE,
        figures.VERMILION, figures.PURPLE, figures.GREY]
    distances = {
        (one, other): np.linalg.norm(lab(one, vision) - lab(other, vision))
        for one, other in itertools.combinations(colours, 2)}
    closest = min(distances, key=distances.get)
    assert distances[closest] > 15.0, closest


def test_values_of_zero_are_drawn_on_a_finite_axis():
    zeros = np.zeros((3, 1))
    figure = figures.joint_figure('still', ONE, (
        figures.effort_panel('Effort', np.arange(3.0), {'effort': zeros}),))
    assert figure.axes[0].get_ylim() == (-1.0, 1.0)


def test_without_matplotlib_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'matplotlib', None)  # Python's mark of a missing module
    with pytest.raises(MissingDependencyError, match='matplotlib'):
        figures.joint_figure('x', ONE, (figures.effort_panel('Effort', TIMES, {'effort': WAVES}),))


def test_neither_matplotlib_nor_ros_is_loaded_by_the_import():
    program = (
        'import sys, robot_dynamics_tools.reporting.figures, '
        'robot_dynamics_tools.recordings.reader, robot_dynamics_tools.excitation.demo_motion\n'
        'print([name for name in ("matplotlib", "rosbags", "rclpy", "sensor_msgs", "scipy") '
        'if name in sys.modules])')
    result = children.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert result.stdout.strip() == '[]', result.stderr
