# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The animation: the contents of stage and bars, and the tool that draws it."""

from argparse import Namespace
import re

import numpy as np
import numpy.testing as npt
import pytest
from recordings import serialized
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.animation.arm_motion import simulate_motion
from robot_dynamics_tools.animation.chain_animation import _trail, chain_frames
from robot_dynamics_tools.animation.chain_stage import ChainStage
from robot_dynamics_tools.animation.panels import effort_bars, energy_bars
from robot_dynamics_tools.commands import animate
from robot_dynamics_tools.commands.animate import main
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.messages import joint_state_messages
from robot_dynamics_tools.recordings.topics import JOINT_STATE
from robot_dynamics_tools.recordings.writer import RecordingWriter
from robot_dynamics_tools.reporting.figures import styled_figure
from robots import robot_path

Image = pytest.importorskip('PIL.Image')
pytest.importorskip('matplotlib')
SCALES = {'force': 50.0, 'moment': 10.0, 'acceleration': 10.0, 'rate': 2.0}
UR10_PLANE = ['shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint']


@pytest.fixture(scope='module')
def swing():
    return simulate_motion(load_arm(default_arm_urdf()), 4.0, 4.0)


def axes_of():
    with styled_figure(4.0, 4.0, None) as figure:
        return figure.add_axes((0.3, 0.1, 0.6, 0.8))


def empty_stage():
    axes = axes_of()
    stage = ChainStage(axes, 1.8, True)
    stage.clear(SCALES)
    return axes, stage


# --- stage and bars ------------------------------------------------------------------------------

def test_arrows_are_as_long_as_the_forces_and_point_their_way(swing):
    view = PlanarView(swing.arm)
    now = view.passes(swing.position[3], swing.velocity[3], swing.acceleration[3])
    axes, stage = empty_stage()
    stage.draw_arrow('force', now.joint_position[0], now.force[0])
    arrow = axes.patches[-1]
    start, *_ = points = arrow.get_path().vertices
    npt.assert_allclose(start, now.joint_position[0], atol=1e-9)
    size = np.linalg.norm(now.force[0])
    along = (points - start) @ now.force[0] / size
    assert 50.0 * along.max() == pytest.approx(size, rel=0.1)
    assert arrow.get_facecolor()[:3] == pytest.approx(
        [int('#D55E00'[k:k + 2], 16) / 255.0 for k in (1, 3, 5)])
    stage.clear(SCALES)
    assert not axes.patches


def test_the_trail_follows_the_tip_between_the_frames():
    fine = simulate_motion(load_arm(default_arm_urdf()), 3.0, 24.0 * 8.0)
    view, rest = PlanarView(fine.arm), np.zeros(2)
    times, tips = _trail(fine.at(fine.times[::8]), view)
    npt.assert_allclose(times, fine.times, atol=1e-9)
    expected = np.array([view.passes(q, rest, rest).tip_position for q in fine.position])
    npt.assert_allclose(tips[::8], expected[::8], atol=1e-12)
    npt.assert_allclose(tips, expected, atol=2e-3)


@pytest.mark.parametrize('moment', [-12.0, 7.0])
def test_arcs_cover_the_angle_of_the_moment_clockwise_from_above(moment):
    axes, stage = empty_stage()
    stage.draw_arc('moment', np.array([0.2, 0.1]), moment)
    x, y = axes.patches[-1].get_path().vertices[:39].T
    angle = np.unwrap(np.arctan2(x - 0.2, y - 0.1))
    assert angle[0] == pytest.approx(0.0)
    assert angle[-1] == pytest.approx(38.0 / 39.0 * moment / 10.0)  # without the head


def test_energy_bars_end_where_the_work_ends(swing):
    axes = axes_of()
    energy_bars(axes, swing).show(9)
    kinetic, potential, total, heat, work = axes.patches
    assert kinetic.get_width() == pytest.approx(swing.kinetic[9])
    assert total.get_width() == pytest.approx(potential.get_x() + potential.get_width())
    assert heat.get_x() + heat.get_width() == pytest.approx(work.get_width(), abs=1e-4)


def test_effort_bars_add_up_to_the_last_one(swing):
    axes, joint = axes_of(), 1
    panel = effort_bars(axes, swing, joint)
    for k in (2, 9):
        panel.show(k)
        *terms, total = (bar.get_width() for bar in axes.patches)
        assert sum(terms) == pytest.approx(total, abs=1e-8)
        assert total == pytest.approx(swing.terms['effort'][k, joint])
    assert '[N·m]' in {text.get_text() for text in axes.texts}


# --- frames --------------------------------------------------------------------------------------

def test_the_motion_stops_for_both_passes_of_each_link(swing):
    few = swing.at(np.array([0.0, 0.5]))
    frames = list(chain_frames(few, [0.5], 0.5, 'x'))
    assert [frame.seconds > 2.0 for frame in frames] == [False, False, True, True, True, True]
    assert frames[0].seconds == pytest.approx(1.0)
    assert len({frame.pixels.shape for frame in frames}) == 1
    for frame, after in zip(frames, frames[1:]):
        assert (frame.pixels != after.pixels).any()
    assert all(0.01 < (frame.pixels.min(axis=2) < 230).mean() < 0.3 for frame in frames)


# --- the tool ------------------------------------------------------------------------------------

def write_bag(path, motion, names, urdf=None, extra=()):
    with RecordingWriter(path) as writer:
        writer.add_topic('/joint_states', JOINT_STATE)
        if urdf is not None:
            writer.add_topic('/robot_description', 'std_msgs/msg/String')
            writer.write('/robot_description', 1, serialized('std_msgs/msg/String', data=urdf))
        stamps_ns = np.rint(1e9 * (motion.times + 1.0)).astype(np.int64)
        position, velocity, effort = (
            np.column_stack([values, np.tile(row, (len(stamps_ns), 1))]) for values, row in (
                (motion.position, [x for _, x in extra]),
                (motion.velocity, [0.0] * len(extra)),
                (motion.terms['effort'], [0.0] * len(extra))))
        for stamp_ns, data in zip(stamps_ns.tolist(), joint_state_messages(
                stamps_ns, [*names, *(name for name, _ in extra)], position, velocity, effort)):
            writer.write('/joint_states', stamp_ns, data)
    return path


@pytest.fixture(scope='module')
def recorded_swing(tmp_path_factory):
    motion = simulate_motion(load_arm(default_arm_urdf()), 3.0, 100.0)
    return write_bag(tmp_path_factory.mktemp('bags') / 'swing', motion, ['joint1', 'joint2'])


def test_positions_that_wrap_give_the_same_motion(tmp_path):
    """A pendulum about its rest pose, where a position within ±π steps by 2π."""
    arm = load_arm(default_arm_urdf())
    swing = simulate_motion(arm, 3.0, 100.0)
    assert np.abs(swing.position[200:250]).max() > np.pi
    motions = [animate._recorded_motion(arm, JointSeries(
        ('joint1', 'joint2'), np.rint(1e9 * swing.times).astype(np.int64), position,
        swing.velocity, None, 0), Namespace(bag='x', start=0.0), 3.0, 50.0)
        for position in (swing.position, wrap_to_pi(swing.position))]
    npt.assert_allclose(motions[0].position, motions[1].position, atol=1e-9)


def test_the_description_in_the_recording_is_used(tmp_path, capsys):
    urdf = robot_path('ur10').read_text()
    motion = simulate_motion(load_arm(urdf, UR10_PLANE), 2.0, 50.0)
    others = ['shoulder_pan_joint', 'wrist_2_joint', 'wrist_3_joint']
    still = write_bag(
        tmp_path / 'still', motion, UR10_PLANE, urdf, [(name, 0.0) for name in others])
    arguments = ['--joints', *UR10_PLANE, '--duration', '1', '--rate', '1', '--stop']
    assert main([str(still), *arguments, '-o', str(tmp_path / 'x.gif')]) == 0
    assert 'instants of ur10' in capsys.readouterr().out
    moved = write_bag(tmp_path / 'moved', motion, UR10_PLANE, urdf, [(others[0], 0.7)])
    assert main([str(moved), *arguments, '-o', str(tmp_path / 'y.gif')]) == 2
    err = capsys.readouterr().err
    assert re.match(r"animate: recording .* 'shoulder_pan_joint' up to 0\.70 away from 0", err)


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--urdf', 'UR10'], r"no planar chain: expected .* such as \['shoulder_lift_joint', "),
    (['--urdf', 'UR10', '--joints', 'elbow'], r"joints has 'elbow', expected joints out of \["),
    (['--stop', '9'], r'--stop is 9, expected a number in \[0, 5\]'),
    (['--topic', '/x'], '--topic is given without a recording'),
    (['SWING', '--urdf', 'UR10', '--joints', 'elbow_joint'],
     r"has the joints \['joint1', 'joint2'\], expected \['elbow_joint'\] of 'ur10' too"),
])
def test_mistakes_are_reported_in_one_line(recorded_swing, tmp_path, capsys, arguments, message):
    names = {'UR10': str(robot_path('ur10')), 'SWING': str(recorded_swing)}
    assert main(['-o', str(tmp_path / 'x.gif'), *(names.get(one, one) for one in arguments)]) == 2
    err = capsys.readouterr().err
    assert err.startswith('animate: ')
    assert err.count('\n') == 1
    assert re.search(message, err), err
