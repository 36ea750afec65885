# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A recording compared with the model: known motions, and the real one of a UR10.

Drives that take a position and report no effort: it follows from command and position.
"""

import numpy as np
import pytest
from recordings import (
    encoded,
    KnownMotion,
    needs_ur10,
    serialized,
    UR10,
    write_recording,
    write_topics,
)
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis import position_drives
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.bag_analysis import analyze_recording
from robot_dynamics_tools.commands import identify
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.topics import common_types, JOINT_STATE
from robot_dynamics_tools.recordings.writer import RecordingWriter
from robots import robot_urdf

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

URDF = default_arm_urdf()
MOTION = KnownMotion()
HANGING = KnownMotion(rest=(np.pi, 0.0))
SETTINGS = AnalysisSettings(URDF)
GRAVITY = RigidBody(MOTION.arm).gravity_batch(MOTION.q)


def recorded(path, messages):
    return write_recording(path / 'bag', messages)


def states(names=MOTION.names, v=MOTION.v, tau=MOTION.tau):
    """Return the messages of the motion with other names, velocity or effort."""
    return encoded(MOTION.stamps_ns, names, MOTION.q, v, tau)


@pytest.fixture(scope='module')
def known(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp('known'), MOTION.messages())


def test_the_right_model_explains_a_noise_free_recording(known):
    analysis = analyze_recording(known, SETTINGS)
    assert analysis.recording.remarks == ()
    np.testing.assert_array_equal(analysis.motion.stamps_ns, MOTION.stamps_ns)
    assert (analysis.statistics.relative < 2e-3).all()
    assert (analysis.statistics.r_squared > 0.9999).all()
    counts = analysis.motion.usable
    assert analysis.statistics.sample_count == counts.sum() > 0.8 * len(counts)
    np.testing.assert_allclose(
        analysis.residual, analysis.measured - analysis.terms.effort, atol=1e-12)


def test_positions_that_wrap_change_nothing(tmp_path):
    """The arm swings about its rest pose, where a position within ±π steps by 2π."""
    straight, wrapped = (
        analyze_recording(write_recording(tmp_path / name, HANGING.messages(
            velocity=False, wrapped=name == 'wrapped')), SETTINGS)
        for name in ('straight', 'wrapped'))
    assert (wrapped.statistics.relative < 2e-2).all()
    assert wrapped.motion.differentiated == ()
    assert wrapped.motion.cutoff_hz == straight.motion.cutoff_hz
    assert wrapped.statistics.relative == pytest.approx(straight.statistics.relative, rel=1e-6)


def test_use_of_limits(known):
    limits, use = MOTION.arm.limits, analyze_recording(known, SETTINGS).limit_use
    np.testing.assert_allclose(
        use.effort, np.abs(MOTION.tau).max(axis=0) / limits.effort, rtol=0.01)
    np.testing.assert_allclose(
        use.velocity, np.abs(MOTION.v).max(axis=0) / limits.velocity, rtol=0.01)
    expected = np.minimum(limits.upper - MOTION.q.max(axis=0), MOTION.q.min(axis=0) - limits.lower)
    np.testing.assert_allclose(
        use.position, np.where(np.isfinite(expected), expected, np.nan), atol=0.01)


def test_missing_velocity_is_differentiated_and_reported(tmp_path):
    bag = recorded(tmp_path, MOTION.messages(velocity=False))
    analysis = analyze_recording(bag, SETTINGS)
    assert any('velocity not recorded' in remark for remark in analysis.recording.remarks)
    assert (analysis.statistics.relative < 1e-2).all()
    counts = analysis.motion.usable
    np.testing.assert_allclose(analysis.motion.velocity[counts], MOTION.v[counts], atol=0.01)


def test_missing_effort_is_reported_and_the_model_is_computed(tmp_path):
    bag = recorded(tmp_path, MOTION.messages(effort=False))
    analysis = analyze_recording(bag, SETTINGS)
    assert any('effort not recorded' in remark for remark in analysis.recording.remarks)
    assert analysis.statistics is analysis.residual is analysis.measured is None
    counts = analysis.motion.usable
    np.testing.assert_allclose(analysis.terms.effort[counts], MOTION.tau[counts], atol=0.2)


@pytest.mark.parametrize('pair', [('j1', 'joint1'), ('joint1', 'j1')])
def test_joints_of_other_names_are_mapped_in_either_order(tmp_path, pair):
    bag = recorded(tmp_path, MOTION.messages(names=('j1', 'joint2')))
    analysis = analyze_recording(bag, AnalysisSettings(URDF, joint_map=(pair,)))
    assert analysis.arm.joint_names == MOTION.names
    assert (analysis.statistics.relative < 2e-3).all()


def test_joints_that_were_not_recorded_are_locked_and_reported(tmp_path):
    analysis = analyze_recording(recorded(tmp_path, states(('joint1', 'gripper'))), SETTINGS)
    assert analysis.arm.joint_names == ('joint1',)
    assert 'not recorded, therefore locked: joint2' in analysis.recording.remarks


def test_another_robot_is_refused_by_name(known):
    with pytest.raises(InvalidInputError, match=r"'joint1', 'joint2'.*'ur10'.*--map"):
        analyze_recording(known, AnalysisSettings(robot_urdf('ur10')))


def test_a_topic_by_name_by_type_and_wrong(known):
    for topic in ('/joint_states', 'sensor_msgs/msg/JointState', 'sensor_msgs/JointState'):
        assert analyze_recording(
            known, AnalysisSettings(URDF, topic=topic)).recording.topic == '/joint_states'
    for topic in ('/joints', 'sensor_msgs/msg/Imu'):
        with pytest.raises(RecordingError, match='/joint_states'):
            analyze_recording(known, AnalysisSettings(URDF, topic=topic))


def test_the_description_in_the_recording_is_used(tmp_path, known):
    with RecordingWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/joint_states', JOINT_STATE)
        writer.add_topic('/robot_description', 'std_msgs/msg/String')
        writer.write('/robot_description', 1, serialized('std_msgs/msg/String', data=URDF))
        for time_ns, data in MOTION.messages():
            writer.write('/joint_states', time_ns, data)
    assert (analyze_recording(
        tmp_path / 'bag', AnalysisSettings()).statistics.relative < 2e-3).all()
    with pytest.raises(InvalidInputError, match='--urdf'):
        analyze_recording(known, AnalysisSettings())


def test_samples_with_brakes_are_excluded_and_reported(tmp_path):
    tau, braked = MOTION.tau.copy(), slice(500, 600)
    tau[braked] = 0.0
    analysis = analyze_recording(recorded(tmp_path, states(tau=tau)), SETTINGS)
    assert any('left out: 100 samples with zero effort' in remark
               for remark in analysis.recording.remarks)
    assert not np.isin(MOTION.stamps_ns[braked], analysis.motion.stamps_ns).any()
    assert (analysis.statistics.relative < 2e-3).all()


def test_noise_of_a_damaged_file_is_excluded_and_reported(tmp_path):
    v = MOTION.v.copy()
    v[400, 1] = 101.0  # more than ten times the limit, 10 rad/s
    analysis = analyze_recording(recorded(tmp_path, states(v=v)), SETTINGS)
    assert any('1 sample beyond the limits' in remark for remark in analysis.recording.remarks)
    assert (analysis.statistics.relative < 2e-3).all()
    v[400, 1] = 99.0
    analysis = analyze_recording(recorded(tmp_path / 'less', states(v=v)), SETTINGS)
    assert not any('beyond the limits' in remark for remark in analysis.recording.remarks)


# --- the meaning of the effort -------------------------------------------------------------------

def test_motor_currents_are_converted_by_the_parameters(tmp_path):
    motors = make_actuators(MOTION.names, [0.1, 0.2], [50.0, 100.0], rotor_inertia=[1e-4, 2e-4])
    arm = MOTION.arm.with_actuators(motors)
    tau = ArmDynamics(arm).inverse_dynamics_batch(MOTION.q, MOTION.v, MOTION.a)
    current = tau / (motors.gear_ratio * motors.torque_constant)
    file = tmp_path / 'arm.yaml'
    file.write_text("""/**:
  ros__parameters:
    joints: [joint2, joint1]
    measured_effort: motor_current
    actuator:
      torque_constant: [0.2, 0.1]
      gear_ratio: [100.0, 50.0]
      rotor_inertia: [2.0e-4, 1.0e-4]
""")
    analysis = analyze_recording(recorded(tmp_path, states(tau=current)), AnalysisSettings(
        URDF, parameters=read_parameter_file(file)))
    assert analysis.arm.joint_names == ('joint2', 'joint1')
    assert (analysis.statistics.relative < 2e-3).all()
    assert any('motor_current' in remark for remark in analysis.recording.remarks)


def test_efforts_of_drives_are_converted_by_the_parameters(tmp_path):
    reported = MOTION.tau / [0.7, 1.3] + [8.0, -4.0]
    bag = recorded(tmp_path, states(tau=reported))
    parameters = {'joints': ['joint1', 'joint2'], 'effort.report_scale': [0.7, 1.3],
                  'effort.report_offset': [8.0, -4.0]}
    analysis = analyze_recording(bag, AnalysisSettings(URDF, parameters=parameters))
    assert (analysis.statistics.relative < 2e-3).all()
    assert any('effort.report_scale' in remark for remark in analysis.recording.remarks)
    assert (analyze_recording(bag, SETTINGS).statistics.relative > 0.1).all()
    # gravity that the robot took out passes the drive together with the effort
    lacking = recorded(tmp_path / 'lacking', states(tau=reported - GRAVITY))
    analysis = analyze_recording(lacking, AnalysisSettings(URDF, parameters={
        **parameters, 'measured_effort': 'joint_torque_without_gravity'}))
    assert (analysis.statistics.relative < 2e-3).all()
    assert any('gravity is added; the measured' in one for one in analysis.recording.remarks)


# --- a real arm ----------------------------------------------------------------------------------

@needs_ur10
def test_the_urdf_of_a_real_ur10_leaves_a_third_to_all_of_the_effort():
    analysis = analyze_recording(UR10, AnalysisSettings(robot_urdf('ur10')))
    assert len(analysis.motion.stamps_ns) == 3441
    assert (analysis.statistics.relative > 0.32).all()
    assert (analysis.statistics.relative < 1.01).all()
    assert not analysis.recording.remarks


STIFFNESS = [900.0, 300.0]
NUMBERS = 'std_msgs/msg/Float64MultiArray'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a recording of position drives with a delay of 24 ms and friction, and commands."""
    motion = KnownMotion(seconds=15.0, rest=0.6)
    needed = motion.q + (motion.tau + 4.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02)) / STIFFNESS
    states, sent = motion.stamps_ns, motion.stamps_ns - 24_000_000
    return write_topics(tmp_path_factory.mktemp('servo') / 'bag', {
        '/joint_states': encoded(states, motion.names, motion.q),
        '/commands': encoded(sent, motion.names, needed)}), motion, (sent, needed)


def settings(stiffness=STIFFNESS, topic='/commands'):
    return AnalysisSettings(
        default_arm_urdf(), parameters={'drive.stiffness': stiffness}, command_topic=topic)


def test_the_effort_is_that_of_the_drive_after_its_delay(bag):
    path, motion, _ = bag
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
    path, _, _ = bag
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    arguments = [str(path), '--urdf', str(tmp_path / 'arm.urdf'), '--command-topic', '/commands']
    assert identify.main([*arguments, '-o', str(tmp_path / 'out'), '--jobs', '1']) == 0
    found = read_parameter_file(tmp_path / 'out' / 'identified.yaml')
    assert found['drive.stiffness'] == pytest.approx(STIFFNESS, rel=0.02)
    assert found['measured_effort'] == 'none'
    assert found['friction.viscous'] == pytest.approx([4.0, 4.0], rel=0.05)


def test_commands_of_other_types(bag, tmp_path):
    _, motion, (sent, needed) = bag
    types = common_types()
    layout = types.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    times = sent.tolist()
    write_topics(tmp_path / 'numbers', {'/numbers': [
        (time, bytes(types.serialize_cdr(types.types[NUMBERS](layout=layout, data=row), NUMBERS)))
        for time, row in zip(times, needed)]}, kind=NUMBERS)
    with Recording(tmp_path / 'numbers') as recording:
        found = position_drives.commands(recording, '/numbers', motion.names)
    assert found.stamps_ns.tolist() == times
    assert found.position == pytest.approx(needed)


def test_the_command_of_a_csv_file(bag, tmp_path):
    _, motion, (sent, needed) = bag
    rows = np.searchsorted(sent, motion.stamps_ns, side='right') - 1
    columns = [motion.stamps_ns * 1e-9, *motion.q.T, *needed[np.maximum(rows, 0)].T]
    names = ['time', *motion.names, *(f'{name}.command' for name in motion.names)]
    table = tmp_path / 'servo.csv'
    np.savetxt(table, np.column_stack(columns), delimiter=',', header=','.join(
        name if '.' in name or name == 'time' else f'{name}.position' for name in names),
        comments='')
    read = read_for_arm(table, settings(topic='command'))
    friction = 4.0 * motion.v + 0.5 * np.tanh(motion.v / 0.02)
    assert read.series.effort[5:] == pytest.approx((motion.tau + friction)[5:], abs=1.0)
