# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""`calibrate_gravity --move` with real nodes: the motion, its end, the recordings, the weight."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import pty
import signal
import sys
import threading
import time
from typing import Any

from children import TIMEOUT
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.gravity_calibration.holds import find_holds, pair_holds
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.recordings.reader import Recording
from robot_dynamics.ros.conversions import payload_to_ros
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics.tools.gravity_motion.plan import MotionSettings
from robot_dynamics.tools.gravity_motion.poses import PoseChoice
from robot_dynamics.tools.gravity_motion.session import MotionRequest, record_holds
from robot_dynamics_interfaces.srv import SetPayload
from ros_harness import DYNAMICS, LATCHED, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POSES = 'poses: [{joint1: 0.9, joint2: 0.6}, {joint1: -0.9, joint2: 0.9}, ' \
        '{joint1: 0.4, joint2: -1.2}, {joint1: -0.5, joint2: -0.8}]'
WEIGHT = make_payload('link2', 1.5, (0.0, 0.0, 0.3))
FAST = MotionSettings(hold=1.5, step=2.0, velocity=2.0)
SLOW = FAST._replace(velocity=0.002)
COULOMB = 0.5
"""[N m]: dry friction of the simulated arm."""


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {'condition_references': True}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 100.0, 'lock_step': True, 'friction.coulomb': [COULOMB]})):
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
def in_motion(client: RosClient, act: Callable[[], Any]) -> Iterator[None]:
    """Call `act` in a thread when the reference of the node moves."""
    def wait() -> None:
        client.wait_for(JointState, '/dynamics/reference', lambda state: any(state.velocity))
        act()

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        yield
    finally:
        thread.join(TIMEOUT)


def terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def wait_for_stop(client: RosClient) -> None:
    """Wait until the node has ended the reference by ~/stop, and the arm is at rest."""
    client.wait_for(DiagnosticArray, '/diagnostics', lambda message: any(
        status.name == '/dynamics: reference'
        and status.message == 'ended early: ~/stop was called' for status in message.status))
    client.wait_for(
        JointState, '/joint_states', lambda state: max(map(abs, state.velocity)) < 1e-3)


def masses(client: RosClient) -> list[float]:
    """Return the mass that the node compensates; 0 without a payload."""
    message = client.wait_for(InertiaStamped, '/dynamics/payload', qos=LATCHED)
    return [message.inertia.m]


def load(client: RosClient, node: str, mass: float) -> None:
    payload = payload_to_ros(WEIGHT)
    payload.inertia.m = mass
    assert client.call(
        SetPayload, f'{node}/set_payload', SetPayload.Request(payload=payload)).success


@contextmanager
def standard_input(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Connect standard input to a terminal; yield a function that types."""
    leader, follower = pty.openpty()
    with os.fdopen(follower, encoding='utf-8') as stream:
        monkeypatch.setattr(sys, 'stdin', stream)
        try:
            yield lambda text: void(os.write(leader, text.encode()))
        finally:
            monkeypatch.undo()
            os.close(leader)


def void(_: object) -> None:
    """Ignore a result."""


# --- the whole sequence --------------------------------------------------------------------------

def test_the_recording_has_holds_from_both_sides(
    request_of: Callable[..., MotionRequest], capsys: pytest.CaptureFixture[str],
) -> None:
    request = request_of()
    assert record_holds(request)
    assert '/dynamics: 4 poses of planar_arm, in this order' in capsys.readouterr().out
    with Recording(request.outputs[0]) as recording:
        assert '<robot name="planar_arm"' in next(
            iter(recording.messages('/robot_description')))[1].data
        assert {topic.name for topic in recording.topics} == {
            '/robot_description', '/joint_states', '/effort_command', '/dynamics/reference',
            '/dynamics/payload'}
        series = recording.joint_series('/joint_states')
    kinds = ('revolute', 'revolute')
    holds = pair_holds(find_holds(series, kinds), kinds)
    assert holds.is_paired.sum() == 8
    dynamics = ArmDynamics(load_arm(default_arm_urdf()))
    gravity = np.array([dynamics.gravity(hold.position) for hold in holds.holds])
    one_sided = np.array([hold.effort for hold in holds.holds]) - gravity
    np.testing.assert_allclose(holds.effort, holds.mean(gravity), atol=0.02)
    assert np.abs(one_sided).max() > 0.2  # dry friction, which the mean of both sides cancels


# --- confirmation and rejections -----------------------------------------------------------------

def test_no_motion_without_a_confirmation(
    request_of: Callable[..., MotionRequest], client: RosClient,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    before = client.wait_for(JointState, '/joint_states')
    request = request_of(is_confirmed=False)
    with Path(os.devnull).open(encoding='utf-8') as nothing:
        monkeypatch.setattr(sys, 'stdin', nothing)
        with pytest.raises(InvalidInputError, match='no terminal, expected one .* or --yes'):
            record_holds(request)
    with standard_input(monkeypatch) as type_text:
        type_text('y\n')
        with pytest.raises(ToolError, match='not confirmed; the arm has not moved'):
            record_holds(request)
    assert capsys.readouterr().out.endswith('Type yes and press Enter to move the arm: ')
    assert not record_holds(request._replace(previews=True))
    assert not request.outputs[0].exists()
    after = client.wait_for(JointState, '/joint_states')
    np.testing.assert_allclose(after.position, before.position, atol=1e-6)


def test_a_node_that_another_client_uses_is_rejected(
    request_of: Callable[..., MotionRequest], client: RosClient,
) -> None:
    publisher = client.publisher(JointTrajectory, '/dynamics/joint_trajectory')
    goal = JointTrajectory(joint_names=['joint1', 'joint2'], points=[
        JointTrajectoryPoint(positions=[0.1, 0.1])])
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


def test_a_node_that_does_not_follow_references_is_rejected(
    request_of: Callable[..., MotionRequest], client: RosClient,
) -> None:
    client.set_parameters('/dynamics', {'command': 'gravity_compensation'})
    try:
        with pytest.raises(InvalidInputError) as raised:
            record_holds(request_of())
    finally:
        client.set_parameters('/dynamics', {'command': 'computed_torque'})
    assert "parameter command of /dynamics is 'gravity_compensation', expected" in str(
        raised.value)


# --- interrupts and faults -----------------------------------------------------------------------

def test_an_interrupt_stops_the_arm_and_keeps_the_recording(
    request_of: Callable[..., MotionRequest], client: RosClient,
    capsys: pytest.CaptureFixture[str],
) -> None:
    request = request_of(settings=SLOW)
    with in_motion(client, terminate), pytest.raises(KeyboardInterrupt):
        record_holds(request)
    wait_for_stop(client)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-2:] == [
        'Called ~/stop: stopping along the reference, then holding the position',
        f'Recorded 0 of 8 holds: {request.outputs[0]}']
    with Recording(request.outputs[0]) as recording:
        assert not recording.losses
        assert len(recording.joint_series('/joint_states').times)


def test_states_that_stop_end_the_calibration(
    request_of: Callable[..., MotionRequest], client: RosClient,
) -> None:
    def pause(paused: bool) -> None:
        client.set_parameters('/simulated_arm', {'paused': paused})

    request = request_of(settings=SLOW, timeout=4.0)
    try:
        with in_motion(client, lambda: pause(True)), pytest.raises(ToolError) as raised:
            record_holds(request)
    finally:
        pause(False)
    assert str(raised.value).splitlines() == [
        'no joint state with a new stamp on /joint_states for 4 s',
        'Called ~/stop: stopping along the reference, then holding the position',
        f'Recorded 0 of 8 holds: {request.outputs[0]}']
    wait_for_stop(client)


def test_a_joint_that_does_not_arrive(request_of: Callable[..., MotionRequest]) -> None:
    request = request_of(settings=FAST._replace(tolerance=1e-7))
    with pytest.raises(ToolError) as raised:
        record_holds(request)
    first = str(raised.value).splitlines()[0]
    assert first.startswith('joint1 rests at ') or first.startswith('joint2 rests at ')
    assert first.endswith('expected at most 1e-07 (--tolerance)')


# --- the weight ----------------------------------------------------------------------------------

def wait_for_output(capsys: pytest.CaptureFixture[str], text: str) -> None:
    """Wait until the output contains a text, in another thread."""
    seen, deadline = '', time.monotonic() + TIMEOUT
    while text not in seen:
        seen += capsys.readouterr().out
        assert time.monotonic() < deadline, f'no {text!r} in {seen!r}'
        time.sleep(0.02)
