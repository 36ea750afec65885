# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states of arms, grippers and halves of arms on one topic, and of another robot."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
import re
import time
from typing import Any

from fault_bench import stamp_of
from fault_table import fault
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import Collector, DYNAMICS, LONG, NodeProcess, RosClient, TIMEOUT, UNHURRIED
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

NAMES = ('joint1', 'joint2')
Q = [0.4, -0.3]
HOLD = default_dynamics().gravity(Q)
SHARED, OTHER = 'Joint states from several publishers', 'Joint states of another robot'
NOTHING = 'no command; one error names these joints and `robot_description_file`'
STATES = 100
LOST = 5
"""Most states without an answer, which the middleware may lose."""
PERIOD = 10_000_000
"""[ns]"""


def arm_named(prefix: str) -> str:
    """Return the default arm with other names of its joints."""
    urdf = default_arm_urdf()
    for name in NAMES:
        urdf = urdf.replace(f'"{name}"', f'"{prefix}{name}"')
    return urdf


def message(
    stamp_ns: int, names: Sequence[str], q: Sequence[float], prefix: str = '',
) -> JointState:
    state = JointState(
        name=[prefix + name for name in names], position=list(q), velocity=[0.0] * len(q))
    state.header.stamp = stamp_of(stamp_ns)
    return state


class Arm:
    """A node for one arm on a topic shared with other publishers, and a collector of efforts."""

    def __init__(self, stack: ExitStack, client: RosClient, namespace: str, prefix: str) -> None:
        self.prefix = prefix
        stack.enter_context(NodeProcess(
            DYNAMICS, {**UNHURRIED, 'robot_description': arm_named(prefix)}, namespace=namespace,
            remaps={'joint_states': '/shared/joint_states'}))
        self.efforts: Collector = stack.enter_context(
            client.collect(JointState, f'{namespace}/effort_command'))
        self.efforts.wait_matched()


@pytest.fixture(scope='module')
def arms(client: RosClient) -> Iterator[list[Arm]]:
    """Run two nodes, each for one arm; the arms share one topic of joint states."""
    with ExitStack() as stack:
        yield [Arm(stack, client, f'/sources{i}', f'arm{i}_') for i in range(2)]


def is_held(effort: Any) -> bool:
    return bool(effort.effort == pytest.approx(HOLD, abs=1e-6))


def check_answered(arms: Sequence[Arm], publish: Callable[[int], Sequence[Any]]) -> None:
    """
    Publish states until each arm has answered `STATES` of them with g(q).

    `publish` sends the states of a period and returns the stamps of a valid answer. The first
    states may arrive before the subscriptions know their publishers.
    """
    done, lost, end = 0, 0, time.monotonic() + LONG
    for k in range(10**6):
        assert time.monotonic() < end, f'{done} of {STATES} states were answered in {LONG:g} s'
        stamps = publish(k)
        if all(arm.efforts.find(
                lambda m, stamps=stamps: m.header.stamp in stamps and is_held(m),
                5.0 if done else 0.2) for arm in arms):
            done += 1
        elif done:
            lost += 1
        for arm in arms:
            arm.efforts.clear()
        if done == STATES:
            break
    assert lost <= LOST


@fault(SHARED, 'a gripper at the same rate as two arms, before, between and after the arm states',
       'the states of each arm are answered')
def test_a_gripper_costs_no_answer(client, arms):
    publisher = client.publisher(JointState, '/shared/joint_states', subscribers=2)
    gripper = client.publisher(JointState, '/shared/joint_states', subscribers=2)

    def publish(k: int) -> Sequence[Any]:
        stamp = 1_000_000_000 + k * PERIOD
        sent = [(publisher, message(stamp, NAMES, Q, arm.prefix)) for arm in arms]
        sent.insert(k % 3, (gripper, message(stamp, ['finger'], [0.01])))
        for where, state in sent:
            where.publish(state)
        return [stamp_of(stamp)]

    check_answered(arms, publish)


@fault(SHARED, 'the joints of an arm in two messages, 0.3 periods apart',
       'one answer per period')
def test_an_arm_in_two_messages_is_answered(client, arms):
    halves = [client.publisher(JointState, '/shared/joint_states', subscribers=2) for _ in NAMES]

    def publish(k: int) -> Sequence[Any]:
        stamps = [100_000_000_000 + round((k + phase) * PERIOD) for phase in (0.0, 0.3)]
        for half, stamp, name, q in zip(halves, stamps, NAMES, Q):
            half.publish(message(stamp, [name], [q], arms[0].prefix))
        return list(map(stamp_of, stamps))

    check_answered(arms[:1], publish)


# --- the embedded arm ----------------------------------------------------------------------------

def send_until(
    client: RosClient, namespace: str, names: Sequence[str], condition: Callable[[], bool],
) -> None:
    """Publish states of these joints at 100 Hz, until one second after a condition is true."""
    publisher = client.publisher(JointState, f'{namespace}/joint_states')
    deadline = time.monotonic() + TIMEOUT
    end, k = deadline, 0
    while time.monotonic() < end:
        k += 1
        if end == deadline and condition():
            end = time.monotonic() + 1.0
        publisher.publish(message(1_000_000_000 + k * PERIOD, names, [0.1] * len(names)))
        time.sleep(0.01)
    assert end < deadline, f'{TIMEOUT:g} s passed before the condition was true'


@fault(OTHER, 'no description, and joint states of `joint1`, `joint2` and `gripper`', NOTHING)
def test_the_embedded_arm_is_not_commanded_for_another_robot(client):
    """Until its description arrives on the topic."""
    names, left = [*NAMES, 'gripper'], [f'left_{name}' for name in NAMES]
    with NodeProcess(DYNAMICS, namespace='/other') as node, ExitStack() as stack:
        node.wait_for_log('No robot_description was given: the embedded planar two-link arm')
        topics = [stack.enter_context(client.collect(JointState, f'/other/{topic}')) for topic in (
            'effort_command', 'dynamics/gravity_compensation')]
        for topic in topics:
            topic.wait_matched()
        send_until(client, '/other', names, lambda: 'Nothing is published' in node.log)
        line = node.wait_for_log('Nothing is published: the joint states contain')
        assert str(names) in line
        assert 'robot_description_file' in line
        assert [topic.messages for topic in topics] == [[], []]
        assert node.log.count('Nothing is published') == 1
        with client.describing('/other') as publish:
            publish(arm_named('left_'))
            node.wait_for_log(re.escape(f'joints {left}'))
            send_until(client, '/other', left, lambda: bool(topics[0].messages))


@fault(OTHER, 'no description, and `~/commands` is remapped',
       'no model; a warning names the topic and the missing description')
def test_remapped_commands_need_a_description(client):
    with NodeProcess(
            DYNAMICS, namespace='/bare', remaps={'~/commands': '/controller/commands'}) as node, \
            client.collect(JointState, '/bare/effort_command') as efforts:
        node.wait_for_log('~/commands is remapped to /controller/commands')
        efforts.wait_matched()
        send_until(client, '/bare', NAMES, lambda: True)
        assert efforts.messages == []
