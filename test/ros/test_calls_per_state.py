# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Calls and modules of this package that one joint state passes, and the messages it serializes.

Each 'call' event of `sys.setprofile` in a function of the package counts as one call. There is
also one for a property, a lambda, a comprehension, and for each start or resumption of a
generator. A module is a file of the package. The tests count from the call of
`MessageLoop._deliver` to its return, while the node follows a trajectory and only `effort_command`
has a subscriber.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
import statistics
import struct
import sys
import time
from typing import Any

from bounded_waits import Collector, wait_until
import numpy as np
from own_process import own_process
import pytest
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
import robot_dynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.middleware.cdr_templates import MessageTemplate
from ros_harness import RosClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

MOST_CALLS, MOST_MODULES = 35, 12
JOINTS = 7
NAMES = [f'joint{i + 1}' for i in range(JOINTS)]
PERIOD = 2_000_000
"""[ns] from one stamp to the next."""
WARM_UP, STATES = 600, 100
PACKAGE = f'{Path(robot_dynamics.__file__).parent}/'
ONES = [1.0] * JOINTS
URDF = planar_arm_urdf(ONES, ONES, [0.5] * JOINTS, [0.1] * JOINTS)


class FollowingNode:
    """A node that follows a trajectory, and whose joint states come from this thread."""

    def __init__(self, context: Any, namespace: str) -> None:
        self.namespace = namespace
        self.node = DynamicsNode(context=context, namespace=namespace, parameter_overrides=[
            Parameter(name, value=value) for name, value in {
                'robot_description': URDF, 'effort_check': False, 'state_timeout': 10.0,
                'state_max_age': 60.0}.items()])  # the stamps advance by PERIOD in any case
        self._stamp = time.time_ns()
        self._data = bytearray(serialize_message(
            JointState(name=NAMES, position=[0.1] * JOINTS, velocity=[0.0] * JOINTS)))
        self._take_states(20)  # a trajectory needs the position of the arm
        self._follow()
        self._take_states(WARM_UP)

    def next_state(self) -> bytes:
        """Return a joint state, PERIOD after the last one."""
        self._stamp += PERIOD
        self._data[4:12] = struct.pack('<iI', *divmod(self._stamp, 1_000_000_000))
        return bytes(self._data)

    def deliver(self, state: bytes) -> None:
        """Let the node answer a joint state in this thread."""
        self.node._loop._deliver(state)

    def _take_states(self, count: int) -> None:
        with np.errstate(over='ignore', invalid='ignore'):  # as in the thread of the loop
            for _ in range(count):
                self.deliver(self.next_state())

    def _follow(self) -> None:
        """Follow a trajectory that does not end."""
        message = JointTrajectory(joint_names=NAMES)
        for seconds, position in ((1, 0.1), (100_000, 0.2)):
            point = JointTrajectoryPoint(
                positions=[position] * JOINTS, velocities=[0.0] * JOINTS,
                accelerations=[0.0] * JOINTS)
            point.time_from_start.sec = seconds
            message.points.append(point)
        self.node._trajectories.take(message)

    def calls_of_a_state(self) -> list[tuple[str, str]]:
        """Return module and function of each call that one joint state passes, in order."""
        state, calls = self.next_state(), list[tuple[str, str]]()

        def note(frame: Any, event: str, _: Any) -> None:
            file = frame.f_code.co_filename
            if event == 'call' and file.startswith(PACKAGE):
                name = getattr(frame.f_code, 'co_qualname', frame.f_code.co_name)  # Python 3.11
                calls.append((file.removeprefix(PACKAGE), name))

        with np.errstate(over='ignore', invalid='ignore'):
            sys.setprofile(note)
            try:
                self.deliver(state)
            finally:
                sys.setprofile(None)
        return calls

    def check_follows(self) -> None:
        """Check that no state was dropped and that the trajectory is followed."""
        counters = self.node._path.counters
        assert counters.following
        assert not counters.dropped


@pytest.fixture
def following(client: RosClient) -> Iterator[FollowingNode]:
    with own_process() as process, client.collect(
            JointState, f'{process.namespace}/effort_command') as commands:
        node = FollowingNode(process.context, process.namespace)
        try:
            deliver_until(node, commands)
            yield node
        finally:
            node.node.destroy_node()


def deliver_until(node: FollowingNode, received: Collector) -> None:
    """Let the node answer joint states until one of its messages arrives."""

    def is_answered() -> bool:
        node.deliver(node.next_state())
        return bool(received.messages)

    wait_until(is_answered, 'a message of the node')


def listing(calls: list[tuple[str, str]]) -> str:
    """Return the functions with their numbers of calls, by module, in the order of the calls."""
    modules: dict[str, Counter[str]] = {}
    for file, name in calls:
        modules.setdefault(file, Counter())[name] += 1
    return '\n'.join(
        f'{file}: {functions.total()}\n' + '\n'.join(
            f'    {count} {name}' for name, count in functions.items())
        for file, functions in modules.items())


def test_a_state_passes_few_calls_and_modules(following: FollowingNode) -> None:
    states = [following.calls_of_a_state() for _ in range(STATES)]
    following.check_follows()
    typical = statistics.median_low(len(calls) for calls in states)
    calls = next(calls for calls in states if len(calls) == typical)
    modules = {file for file, _ in calls}
    words = (f'{len(calls)} calls in {len(modules)} modules, expected at most {MOST_CALLS} in '
             f'{MOST_MODULES}:\n{listing(calls)}')
    assert len(calls) <= MOST_CALLS, words
    assert len(modules) <= MOST_MODULES, words


# ------------------------------------------------------------------ messages without subscribers

@pytest.fixture
def filled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list of the functions that fill a template, one entry per message."""
    callers, original = list[str](), MessageTemplate.filled

    def noting(template: MessageTemplate, *arguments: Any) -> bytes:
        code = sys._getframe(1).f_code
        callers.append(f'{code.co_filename.removeprefix(PACKAGE)}: {code.co_name}')
        return original(template, *arguments)

    monkeypatch.setattr(MessageTemplate, 'filled', noting)
    return callers


def test_without_subscribers_only_the_command_is_serialized(
    following: FollowingNode, filled: list[str],
) -> None:
    following.deliver(following.next_state())
    following.check_follows()
    assert len(filled) == 1, filled


@pytest.mark.parametrize('topic', ['gravity_compensation', 'computed_torque'])
def test_an_effort_with_a_subscriber_is_serialized(
    client: RosClient, following: FollowingNode, filled: list[str], topic: str,
) -> None:
    with client.collect(JointState, f'{following.namespace}/dynamics/{topic}') as received:
        deliver_until(following, received)
        filled.clear()
        following.deliver(following.next_state())
        following.check_follows()
        assert len(filled) == 2, filled  # the command, and this effort
        assert len(received.messages[0].effort) == JOINTS
