# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states of arms, grippers and halves of arms on one topic, and of another robot."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
import random
import re
import time
from typing import Any

from fault_bench import stamp_of
from fault_table import fault, fault_cases
import numpy as np
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import Collector, DYNAMICS, has_stamp, NodeProcess, RosClient, TIMEOUT
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

NAMES = ('joint1', 'joint2')
Q = [0.4, -0.3]
HOLD = default_dynamics().gravity(Q)
SHARED, OTHER = 'Joint states from several publishers', 'Joint states of another robot'
NOTHING = 'no command; one error names these joints and `robot_description_file`'
STATES = 100
REPEATED = ('arm first', 2), ('gripper first', 2), ('any', 1)
"""Orders of messages and numbers of arms that only soak tests have."""
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
            DYNAMICS, {'robot_description': arm_named(prefix)}, namespace=namespace,
            remaps={'joint_states': '/shared/joint_states'}))
        self.efforts: Collector = stack.enter_context(
            client.collect(JointState, f'{namespace}/effort_command'))
        self.efforts.wait_matched()


@contextmanager
def arms(client: RosClient, count: int) -> Iterator[list[Arm]]:
    """Run `count` nodes, each for one arm; the arms share one topic of joint states."""
    with ExitStack() as stack:
        yield [Arm(stack, client, f'/sources{i}', f'arm{i}_') for i in range(count)]


def wait_first_answers(publishers: Sequence[Any], nodes: Sequence[Arm]) -> None:
    """Publish states until each arm has answered one; each publisher is for one arm."""
    deadline = time.monotonic() + TIMEOUT
    for k in range(10**6):
        assert time.monotonic() < deadline, f'{TIMEOUT:g} s passed without an answer'
        stamp = 500_000_000 + k * 1_000_000
        for arm in nodes:
            if len(publishers) == 1:
                publishers[0].publish(message(stamp, NAMES, Q, arm.prefix))
            else:
                for publisher, name, q in zip(publishers, NAMES, Q):
                    publisher.publish(message(stamp, [name], [q], arm.prefix))
        if all(arm.efforts.find(lambda _: True, 0.05) for arm in nodes):
            break
    time.sleep(0.2)
    for arm in nodes:
        arm.efforts.clear()


@pytest.mark.parametrize(('order', 'count'), [
    pytest.param(order, count, marks=(
        *((pytest.mark.soak,) if (order, count) in REPEATED else ()), fault(
            SHARED, f'a gripper at the same rate as {("one arm", "two arms")[count - 1]}, {words}',
            'at least 99 % of the states of each arm are answered')))
    for count in (1, 2)
    for order, words in (('arm first', 'after the arm states'), (
        'gripper first', 'before the arm states'), ('any', 'in any order'))])
def test_a_gripper_costs_no_answer(client, count, order):
    """Messages of the gripper have the same rate, directly before or after those of an arm."""
    rng = random.Random(0)
    with arms(client, count) as nodes:
        publisher = client.publisher(JointState, '/shared/joint_states', subscribers=count)
        gripper = client.publisher(JointState, '/shared/joint_states', subscribers=count)
        wait_first_answers([publisher], nodes)
        answered = 0
        for k in range(1, STATES + 1):
            stamp = 1_000_000_000 + k * PERIOD
            sent = [(publisher, message(stamp, NAMES, Q, arm.prefix)) for arm in nodes]
            sent.append((gripper, message(stamp, ['finger'], [0.01])))
            if order == 'any':
                rng.shuffle(sent)
            for where, state in sent if order != 'gripper first' else reversed(sent):
                where.publish(state)
            for arm in nodes:
                found = arm.efforts.find(has_stamp(sent[0][1].header.stamp), 5.0)
                if found is not None:
                    answered += 1
                    assert found.effort == pytest.approx(HOLD, abs=1e-6)
                arm.efforts.clear()
        assert answered >= 0.99 * count * STATES


@pytest.mark.parametrize('phase', [
    pytest.param(phase, marks=fault(
        SHARED, f'the joints of an arm in two messages, {phase:g} periods apart',
        'one answer per period, with the newest stamp'))
    for phase in (0.0, 0.3, 0.8)])
def test_an_arm_in_two_messages_is_answered(client, phase):
    with arms(client, 1) as (arm,):
        halves = [client.publisher(JointState, '/shared/joint_states') for _ in NAMES]
        wait_first_answers(halves, [arm])
        answered = 0
        for k in range(1, STATES + 1):
            stamps = [1_000_000_000 + k * PERIOD, 1_000_000_000 + round((k + phase) * PERIOD)]
            for half, stamp, name, q in zip(halves, stamps, NAMES, Q):
                half.publish(message(stamp, [name], [q], arm.prefix))
                time.sleep(0.001)
            if arm.efforts.find(lambda found: found.effort == pytest.approx(
                    HOLD, abs=1e-6), 5.0 if k > 1 else 0.1) is not None:
                answered += 1
            arm.efforts.clear()
        assert answered >= 0.97 * STATES


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


@fault_cases('names', OTHER, 'no description, and joint states of {}', NOTHING, (
    ('`joint1` to `joint7`', [f'joint{i}' for i in range(1, 8)]),
    ('`joint1`, `joint2` and `gripper`', [*NAMES, 'gripper']),
    ('`shoulder` and `elbow`', ['shoulder', 'elbow'])))
def test_the_embedded_arm_is_not_commanded_for_another_robot(client, names):
    with ExitStack() as stack:
        node = stack.enter_context(NodeProcess(DYNAMICS, namespace='/other'))
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
        errors = [line for line in node.log.splitlines() if 'Nothing is published' in line]
        assert len(errors) == 1


def test_the_embedded_arm_is_commanded_by_states_of_its_joints_alone(client):
    with NodeProcess(DYNAMICS, namespace='/own') as node, \
            client.collect(JointState, '/own/effort_command') as efforts:
        efforts.wait_matched()
        send_until(client, '/own', NAMES, lambda: bool(efforts.messages))
        assert np.abs(efforts.wait_for().effort).max() > 1.0
        assert 'Nothing is published' not in node.log


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


def test_a_description_on_its_topic_ends_the_refusal(client):
    names = [f'left_{name}' for name in NAMES]
    with NodeProcess(DYNAMICS, namespace='/late') as node, \
            client.collect(JointState, '/late/effort_command') as efforts:
        efforts.wait_matched()
        send_until(client, '/late', names, lambda: 'Nothing is published' in node.log)
        with client.describing('/late') as publish:
            publish(arm_named('left_'))
            node.wait_for_log(re.escape(f'joints {names}'))
            send_until(client, '/late', names, lambda: bool(efforts.messages))
