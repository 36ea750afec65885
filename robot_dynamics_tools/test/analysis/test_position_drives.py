# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that take a position and report no effort: it follows from command and position."""

import numpy as np
import pytest
from recordings import encoded, KnownMotion, write_topics
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis import position_drives
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.commands import identify
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.topics import common_types

STIFFNESS = [900.0, 300.0]
NUMBERS = 'std_msgs/msg/Float64MultiArray'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a recording of position drives with a delay of 24 ms and friction."""
    motion = KnownMotion(seconds=30.0, rest=0.6)
    needed = motion.q + (motion.tau + 4.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02)) / STIFFNESS
    states, sent = motion.stamps_ns, motion.stamps_ns - 24_000_000
    return write_topics(tmp_path_factory.mktemp('servo') / 'bag', {
        '/joint_states': encoded(states, motion.names, motion.q),
        '/commands': encoded(sent, motion.names, needed)}), motion


def settings(stiffness=STIFFNESS, topic='/commands'):
    return AnalysisSettings(
        default_arm_urdf(), parameters={'drive.stiffness': stiffness}, command_topic=topic)


def test_the_effort_is_that_of_the_drive_after_its_delay(bag):
    path, motion = bag
    read = read_for_arm(path, settings())
    (line,) = [line for line in read.remarks if line.startswith('effort: drive.stiffness times')]
    assert int(line.split()[-2]) == pytest.approx(24, abs=4)
    friction = read.series.effort - motion.tau
    assert friction == pytest.approx(4.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02), abs=0.05)


@pytest.mark.parametrize('bits', [10, 12])
def test_the_delay_of_a_damped_drive_with_few_bits(bits):
    motion, quantum = KnownMotion(seconds=30.0, rest=0.6), 2.0 * np.pi / 2**bits
    needed = motion.q + (
        motion.tau + 40.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02)) / STIFFNESS
    states, sent = (
        JointSeries(motion.names, stamps, quantum * np.round(q / quantum), None, None, 0)
        for stamps, q in (
            (motion.stamps_ns, motion.q), (motion.stamps_ns - 24_000_000, needed)))
    _, delay = position_drives.drive_effort(states, sent, motion.arm, STIFFNESS)
    assert delay == pytest.approx(0.024, abs=0.006)


def test_wrong_input_is_named(bag):
    with pytest.raises(InvalidInputError, match=r'drive\.stiffness.*expected values above 0'):
        read_for_arm(bag[0], settings([1.0, 0.0]))
    with pytest.raises(RecordingError, match=r"no topic '/command', expected one of"):
        read_for_arm(bag[0], settings(topic='/command'))


def test_identify_finds_masses_and_stiffness_without_effort(bag, tmp_path):
    path, motion = bag
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    arguments = [str(path), '--urdf', str(tmp_path / 'arm.urdf'), '--command-topic', '/commands']
    assert identify.main([*arguments, '-o', str(tmp_path / 'out'), '--jobs', '1']) == 0
    found = read_parameter_file(tmp_path / 'out' / 'identified.yaml')
    assert found['drive.stiffness'] == pytest.approx(STIFFNESS, rel=0.02)
    assert found['measured_effort'] == 'none'
    assert found['friction.viscous'] == pytest.approx([4.0, 4.0], rel=0.05)


def test_commands_of_other_types(bag, tmp_path):
    path, motion = bag
    with Recording(path) as recording:
        sent = recording.joint_series('/commands')
    types = common_types()
    layout = types.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    times = sent.stamps_ns.tolist()
    write_topics(tmp_path / 'numbers', {'/numbers': [
        (time, bytes(types.serialize_cdr(types.types[NUMBERS](layout=layout, data=row), NUMBERS)))
        for time, row in zip(times, sent.position)]}, kind=NUMBERS)
    with Recording(tmp_path / 'numbers') as recording:
        found = position_drives.commands(recording, '/numbers', motion.names)
    assert found.stamps_ns.tolist() == times
    assert found.position == pytest.approx(sent.position)


def test_the_command_of_a_csv_file(bag, tmp_path):
    path, motion = bag
    with Recording(path) as recording:
        sent = recording.joint_series('/commands')
    rows = np.searchsorted(sent.stamps_ns, motion.stamps_ns, side='right') - 1
    columns = [motion.stamps_ns * 1e-9, *motion.q.T, *sent.position[np.maximum(rows, 0)].T]
    names = ['time', *motion.names, *(f'{name}.command' for name in motion.names)]
    table = tmp_path / 'servo.csv'
    np.savetxt(table, np.column_stack(columns), delimiter=',', header=','.join(
        name if '.' in name or name == 'time' else f'{name}.position' for name in names),
        comments='')
    read = read_for_arm(table, settings(topic='command'))
    friction = 4.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02)
    assert read.series.effort[5:] == pytest.approx((motion.tau + friction)[5:], abs=1.0)
