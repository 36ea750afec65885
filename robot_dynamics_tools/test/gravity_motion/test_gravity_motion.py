# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`calibrate_gravity --move` with real nodes: the motion, its end, the recordings, the weight."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
import sys
import threading
import time
from typing import Any

from children import TIMEOUT
from diagnostic_msgs.msg import DiagnosticArray
from disturbances import set_payload
from geometry_msgs.msg import InertiaStamped
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.commands.calibrate_gravity import main
from robot_dynamics_tools.gravity_motion.plan import MotionSettings, Move
from robot_dynamics_tools.gravity_motion.poses import PoseChoice
from robot_dynamics_tools.gravity_motion.session import MotionRequest, record_holds
from robot_dynamics_tools.gravity_motion.watch import ArmWatch
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.motion_watch import goal_publication
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POSES = 'poses: [{joint1: 0.9, joint2: 0.6}, {joint1: -0.9, joint2: 0.9}, ' \
        '{joint1: 0.4, joint2: -1.2}, {joint1: -0.5, joint2: -0.8}]'
WEIGHT = make_payload('link2', 1.5, (0.0, 0.0, 0.3))
QUICK = '--hold', '1.5', '--step', '2', '--velocity', '1'
FAST = MotionSettings(hold=1.5, approach=0.05, step=2.0, velocity=3.0)
STOPPED = 'Called ~/stop: stopping along the reference, then holding the position'
COULOMB = 1.5
"""[N·m]: dry friction of the simulated arm."""
SCALE, OFFSET = np.array([0.75, 1.3]), np.array([1.5, -1.0])
"""Effort scale and offset [N·m] of the drives of the simulated arm, unknown to the node."""


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {
                'joints': ['joint1', 'joint2'], 'lock_step': True,
                'friction.coulomb': [0.9 * COULOMB, 1.2 * COULOMB]}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0,
                'friction.coulomb': [COULOMB],
                'joints': ['joint1', 'joint2'], **{
                    f'effort.{direction}_{name}': values.tolist()
                    for direction in ('command', 'report')
                    for name, values in (('scale', SCALE), ('offset', OFFSET))}})):
        yield


@pytest.fixture
def request_of(tmp_path: Path) -> Callable[..., MotionRequest]:
    """Return a function that makes a confirmed request for the four poses."""
    file = tmp_path / 'poses.yaml'
    file.write_text(POSES, encoding='utf-8')

    def request_of(**changes: Any) -> MotionRequest:
        return MotionRequest(
            [tmp_path / 'bag'], PoseChoice(file), FAST, None, 'dynamics', TIMEOUT,
            is_confirmed=True)._replace(**changes)

    return request_of


@contextmanager
def meanwhile(act: Callable[[], Any]) -> Iterator[None]:
    """Call `act` in a thread."""
    thread = threading.Thread(target=act)
    thread.start()
    try:
        yield
    finally:
        thread.join(TIMEOUT)


def wait_for_stop(client: RosClient) -> None:
    """Wait until ~/stop has ended the reference, and the arm rests."""
    wait_for_status(client, 'reference', 'ended early: ~/stop was called')
    client.wait_for(
        JointState, '/joint_states', lambda state: max(map(abs, state.velocity)) < 1e-3)


def wait_for_status(client: RosClient, name: str, text: str) -> None:
    client.wait_for(DiagnosticArray, '/diagnostics', lambda message: (
        status_of(message, name) == text))


def status_of(message: DiagnosticArray, name: str) -> str:
    return str(next((
        status.message for status in message.status if status.name == f'/dynamics: {name}'), ''))


class Operator:
    """Standard input of a terminal: acts when the tool asks, then types a line."""

    def __init__(self, *acts: Callable[[], Any], line: str = '\n') -> None:
        self._acts, self._line = list(acts), line

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        if self._acts:
            self._acts.pop(0)()
        return self._line


def recorded(bag: Path) -> JointSeries:
    """Return the recorded joint states; the recording must be complete."""
    with Recording(bag) as recording:
        assert not recording.notes
        assert '<robot name="planar_arm"' in next(
            iter(recording.messages('/robot_description')))[1].data
        assert {topic.name for topic in recording.topics} == {
            '/robot_description', '/joint_states', '/effort_command', '/dynamics/reference',
            '/dynamics/payload'}
        return recording.joint_series('/joint_states')


def calibrate(poses: Path, bag: Path, output: Path, *options: str) -> int:
    """Run the tool without a question; return its exit status."""
    return main([
        '--move', '--yes', '--node', 'dynamics', '--timeout', str(TIMEOUT), '--poses', str(poses),
        '--recording', str(bag), '--output', str(output), *options])


# --- the whole sequence --------------------------------------------------------------------------

@pytest.mark.soak
def test_the_tool_calibrates_with_a_weight(request_of, client, monkeypatch, capsys, tmp_path):
    first, second = tmp_path / 'bag', tmp_path / 'bag-with-weight'
    output = tmp_path / 'calibrated.yaml'
    monkeypatch.setattr(sys, 'stdin', Operator(
        lambda: set_payload(client, '/simulated_arm', WEIGHT),
        lambda: set_payload(client, '/simulated_arm')))
    with client.collect(InertiaStamped, '/dynamics/payload') as payloads:
        assert calibrate(
            request_of().choice.file, first, output, *QUICK, '--with-weight-after',
            '--weight-mass', '1.5', '--weight-link', 'link2', '--weight-position', '0', '0', '0.3',
        ) == 0
        payloads.wait_for(lambda message: message.inertia.m == 0.0)
        assert [message.inertia.m for message in payloads.messages] == [1.5, 0.0]
    out = capsys.readouterr().out
    assert out.index('Attach 1.5 kg to link2, with its centre of mass at (0, 0, 0.3) m') < (
        out.index("~/set_payload: 1.5 kg on 'link2'")) < (
        out.index('Remove the weight from link2')) < out.index('~/set_payload: no payload') < (
        out.index(f'Recorded: {first}, {second}'))
    found = read_parameter_file(output)
    for direction in ('command', 'report'):
        np.testing.assert_allclose(found[f'effort.{direction}_scale'], SCALE, rtol=0.005)
        np.testing.assert_allclose(found[f'effort.{direction}_offset'], OFFSET, atol=0.1)


# --- confirmation and rejections -----------------------------------------------------------------

def test_no_motion_without_a_confirmation(request_of, client, monkeypatch, capsys):
    before = client.wait_for(JointState, '/joint_states')
    request = request_of(is_confirmed=False)
    with Path(os.devnull).open(encoding='utf-8') as nothing:
        monkeypatch.setattr(sys, 'stdin', nothing)
        with pytest.raises(InvalidInputError, match='no terminal, expected one .* or --yes'):
            record_holds(request)
    monkeypatch.setattr(sys, 'stdin', Operator(line='y\n'))
    with pytest.raises(ToolError, match='not confirmed; the arm has not moved'):
        record_holds(request)
    assert capsys.readouterr().out.endswith('Type yes and press Enter to move the arm: ')
    assert record_holds(request._replace(previews=True)) is None
    assert not request.outputs[0].exists()
    after = client.wait_for(JointState, '/joint_states')
    np.testing.assert_allclose(after.position, before.position, atol=1e-6)


def test_a_node_that_another_client_uses_is_rejected(request_of, client):
    """The goals are where the arm is, because a motion is another reason, which may come first."""
    publisher = client.publisher(JointTrajectory, '/dynamics/joint_trajectory')
    with client.collect(JointState, '/dynamics/reference') as references:
        held = references.wait_for(lambda reference: not any(reference.velocity))
    goal = JointTrajectory(joint_names=held.name, points=[
        JointTrajectoryPoint(positions=held.position)])
    ends = threading.Event()

    def stream() -> None:
        while not ends.wait(0.1):
            publisher.publish(goal)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        with pytest.raises(ToolError, match='another client sends goals on /dynamics/joint_traj'):
            record_holds(request_of())
    finally:
        ends.set()
        thread.join(TIMEOUT)
        client.node.destroy_publisher(publisher)


def test_a_node_that_does_not_follow_references_is_rejected(request_of, client):
    client.set_parameters('/dynamics', {'command': 'gravity_compensation'})
    try:
        with pytest.raises(InvalidInputError) as raised:
            record_holds(request_of())
    finally:
        client.set_parameters('/dynamics', {'command': 'computed_torque'})
    assert "parameter command of /dynamics is 'gravity_compensation', expected" in str(
        raised.value)


# --- errors, interrupts, the weight --------------------------------------------------------------

def test_states_that_stop_are_an_error(client):
    arm = load_arm(default_arm_urdf())
    with DynamicsClient('dynamics', TIMEOUT) as one:
        watch = ArmWatch(one, arm)
        with watch.following():
            watch.wait_ready()
            goal = np.array(watch.measured()) + 0.1
            with goal_publication(one, arm.joint_names) as publish:
                watch.move(Move(goal, 0.5, 0.0), publish, lambda _: None)
            watch.wait_held(goal, 0.1)
            client.set_parameters('/simulated_arm', {'paused': True})
            try:
                one.timeout = 2.0
                with pytest.raises(NoAnswerError, match='for 2 s'):
                    watch.wait_held(goal, 1e9)
            finally:
                client.set_parameters('/simulated_arm', {'paused': False})


class SlowClient(DynamicsClient):
    """It receives 50 messages a second: in lock-step, references of a second wait for it."""

    def on_turn(self) -> None:
        time.sleep(0.02)


def test_a_reference_from_before_the_goal_is_not_its_end():
    arm = load_arm(default_arm_urdf())
    with SlowClient('dynamics', TIMEOUT) as one:
        watch = ArmWatch(one, arm)
        with watch.following(), goal_publication(one, arm.joint_names) as publish:
            watch.wait_ready()
            for goal in np.array(watch.measured()) + np.array([[0.1], [0.0], [0.1], [0.0]]):
                watch.move(Move(goal, 0.5, 0.0), publish, lambda _: None)
                assert watch.is_at(goal.tolist(), watch.reference[1])


@pytest.mark.soak
def test_a_joint_that_does_not_arrive_is_an_error(request_of, client):
    request = request_of(settings=FAST._replace(tolerance=1e-7))
    with pytest.raises(ToolError) as raised:
        record_holds(request)
    reason, *notes = str(raised.value).splitlines()
    assert re.fullmatch(
        r'joint\d rests at .* from its goal .*, expected at most 1e-07 \(--tolerance\)', reason)
    assert notes == [STOPPED, f'Recorded 0 of 8 holds: {request.outputs[0]}']
    wait_for_stop(client)


def test_an_interrupt_stops_the_arm_and_keeps_the_recording(request_of, client, capsys, tmp_path):
    during: list[str] = []

    def interrupt() -> None:
        client.wait_for(JointState, '/dynamics/reference', lambda state: any(state.velocity))
        during.append(client.get_parameter('/dynamics', 'friction_compensation'))
        os.kill(os.getpid(), signal.SIGTERM)

    bag, poses = tmp_path / 'bag', request_of().choice.file
    with meanwhile(interrupt):
        assert calibrate(poses, bag, tmp_path / 'calibrated.yaml', '--velocity', '0.002') == 130
    wait_for_stop(client)
    assert during == ['none']  # it pushes joints at rest, and friction would not cancel
    assert client.get_parameter('/dynamics', 'friction_compensation') == 'reference'
    assert capsys.readouterr().err.splitlines()[-3:] == [
        STOPPED, f'Recorded 0 of 8 holds: {bag}', 'calibrate_gravity: interrupted']
    assert len(recorded(bag).times) > 0
    assert not (tmp_path / 'calibrated.yaml').exists()


def test_an_interrupt_keeps_the_compensation_of_the_weight(
    request_of, client, monkeypatch, capsys, tmp_path,
):
    file = tmp_path / 'one.yaml'
    file.write_text('poses: [{joint1: 0.5, joint2: 0.4}]', encoding='utf-8')
    first, second = bags = [tmp_path / 'bag', tmp_path / 'bag-with-weight']
    monkeypatch.setattr(sys, 'stdin', Operator(  # attaches the weight, and does not remove it
        lambda: None, lambda: os.kill(os.getpid(), signal.SIGTERM)))
    with pytest.raises(KeyboardInterrupt):
        record_holds(request_of(outputs=bags, choice=PoseChoice(file, least=1), weight=WEIGHT))
    try:
        wait_for_status(client, 'payload', "1.5 kg on 'link2'")
    finally:  # removes all payloads
        set_payload(client, '/dynamics')
    assert capsys.readouterr().err.splitlines()[-4:] == [
        f'Recorded 2 of 2 holds: {first}', f'Recorded 2 of 2 holds: {second}',
        "The node still compensates 1.5 kg on 'link2', because the weight is attached. Remove the "
        'weight,',
        'then end the compensation with: ros2 dynamics payload link2 0 --transition 3 --node '
        '/dynamics']
