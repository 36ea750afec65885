# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics move` and `watch` with real nodes."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
import json
import signal
import sys

from builtin_interfaces.msg import Duration
from children import TIMEOUT
import numpy as np
import pytest
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.task_space.frame_kinematics import FrameKinematics
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from verb_bench import assert_refused, finish, first_line, start


@pytest.fixture(scope='module', autouse=True)
def simulated_arm() -> Iterator[NodeProcess]:
    arm = NodeProcess(SIMULATED_ARM, {'rate': 200.0, 'lock_step': True, 'real_time_factor': 1.0})
    with running(NodeProcess(DYNAMICS, {'lock_step': True}), arm):
        yield arm


@pytest.fixture(scope='module')
def ros() -> Iterator[RosClient]:
    with RosClient() as ros:
        yield ros


# --- move ----------------------------------------------------------------------------------------

def test_the_arm_reaches_the_goal(ask):
    status, out, _ = ask('move', '1.0', '0.5', '--duration', '0.8', '--json')
    answer = json.loads(out)
    assert status == 0
    assert (answer['joint_names'], answer['duration']) == (['joint1', 'joint2'], 0.8)
    assert answer['at_rest']
    assert 0.6 < answer['time'] < 1.5
    np.testing.assert_allclose(answer['position'], [1.0, 0.5], atol=2e-4)
    np.testing.assert_allclose(
        answer['error'], np.subtract([1.0, 0.5], answer['position']), atol=1e-12)
    answer = json.loads(ask('move', 'joint2=-0.2', '--duration', '0.8', '--json')[1])
    np.testing.assert_allclose(answer['goal'], [1.0, -0.2], atol=5e-3)
    np.testing.assert_allclose(answer['position'], [1.0, -0.2], atol=5e-3)


def test_a_joint_that_does_not_arrive_is_no_success(ask):
    """The model has a payload that the arm does not have."""
    try:
        assert ask('payload', 'tool0', '2')[0] == 0
        status, out, _ = ask('move', '0.5', '0.3', '--duration', '0.5')
        assert status == 1
        assert ' not at the goal\n' in out
        assert 'friction' not in out  # a cause is not guessed
    finally:
        ask('payload', '--clear')
    assert ask('move', '0.4', '0.3', '--duration', '0.5')[0] == 0


def test_the_duration_follows_from_velocities(ask):
    ask('move', '0', '0', '--duration', '0.5')
    by_limits = json.loads(ask('move', '2.5', '0', '--json')[1])['duration']
    # The limit is 10 rad/s, of which 60 % are used; the acceleration of 6 rad/s² lasts longer.
    assert by_limits == pytest.approx(np.sqrt(10.0 / 3.0**0.5 * 2.5 / 6.0), rel=1e-2)
    by_option = json.loads(ask('move', '1.5', '0', '-v', 'joint1=1.5', '--json')[1])['duration']
    assert by_option == pytest.approx(1.875 * 1.0 / 1.5, rel=1e-2)
    for words, said in (
            (['-v', '1', '1', '--duration', '1'], 'one of the two'),
            (['--duration', '0'], '--duration is 0'), (['-v', '0', '1'], 'joint1 is 0')):
        assert_refused(ask, ['move', '0', '0', *words], said)


def test_move_returns_without_waiting(ask):
    status, out, _ = ask('move', '0.5', '0.5', '--duration', '30', '--no-wait')
    assert (status, out) == (0, '/dynamics follows a motion of 30.00 s\n')
    # A goal that replaces a motion is accepted, too.
    answer = json.loads(ask('move', '0.8', '0.5', '--duration', '0.5', '--json')[1])
    np.testing.assert_allclose(answer['position'], [0.8, 0.5], atol=5e-3)


def test_a_rejected_motion(ask, ros):
    ros.set_parameters('/dynamics', {'command': 'gravity_compensation'})
    try:
        for _ in range(2):  # the second rejection changes no level
            status, out, err = ask('move', '0.1', '0.1')
            assert (status, out) == (1, '')
            assert "/dynamics rejected the goal: command is 'gravity_compensation'" in err
            assert err.count('\n') == 1
    finally:
        ros.set_parameters('/dynamics', {'command': 'computed_torque'})
    assert ask('move', '0.1', '0.1')[0] == 0


def test_an_interrupt_stops_the_arm(ask):
    process = start('move', '-0.5', '-0.5', '--duration', '600')
    assert '0 %' in first_line(process)
    process.send_signal(signal.SIGINT)
    status, out, err = finish(process)
    assert status == 130, err
    assert out.startswith(
        '/dynamics: interrupted, called ~/stop: stopping along the reference, then holding')
    checks = json.loads(ask('status', '--json')[1])['checks']
    assert 'ended early: ~/stop was called' in [check['message'] for check in checks]


def test_an_interrupt_waits_for_the_end_of_a_callback(dynamics_client):
    completed = []

    def interrupt(_: JointState) -> None:
        signal.raise_signal(signal.SIGINT)
        completed.append(True)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with dynamics_client.subscribed(
                (JointState, '/joint_states', interrupt, qos_profile_sensor_data)):
            with pytest.raises(KeyboardInterrupt):
                dynamics_client.wait(lambda: False)
    finally:
        signal.signal(signal.SIGINT, before)
    assert completed == [True]


@contextmanager
def during_the_motion(act: Callable[[], object]) -> Iterator[None]:
    """Call `act` in a thread once the verb prints its progress: it has heard of the motion."""
    def wait_and_act() -> None:
        wait_until(lambda: '%' in sys.stderr.getvalue(), 'the progress')  # which capsys holds
        act()

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(wait_and_act)
        yield
        done.result(TIMEOUT)


def test_a_motion_that_is_stopped_or_replaced(ask, ros):
    with during_the_motion(lambda: ros.call(Trigger, '/dynamics/stop')):
        status, out, err = ask('move', '-0.5', '-0.5', '--duration', '600')
    assert (status, out) == (1, '')
    assert 'ros2 dynamics move: the motion ended early: ~/stop was called\n' in err
    goals = ros.publisher(JointTrajectory, '/dynamics/joint_trajectory')
    goal = JointTrajectory(joint_names=['joint1', 'joint2'], points=[JointTrajectoryPoint(
        positions=[0.25, 0.25], time_from_start=Duration(sec=1))])
    with during_the_motion(lambda: goals.publish(goal)):
        status, out, err = ask('move', '-0.5', '-0.5', '--duration', '600')
    assert (status, out) == (1, '')
    assert 'another goal has replaced this one: [0.25, 0.25]\n' in err


def test_pose_moves_a_link_and_names_a_refusal(ask):
    place = FrameKinematics(load_arm(default_arm_urdf()), 'tool0').pose
    assert ask('move', '0.8', '0.5', '--duration', '0.8')[0] == 0
    goal, _ = place(np.array([0.7, 0.6]))
    status, out, err = ask('pose', *goal, '--json')
    assert status == 0, err
    assert place(np.array(json.loads(out)['position']))[0] == pytest.approx(goal, abs=2e-3)
    status, _, err = ask('pose', '0.1', '0', '9')
    assert status == 1
    assert "rejected the goal: pose of 'tool0' is " in err


# --- stop, command, reset ------------------------------------------------------------------------

def test_stop_holds_the_arm(ask):
    assert_refused(ask, ['reset'], 'there is no fault')
    assert ask('move', '-0.6', '-0.6', '--duration', '60', '--no-wait')[0] == 0
    status, out, _ = ask('stop')
    assert (status, out) == (
        0, '/dynamics: stopping along the reference, then holding the position\n')
    wait_until(lambda: not np.any(np.round(json.loads(
        ask('watch', '--count', '1', '--json')[1])['velocity'], 4)), 'the rest')


def test_the_command_is_shown_and_changed(ask, ros):
    assert ask('command')[1] == "/dynamics: command is 'computed_torque'\n"
    status, out, _ = ask('command', 'none')
    assert status == 0
    assert out == (
        "/dynamics: command is 'none', it was 'computed_torque': a moving arm stops first; then "
        'the command ends\n')
    assert ros.get_parameter('/dynamics', 'command') == 'none'
    assert_refused(ask, ['command', 'computed'], "command is 'computed', expected one of")
    assert json.loads(ask('command', 'computed_torque', '--json')[1]) == {
        'node': '/dynamics', 'command': 'computed_torque', 'before': 'none'}


# --- payload -------------------------------------------------------------------------------------

def test_a_load_of_model_and_simulated_arm_leaves_no_error(ask):
    try:
        status, out, err = ask('payload', 'tool0', '1.5', '--simulated', '--transition', '0.5')
        assert (status, err) == (0, '')
        assert "/simulated_arm: 1.5 kg on 'tool0'" in out
        status, out, err = ask('move', '0.5', '0.3', '--json')
        assert status == 0, err
        assert max(map(abs, json.loads(out)['error'])) < 1e-3
    finally:
        ask('payload', '--clear', '--simulated')


# --- watch ---------------------------------------------------------------------------------------

def test_tables_are_appended_without_a_terminal_and_replaced_on_one(ask, monkeypatch):
    status, out, err = ask('watch', '--rate', '20', '--count', '3')
    assert err == ('no external efforts: no node dynamics_monitor; start it with: '
                   'ros2 run robot_dynamics_tools dynamics_monitor\n')
    assert status == 0
    assert '\x1b' not in out
    tables = out.split('\n\n')
    assert len(tables) == 3
    heads = 'joint   position [rad]  velocity [rad/s]  command [N·m]  share of limit'
    assert all(heads in table and 'joint2' in table for table in tables)
    lines = ask('watch', '--rate', '20', '--count', '2', '--json')[1].splitlines()
    assert [json.loads(line)['joint_names'] for line in lines] == [['joint1', 'joint2']] * 2
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    for columns in (80, 40):
        monkeypatch.setenv('COLUMNS', str(columns))
        first, second = ask('watch', '--rate', '20', '--count', '2')[1].split('\x1b[J')
        lines = first.splitlines()
        assert lines.pop() == f'\x1b[{len(lines)}F'
        assert max(map(len, [*lines, *second.splitlines()])) <= columns


def test_watch_and_status_show_the_values_of_the_node(ask, ros):
    """The stiffness only of computed torque."""
    ask('move', '0.7', '0.3', '--duration', '1')
    table = json.loads(ask('watch', '--count', '1', '--json')[1])
    np.testing.assert_allclose(table['position'], [0.7, 0.3], atol=5e-3)
    efforts = json.loads(ask('inverse', '0.7', '0.3', '--json')[1])['effort']
    np.testing.assert_allclose(table['effort_command'], efforts, rtol=2e-2)
    np.testing.assert_allclose(
        table['effort_share'], np.abs(table['effort_command']) / [150.0, 60.0])
    np.testing.assert_allclose(table['gravity'], efforts, rtol=2e-2)
    np.testing.assert_allclose(table['effort_minus_gravity'], 0.0, atol=0.5)
    wait_until(lambda: 'stiffness' in json.loads(ask('watch', '--count', '1', '--json')[1]),
               'the stiffness')
    table = json.loads(ask('watch', '--count', '1', '--json')[1])
    M = default_dynamics().rigid_body.mass_matrix(np.array(table['position']))
    np.testing.assert_allclose(table['stiffness'], 400.0 * np.diagonal(M), rtol=1e-2)
    assert 'friction_error' not in table  # this arm has no friction
    at_rest = json.loads(ask('status', '--json')[1])['at_rest']
    np.testing.assert_allclose(list(at_rest['stiffness'].values()), table['stiffness'], rtol=1e-2)
    ros.set_parameters('/dynamics', {'command': 'gravity_compensation'})
    try:
        wait_until(lambda: not any(
            json.loads(ask('status', '--json')[1])['at_rest'].values()), 'no stiffness')
        assert 'stiffness' not in ask('watch', '--count', '1')[1]
    finally:
        ros.set_parameters('/dynamics', {'command': 'computed_torque'})


def test_watch_without_joint_states(ask, dynamics_client, simulated_arm, monkeypatch):
    """The last test, because the simulated arm ends."""
    simulated_arm.stop()
    said = 'ros2 dynamics watch: no joint states on /joint_states in 2 s\n'
    assert dynamics_client.name == '/dynamics'
    monkeypatch.setattr(dynamics_client, 'timeout', 2.0)
    # On a loaded machine another answer of the node may take longer than the timeout.
    wait_until(lambda: ask('watch') == (2, '', said), said)
