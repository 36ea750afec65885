# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics move`, `watch` and `record` with real nodes."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
import json
import os
from pathlib import Path
import pty
import signal
import subprocess
import sys
import threading
from typing import Any

import children
from children import TIMEOUT
import numpy as np
import pytest
from rclpy.qos import qos_profile_sensor_data
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.recordings.reader import Recording
from robot_dynamics.tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics.tools.ros2_dynamics.verbs import make_parser, run
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

COMMAND = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a job of a shell
from robot_dynamics.tools.ros2_dynamics.verbs import main
sys.exit(main(sys.argv[1:]))
"""
TOPICS = {
    '/joint_states', '/effort_command', '/dynamics/terms', '/dynamics/computed_torque',
    '/dynamics/gravity_compensation', '/dynamics/reference', '/dynamics/payload', '/diagnostics'}
Ask = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {'condition_references': True}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0}),
            NodeProcess(DYNAMICS, namespace='/idle')):
        yield


@pytest.fixture(scope='module')
def client() -> Iterator[DynamicsClient]:
    with DynamicsClient('dynamics', TIMEOUT) as client:
        yield client


@pytest.fixture(scope='module')
def ros() -> Iterator[RosClient]:
    with RosClient() as ros:
        yield ros


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str], client: DynamicsClient) -> Ask:
    """Return a function that runs a verb: exit status, output, error output."""
    def ask(*words: str, client: DynamicsClient = client) -> tuple[int, str, str]:
        arguments = make_parser().parse_args(words)
        status = run(arguments.verb, arguments, lambda *_: nullcontext(client))
        out, err = capsys.readouterr()
        return status, out, err

    return ask


def start(*words: str, node: str = '/dynamics') -> 'subprocess.Popen[str]':
    """Start a verb in a process."""
    return children.popen(
        [sys.executable, '-c', COMMAND, *words, '--node', node, '--timeout', str(TIMEOUT)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process: 'subprocess.Popen[str]') -> tuple[int, str, str]:
    """Return the exit status and the rest of the output; a process that hangs is killed."""
    try:
        out, err = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    return process.returncode, out, err


def first_line(process: 'subprocess.Popen[str]') -> str:
    """Return the first line of the error output."""
    assert process.stderr is not None
    return str(process.stderr.readline())


# --- move ----------------------------------------------------------------------------------------

@pytest.mark.parametrize('is_conditioned', [True, False])
def test_the_arm_reaches_the_goal(ask: Ask, ros: RosClient, is_conditioned: bool) -> None:
    ros.set_parameters('/dynamics', {'condition_references': is_conditioned})
    try:
        status, out, _ = ask('move', '1.0', '0.5', '--duration', '1.5', '--json')
        answer = json.loads(out)
        assert status == 0
        assert (answer['joint_names'], answer['duration']) == (['joint1', 'joint2'], 1.5)
        np.testing.assert_allclose(answer['position'], [1.0, 0.5], atol=5e-3)
        np.testing.assert_allclose(
            answer['error'], np.subtract([1.0, 0.5], answer['position']), atol=1e-12)
        answer = json.loads(ask('move', 'joint2=-0.2', '--duration', '1', '--json')[1])
        np.testing.assert_allclose(answer['goal'], [1.0, -0.2], atol=5e-3)
        np.testing.assert_allclose(answer['position'], [1.0, -0.2], atol=5e-3)
    finally:
        ros.set_parameters('/dynamics', {'condition_references': True})
    status, out, err = ask('move', '1.0', '0.2', '--duration', '1')
    assert status == 0, err
    assert 'joint   goal [rad]  position [rad]  error [mrad]\n' in out


def test_a_joint_that_does_not_arrive_is_no_success(ask: Ask) -> None:
    """The model has a payload that the arm does not have."""
    try:
        assert ask('payload', 'tool0', '2')[0] == 0
        status, out, _ = ask('move', '0.5', '0.3', '--duration', '1')
        assert status == 1
        assert ' from its goal, expected at most 10 mrad' in out
    finally:
        ask('payload', '--clear')
    assert ask('move', '0.4', '0.3', '--duration', '1')[0] == 0


def test_the_duration_follows_from_velocities(ask: Ask) -> None:
    ask('move', '0', '0', '--duration', '1')
    by_limits = json.loads(ask('move', '2.5', '0', '--json')[1])['duration']
    # The limit is 10 rad/s, of which 60 % are used; the acceleration of 6 rad/s² lasts longer.
    assert by_limits == pytest.approx(np.sqrt(10.0 / 3.0**0.5 * 2.5 / 6.0), rel=1e-2)
    by_option = json.loads(ask('move', '1.5', '0', '-v', 'joint1=0.75', '--json')[1])['duration']
    assert by_option == pytest.approx(1.875 * 1.0 / 0.75, rel=1e-2)


def test_move_returns_without_waiting(ask: Ask) -> None:
    status, out, _ = ask('move', '0.5', '0.5', '--duration', '30', '--no-wait')
    assert (status, out) == (0, '/dynamics follows a motion of 30.00 s\n')
    # A goal that replaces a motion is accepted, too.
    answer = json.loads(ask('move', '0.8', '0.5', '--duration', '1', '--json')[1])
    np.testing.assert_allclose(answer['position'], [0.8, 0.5], atol=5e-3)


def test_a_rejected_motion(ask: Ask, ros: RosClient) -> None:
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


def test_an_interrupt_stops_the_arm(ask: Ask) -> None:
    process = start('move', '-0.5', '-0.5', '--duration', '600')
    assert '0 %' in first_line(process)
    process.send_signal(signal.SIGINT)
    status, out, err = finish(process)
    assert status == 130, err
    assert out.startswith(
        '/dynamics: interrupted, called ~/stop: stopping along the reference, then holding')
    checks = json.loads(ask('status', '--json')[1])['checks']
    assert 'ended early: ~/stop was called' in [check['message'] for check in checks]


def test_an_interrupt_waits_for_the_end_of_a_callback(client: DynamicsClient) -> None:
    completed = []

    def interrupt(_: JointState) -> None:
        signal.raise_signal(signal.SIGINT)
        completed.append(True)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with client.subscribed((JointState, '/joint_states', interrupt, qos_profile_sensor_data)):
            with pytest.raises(KeyboardInterrupt):
                client.wait(lambda: False)
    finally:
        signal.signal(signal.SIGINT, before)
    assert completed == [True]


def test_a_motion_that_ends_early(ros: RosClient) -> None:
    process = start('move', '-0.5', '-0.5', '--duration', '600')
    assert '0 %' in first_line(process)
    ros.call(Trigger, '/dynamics/stop', Trigger.Request())
    status, out, err = finish(process)
    assert (status, out) == (1, '')
    assert 'ros2 dynamics move: the motion ended early: ~/stop was called\n' in err


def test_a_motion_that_another_one_replaces(ask: Ask) -> None:
    process = start('move', '-0.5', '-0.5', '--duration', '600')
    assert '0 %' in first_line(process)
    assert ask('move', '0.25', '0.25', '--duration', '1')[0] == 0
    status, out, err = finish(process)
    assert (status, out) == (1, '')
    assert 'another goal has replaced this one: [0.25, 0.25]\n' in err


def test_a_motion_without_further_joint_states_ends() -> None:
    with running(NodeProcess(DYNAMICS, namespace='/cut', patient=False)):
        with running(NodeProcess(SIMULATED_ARM, {'rate': 200.0}, namespace='/cut')):
            process = start(
                'move', '-0.5', '-0.5', '--duration', '600', node='/cut/dynamics')
            assert '0 %' in first_line(process)
        status, out, err = finish(process)
    assert (status, out) == (1, '')
    assert 'the motion ended early: fault state_timeout' in err


# --- stop, command, reset ------------------------------------------------------------------------

def test_stop_holds_the_arm(ask: Ask) -> None:
    assert ask('move', '-0.6', '-0.6', '--duration', '60', '--no-wait')[0] == 0
    status, out, _ = ask('stop')
    assert (status, out) == (
        0, '/dynamics: stopping along the reference, then holding the position\n')
    wait_until(lambda: not np.any(np.round(json.loads(
        ask('watch', '--count', '1', '--json')[1])['velocity'], 4)), 'the rest')


def test_the_command_is_shown_and_changed(ask: Ask, ros: RosClient) -> None:
    assert ask('command')[1] == "/dynamics: command is 'computed_torque'\n"
    status, out, _ = ask('command', 'none')
    assert status == 0
    assert out == (
        "/dynamics: command is 'none', it was 'computed_torque': a moving arm stops first; the "
        'effort is then ramped to zero\n')
    assert ros.get_parameter('/dynamics', 'command') == 'none'
    status, out, err = ask('command', 'computed')
    assert (status, out) == (2, '')
    assert "command is 'computed', expected one of" in err
    assert json.loads(ask('command', 'computed_torque', '--json')[1]) == {
        'node': '/dynamics', 'command': 'computed_torque', 'before': 'none'}


def test_reset_says_that_no_fault_is_latched(ask: Ask) -> None:
    status, out, err = ask('reset')
    assert (status, out) == (2, '')
    assert 'there is no fault' in err


@pytest.mark.parametrize(('words', 'said'), [
    (['0.1'], 'position has 1 value, expected 2: joint1, joint2'),
    (['joint3=1'], "position has joint 'joint3', expected one of: joint1, joint2"),
    (['0', '0', '--duration', '0'], '--duration is 0, expected'),
    (['0', '0', '--velocity', '0', '1'], 'velocity of joint1 is 0, expected'),
    (['0', '0', '--velocity', '1', '1', '--duration', '1'], 'expected one of the two'),
])
def test_invalid_arguments_of_move(ask: Ask, words: list[str], said: str) -> None:
    status, out, err = ask('move', *words)
    assert (status, out) == (2, '')
    assert said in err
    assert err.count('\n') == 1


# --- payload -------------------------------------------------------------------------------------

def test_a_load_of_model_and_simulated_arm_leaves_no_error() -> None:
    node = '/loaded/dynamics'
    with running(
            NodeProcess(DYNAMICS, namespace='/loaded', patient=False),
            NodeProcess(SIMULATED_ARM, {'lock_step': True, 'real_time_factor': 1.0},
                        namespace='/loaded')):
        for goal, loads in ((('1.0', '0.5'), False), (('0.5', '0.3'), True)):
            if loads:
                status, out, err = finish(
                    start('payload', 'tool0', '1.5', '--simulated', node=node))
                assert (status, err) == (0, '')
                assert "/loaded/simulated_arm: 1.5 kg on 'tool0'" in out
            status, out, err = finish(start('move', *goal, '--json', node=node))
            assert status == 0, err
            assert max(map(abs, json.loads(out)['error'])) < 1e-3


# --- watch ---------------------------------------------------------------------------------------

def test_tables_are_appended_without_a_terminal(ask: Ask) -> None:
    status, out, _ = ask('watch', '--rate', '20', '--count', '3')
    assert status == 0
    assert '\x1b' not in out
    tables = out.split('\n\n')
    assert len(tables) == 3
    heads = 'joint   position [rad]  velocity [rad/s]  command [N·m]  share of limit'
    assert all(heads in table and 'joint2' in table for table in tables)
    lines = ask('watch', '--rate', '20', '--count', '2', '--json')[1].splitlines()
    assert [json.loads(line)['joint_names'] for line in lines] == [['joint1', 'joint2']] * 2


def test_watch_shows_the_values_of_the_node(ask: Ask) -> None:
    ask('move', '0.7', '0.3', '--duration', '1')
    table = json.loads(ask('watch', '--count', '1', '--json')[1])
    np.testing.assert_allclose(table['position'], [0.7, 0.3], atol=5e-3)
    efforts = json.loads(ask('inverse', '0.7', '0.3', '--json')[1])['effort']
    np.testing.assert_allclose(table['effort_command'], efforts, rtol=2e-2)
    np.testing.assert_allclose(
        table['effort_share'], np.abs(table['effort_command']) / [150.0, 60.0])
    np.testing.assert_allclose(table['external_effort'], 0.0, atol=0.5)
    np.testing.assert_allclose(table['gravity'], efforts, rtol=2e-2)
    np.testing.assert_allclose(table['effort_minus_gravity'], 0.0, atol=0.5)
    assert 'measured [N·m]' in ask('watch', '--count', '1')[1]


def test_watch_and_status_show_the_stiffness_of_computed_torque(ask: Ask) -> None:
    ask('move', '0.7', '0.3', '--duration', '1')
    wait_until(lambda: 'stiffness' in json.loads(ask('watch', '--count', '1', '--json')[1]),
               'the stiffness')
    table = json.loads(ask('watch', '--count', '1', '--json')[1])
    M = ArmDynamics(load_arm(default_arm_urdf())).rigid_body.mass_matrix(
        np.array(table['position']))
    np.testing.assert_allclose(table['stiffness'], 400.0 * np.diagonal(M), rtol=1e-2)
    assert 'friction_error' not in table  # this arm has no friction
    out = ask('watch', '--count', '1')[1]
    assert 'stiffness [N·m/rad]' in out
    assert 'held by friction' not in out
    status, out, _ = ask('status')
    assert status == 0
    assert 'At rest: stiffness of the feedback [N·m/rad, N/m]' in out
    at_rest = json.loads(ask('status', '--json')[1])['at_rest']
    np.testing.assert_allclose(list(at_rest['stiffness'].values()), table['stiffness'], rtol=1e-2)


def test_known_friction_can_hold_an_error_and_rotors_count_in_the_check(ask: Ask) -> None:
    friction, rotors = [3.0, 2.0], [0.5, 0.2]
    parameters = {
        'joints': ['joint1', 'joint2'], 'friction.coulomb': friction,
        'actuator.reflected_inertia': rotors, 'robot_description': default_arm_urdf().replace(
            'effort="60.0"', 'effort="9999.0"')}
    assert 'effort="9999.0"' in str(parameters['robot_description'])
    with (NodeProcess(SIMULATED_ARM, parameters, namespace='/rubs'),
          NodeProcess(DYNAMICS, parameters, namespace='/rubs'),
          DynamicsClient('/rubs/dynamics', TIMEOUT) as client):
        def at_rest() -> Any:
            return json.loads(ask('status', '--json', client=client)[1])['at_rest']

        wait_until(lambda: len(at_rest()['friction_error']) == 2, 'the errors')
        found = at_rest()
        K = np.array(list(found['stiffness'].values()))
        expected = np.array(friction) / (K + np.array(friction) / 0.025)
        np.testing.assert_allclose(list(found['friction_error'].values()), expected, rtol=1e-2)
        assert (400.0 * np.array(rotors) < K).all()
        assert 'error held by friction [rad]' in ask('watch', '--count', '1', client=client)[1]
        findings = json.loads(ask('check', '--json', client=client)[1])['findings']
        message, = (f['message'] for f in findings if f['check'] == 'rotors')
        assert 'check actuator.reflected_inertia' in message


def test_without_computed_torque_no_stiffness_is_shown(ask: Ask, ros: RosClient) -> None:
    ros.set_parameters('/dynamics', {'command': 'gravity_compensation'})
    try:
        wait_until(lambda: not any(
            json.loads(ask('status', '--json')[1])['at_rest'].values()), 'no stiffness')
        assert 'At rest' not in ask('status')[1]
        assert 'stiffness' not in ask('watch', '--count', '1')[1]
    finally:
        ros.set_parameters('/dynamics', {'command': 'computed_torque'})


def test_a_terminal_shows_one_table() -> None:
    leader, follower = pty.openpty()
    process = children.popen(
        [sys.executable, '-c', COMMAND, 'watch', '--rate', '20', '--count', '2', '--node',
         '/dynamics', '--timeout', str(TIMEOUT)], stdout=follower)
    os.close(follower)
    output = bytearray()

    def read() -> None:
        try:
            while block := os.read(leader, 4096):
                output.extend(block)
        except OSError:  # Linux, at the end
            pass

    reader = threading.Thread(target=read)
    reader.start()
    assert process.wait(TIMEOUT) == 0
    reader.join(TIMEOUT)
    os.close(leader)
    assert output.count(b'\x1b[4F\x1b[J') == 1
    assert output.count(b'joint2') == 2


def test_watch_without_joint_states(ask: Ask) -> None:
    said = 'ros2 dynamics watch: no joint states on /idle/joint_states in 2 s\n'
    with DynamicsClient('/idle/dynamics', TIMEOUT) as idle:
        assert idle.name == '/idle/dynamics'
        idle.timeout = 2.0
        # On a loaded machine another answer of the node may take longer than the timeout.
        wait_until(lambda: ask('watch', client=idle) == (2, '', said), said)


# --- record --------------------------------------------------------------------------------------

def counts(answer: dict[str, Any]) -> dict[str, int]:
    return {row['topic']: row['recorded'] for row in answer['topics']}


def test_a_recording_has_the_description_and_all_topics(ask: Ask, tmp_path: Path) -> None:
    ask('move', '0.5', '0.5', '--duration', '1')
    for attempt in range(20):  # a loaded machine may deliver nothing in the given time
        bag = tmp_path / str(attempt)
        status, out, err = ask('record', '-o', str(bag), '--duration', '2', '--json')
        assert status == 0, err
        answer = json.loads(out)
        if all(counts(answer).values()):
            break
    assert set(counts(answer)) == TOPICS
    # Two nodes publish diagnostics, whose losses cannot be counted.
    assert [row['topic'] for row in answer['topics'] if row['lost'] is None] == ['/diagnostics']
    with Recording(bag) as recording:
        found = {topic.name: topic.message_count for topic in recording.topics}
        assert found == counts(answer) | {'/robot_description': 1}
        assert answer['recorded'] == sum(counts(answer).values())
        time_ns, message = next(iter(recording.messages('/robot_description')))
        assert '<robot name="planar_arm"' in message.data
        assert all(time_ns <= next(recording.messages(topic))[0] for topic in TOPICS)
        series = recording.joint_series(recording.joint_state_topic())
        assert series.joint_names == ('joint1', 'joint2')
        np.testing.assert_allclose(wrap_to_pi(series.position - 0.5), 0.0, atol=5e-3)
        terms = next(recording.messages('/dynamics/terms'))[1]
        assert list(terms.joint_names) == ['joint1', 'joint2']


def test_topics_by_name_and_the_table(ask: Ask, tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    status, out, err = ask(
        'record', 'joint_states', '~/residual', '-o', str(bag), '--duration', '0.5')
    assert status == 0
    assert err == f'Recording 2 topics to {bag}; ends after 0.5 s.\n'
    lines = [line.split() for line in out.splitlines()]
    assert [line[0] for line in lines[:3]] == ['topic', '/joint_states', '/dynamics/residual']
    assert out.splitlines()[-1].startswith(f'{bag}: ')
    assert out.splitlines()[-1].endswith(' lost')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_recording_in_order(tmp_path: Path, number: int) -> None:
    bag = tmp_path / 'bag'
    process = start('record', '--output', str(bag), '--json')
    assert first_line(process) == f'Recording 8 topics to {bag}; Ctrl-C ends.\n'
    process.send_signal(number)
    status, out, err = finish(process)
    assert status == 0, err
    with Recording(bag) as recording:
        assert not recording.losses
        assert {topic.name: topic.message_count for topic in recording.topics} == (
            counts(json.loads(out)) | {'/robot_description': 1})


@pytest.mark.parametrize(('words', 'said'), [
    (['/absent'], "TOPIC is '/absent', expected a topic that exists"),
    (['joint_states', '/joint_states'], "TOPIC has '/joint_states' twice, expected"),
    (['--duration', '-1'], '--duration is -1, expected'),
])
def test_invalid_arguments_of_record(
    ask: Ask, client: DynamicsClient, monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    words: list[str], said: str,
) -> None:
    assert client.name == '/dynamics'
    monkeypatch.setattr(client, 'timeout', 2.0)
    bag = tmp_path / 'bag'
    status, out, err = ask('record', '-o', str(bag), *words)
    assert (status, out) == (2, '')
    assert said in err
    assert err.count('\n') == 1
    assert not bag.exists()


def test_a_directory_is_not_overwritten(ask: Ask, tmp_path: Path) -> None:
    (tmp_path / 'notes').write_text('keep')
    status, _, err = ask('record', '-o', str(tmp_path))
    assert status == 2
    assert f'--output is {str(tmp_path)!r}, which exists; expected a new directory' in err
    assert os.listdir(tmp_path) == ['notes']
