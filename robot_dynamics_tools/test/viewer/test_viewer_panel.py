# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The controls and plots of the viewer."""

from contextlib import closing

import numpy as np
import numpy.testing as npt
import pytest
from robots import must_have_everything

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
from robot_dynamics_tools.viewer.panel import ArmPanel, hand_of
from robot_dynamics_tools.viewer.plots import LivePlot
from viewer_bench import arm_called, one_joint


@pytest.mark.parametrize(('robot', 'link'), [
    ('panda', 'panda_hand_tcp'), ('ur10', 'tool0'), ('default', 'tool0')])
def test_the_hand_is_what_holds_the_tool(robot, link):
    assert hand_of(arm_called(robot)) == link


# --- the controls --------------------------------------------------------------------------------

def panel_of(server, arm):
    return closing(ArmPanel(server.gui, arm, lambda do: do()))


@pytest.mark.parametrize('name', ['default', 'panda', 'tiago_no_hand'])
def test_sliders_are_within_the_limits_of_their_joints(server, name):
    arm = arm_called(name)
    with panel_of(server, arm) as panel:
        for i, slider in enumerate(panel._sliders):
            kind = arm.joint_kinds[i]
            unit = 'm' if kind == 'prismatic' else 'rad'
            assert slider.label == f'{arm.joint_names[i]} [{unit}]'
            assert arm.limits.lower[i] - 1e-9 <= slider.min <= slider.value <= slider.max
            assert slider.max <= arm.limits.upper[i] + 1e-9
            whole = 6.284 if kind == 'continuous' else arm.limits.upper[i] - arm.limits.lower[i]
            assert slider.max - slider.min == pytest.approx(whole, abs=0.002)
        assert panel.load[1] == panel.push[1] == hand_of(arm)


@pytest.mark.parametrize(('low', 'high'), [(-0.0004, 0.0004), (0.5, 0.5)])
def test_sliders_of_a_joint_that_hardly_moves_are_within_its_limits(server, low, high):
    arm = one_joint('prismatic', f'lower="{low}" upper="{high}" velocity="1"')
    with panel_of(server, arm) as panel:
        assert low <= panel._sliders[0].min <= panel._sliders[0].max <= high


def test_sliders_follow_the_arm_until_one_is_moved(server):
    with panel_of(server, arm_called('ur10')) as panel:
        def shown():
            return [slider.value for slider in panel._sliders]

        q = np.linspace(-1.0, 1.0, 6)
        panel.follow(q)
        npt.assert_allclose(shown(), q, atol=1e-3)
        panel._sliders[2].value = 0.777
        panel.follow(-q)
        npt.assert_allclose(shown(), [*q[:2], 0.777, *q[3:]], atol=1e-3)
        npt.assert_allclose(panel.take_goal(), [*q[:2], 0.777, *q[3:]], atol=1e-3)
        panel.follow(-q)
        npt.assert_allclose(shown(), -q, atol=1e-3)
        panel.follow(np.full(6, 100.0))
        assert shown() == [slider.max for slider in panel._sliders]


def test_the_slider_of_a_joint_that_has_turned_round_shows_where_it_is(server):
    with panel_of(server, one_joint('continuous')) as panel:
        panel.follow(np.array([4.0]))
        assert panel._sliders[0].value == pytest.approx(4.0 - 2.0 * np.pi, abs=1e-3)
        assert panel.take_goal()[0] == 4.0  # the user has not moved the slider
        panel._sliders[0].value = 1.5
        assert panel.take_goal()[0] == 1.5


# --- the plots -----------------------------------------------------------------------------------

@pytest.fixture
def plot(server):
    made = LivePlot(server.gui, 'a plot', ('gravity', 'effort'), least_span=2.0)
    yield made
    made.remove()


def drawn_of(plot):
    """Return the plotted columns, (3, m), and the range of the values."""
    return np.array(plot._handle.data), plot._handle.scales['y']['range']


def test_a_plot_without_values_has_axes_and_says_so(plot):
    assert [line['label'] for line in plot._handle.series] == ['t [s]', 'gravity', 'sum']
    plot.show(100.0)
    columns, span = drawn_of(plot)
    assert columns.shape == (3, 0)
    assert span == pytest.approx((-1.2, 1.2))
    assert plot._handle.title == 'a plot: no data'
    plot.add(100.0, [1.0, 2.0])
    plot.show(100.0)
    assert plot._handle.title == 'a plot'


def test_a_plot_shows_the_last_seconds(plot):
    for time in np.arange(100.0, 140.0, 0.5):
        plot.add(time, [time, -time])
        plot.show(time)
    columns, (low, high) = drawn_of(plot)
    times = np.arange(124.5, 140.0, 0.5)  # the last 15 s
    npt.assert_allclose(columns, [times - 139.5, times, -times])
    assert low < -139.5
    assert high > 139.5
    plot.show(150.0)  # no new data
    npt.assert_allclose(drawn_of(plot)[0][0], np.arange(135.0, 140.0, 0.5) - 150.0)


def test_a_plot_restarts_if_time_goes_back(plot):
    for time, value in ((7.0, 1.0), (8.0, 2.0), (8.0, 9.0), (3.0, 4.0), (3.5, 5.0)):
        plot.add(time, [value, value])
    plot.show(3.5)
    npt.assert_allclose(drawn_of(plot)[0], [[-0.5, 0.0], [4.0, 5.0], [4.0, 5.0]])
