# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Bytes that are not a valid message, on every topic that the nodes subscribe to."""

from collections.abc import Callable, Iterable, Iterator
import struct
import time
from typing import Any

from damaged_bytes import cut_short, noise, with_lies, with_noise
from diagnostic_msgs.msg import DiagnosticStatus
from disturbances import wrench
from fault_bench import FaultBench, G, NAMES, NANOSECONDS, Q, V
from fault_stimuli import check_rate
from fault_table import fault
import numpy as np
import pytest
from raw_publisher import bytes_of, RawPublisher
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import NodeProcess, RosClient, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Damaged messages'
STATE = JointState(name=NAMES, position=Q, velocity=V)
GOAL = [Q[0] + 0.01, Q[1]]
REFERENCE = JointTrajectory(
    joint_names=NAMES, points=[JointTrajectoryPoint(positions=GOAL, velocities=V)])
DESCRIPTION = String(data='<robot name="none"><link name="base"/></robot>')
EFFORT = JointState(name=NAMES, effort=G)
WRENCH = wrench('tool0')
DAMAGE = (
    'truncated to every length, with wrong element counts up to 4 billion, with random bytes, or '
    'only random bytes')


def damaged(message: Any) -> list[bytes]:
    """Return damaged forms of a message; test_cdr_templates.py has more of them."""
    data = bytes_of(message)
    lies = list(with_lies(data))[::3]
    return [*cut_short(data, type(message)), *lies, *with_noise(data, 50), *noise(20)]


@pytest.fixture(scope='module')
def raw() -> Iterator[RawPublisher]:
    """Return a process that publishes arbitrary bytes."""
    with RawPublisher() as publisher:
        yield publisher


@pytest.fixture(scope='module')
def bench(client: RosClient, bench: FaultBench) -> FaultBench:
    """Return a node with a description: without one it rejects states of other joints."""
    with client.describing(bench.namespace) as publish:
        publish(default_arm_urdf())
        wait_until(lambda: bench.node.log.count("Model 'planar_arm'") == 2, 'the model')
    return bench


@pytest.fixture(scope='module')
def arm() -> Iterator[NodeProcess]:
    """Return a simulated arm."""
    with NodeProcess(SIMULATED_ARM, namespace='/faults_bytes_arm') as node:
        yield node


def now_stamped(data: bytes) -> bytes:
    """Return a message whose stamp is the current time."""
    return data[:4] + struct.pack('<iI', *divmod(time.time_ns(), NANOSECONDS)) + data[12:]


def send_until(
    raw: RawPublisher, topic: str, message_type: type, make: Callable[[], Iterable[bytes]],
    noticed: Callable[[], bool],
) -> int:
    """
    Publish the damaged messages repeatedly until a node reports one; return the number sent.

    A node that gets no processor time meanwhile reads only the newest message.
    """
    sent = 0

    def is_noticed() -> bool:
        nonlocal sent
        for data in make():
            raw.publish(topic, message_type, data)
            sent += 1
        return noticed()

    wait_until(is_noticed, f'a report of a damaged message on {topic}')
    return sent


@fault(GROUP, f'`joint_states`: truncated between valid ones; then only {DAMAGE}',
       'dropped and reported, or answered with a finite command; the valid ones are answered '
       'without a fault; commands resume')
def test_joint_states(bench, raw, seen):
    faults, memory_before = bench.known('command', 'faults: state_timeout'), bench.peak_memory()
    send_until(
        raw, f'{bench.namespace}/joint_states', JointState,
        lambda: cut_short(bytes_of(STATE), JointState),
        lambda: 'cannot be read, expected a serialized JointState' in bench.next_status(
            'joint states').message)
    assert all(message.effort == pytest.approx(G, abs=1e-6) for message in bench.efforts.messages)
    assert bench.figure('command', 'faults: state_timeout') == faults
    bench.driver.be_quiet()
    before = bench.figure('joint states', 'dropped: unreadable')
    sent = send_until(
        raw, f'{bench.namespace}/joint_states', JointState,
        lambda: map(now_stamped, damaged(STATE)),
        lambda: bench.figure('joint states', 'dropped: unreadable') > before)
    with bench.short_timeout():
        bench.wait_status('command', lambda status: status.level == DiagnosticStatus.ERROR)
    bench.check_efforts()
    bench.check_alive()
    unreadable = bench.known('joint states', 'dropped: unreadable') - before
    seen(f'{unreadable} of {sent} messages unreadable')
    assert bench.peak_memory() < memory_before + 100 * 2**20


@fault(GROUP, '`joint_states`: a joint name that is not valid UTF-8',
       'reported as incomplete, with the name of the missing joint; commands resume')
def test_a_name_that_is_not_utf_8(bench, raw):
    bench.driver.be_quiet()
    data = bytes_of(STATE).replace(b'joint1', b'\xff\xfe\xc0\x80t1')
    send_until(
        raw, f'{bench.namespace}/joint_states', JointState, lambda: [now_stamped(data)],
        lambda: "no samples of ['joint1']" in bench.next_status('joint states').message)
    bench.wait_state_timeout()


@fault(GROUP, f'`~/joint_trajectory`: {DAMAGE}',
       'rejected and reported, or followed within all limits')
def test_references(bench, raw, seen):
    before = bench.known('reference', 'refused')
    sent = send_until(
        raw, bench.name('joint_trajectory'), JointTrajectory, lambda: damaged(REFERENCE),
        lambda: bench.figure('reference', 'refused') > before)
    refused = bench.figure('reference', 'refused') - before
    seen(f'{refused} of {sent} rejected')
    check_rate(bench.efforts)
    bench.check_efforts()

    def is_held_again() -> bool:
        bench.set_point(Q)  # more than once: a damaged one may still arrive
        return np.allclose(bench.efforts.messages[-1].effort, bench.hold, atol=1e-5)

    wait_until(is_held_again, 'g(q)')


@fault(GROUP, f'`robot_description`: {DAMAGE}', 'rejected and reported; the active model stays')
def test_descriptions(bench, raw):
    before = bench.node.log.count('Kept the model in use')
    send_until(
        raw, f'{bench.namespace}/robot_description', String, lambda: damaged(DESCRIPTION),
        lambda: bench.node.log.count('Kept the model in use') > before)
    assert bench.status('model').message == 'planar_arm'


@fault(GROUP, f'both topics of `simulated_arm`: {DAMAGE}',
       'rejected and reported, or applied; the arm continues with finite states')
def test_topics_of_the_simulated_arm(client, arm, raw):
    for message, topic, refusal in (
            (EFFORT, 'effort_command', 'Rejected an effort'),
            (WRENCH, 'simulated_arm/external_wrench', 'Rejected a message of ~/external_wrench')):
        # Messages that are published before the arm discovers the publisher are lost.
        send_until(
            raw, f'/faults_bytes_arm/{topic}', type(message), lambda one=message: damaged(one),
            lambda words=refusal: words in arm.log)
    with client.collect(JointState, '/faults_bytes_arm/joint_states') as states:
        states.wait_matched()
        states.wait_for()
        assert client.call(Trigger, '/faults_bytes_arm/simulated_arm/reset').success
        states.wait_for(lambda message: list(message.position) == [0.0, 0.0])
        assert all(
            np.isfinite([*message.position, *message.velocity, *message.effort]).all()
            for message in states.messages)
    assert 'Traceback' not in arm.log
    assert 'internal error' not in arm.log
