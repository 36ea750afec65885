# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics record`: topics of the node in a recording, a directory of rosbag2."""

from argparse import Namespace
from collections.abc import Sequence
from datetime import datetime
import importlib
import math
from pathlib import Path
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.validation import check_scalar
from robot_dynamics_interfaces.msg import DynamicsTerms
from robot_dynamics_tools.recorder import Recorder, TopicSpec, write_description
from robot_dynamics_tools.recordings.interrupts import interrupted_by_sigterm
from robot_dynamics_tools.recordings.topics import check_type, TopicQos
from robot_dynamics_tools.recordings.writer import prepare_recording, RecordingWriter
from robot_dynamics_tools.reporting.text_table import text_table
from robot_dynamics_tools.ros2_dynamics.answers import Answer
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from sensor_msgs.msg import JointState

DISCOVERY_TIME = 1.0
"""[s] within which publishers of the topics are discovered."""
TOPICS = {
    'joint_states': JointState, 'effort_command': JointState, '~/terms': DynamicsTerms,
    '~/computed_torque': JointState, '~/gravity_compensation': JointState,
    '~/reference': JointState, '~/payload': InertiaStamped, '/diagnostics': DiagnosticArray}
"""Topics that are recorded by default."""


def answer_record(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Record until Ctrl-C, SIGTERM or for a time; return the numbers of messages."""
    seconds = None if arguments.duration is None else check_scalar(
        '--duration', arguments.duration, 0.0, exclusive_minimum=True)
    directory = arguments.output or Path(f'recording-{datetime.now():%Y%m%d-%H%M%S}')
    prepare_recording(directory, '--output', arguments.force)
    specs = topic_specs(client, arguments.topics)
    urdf = _description(client)
    with interrupted_by_sigterm(), RecordingWriter(directory) as writer:
        if urdf is not None:
            write_description(writer, client.resolve('robot_description'), urdf, time.time_ns())
        client.recorder = recorder = Recorder(client.node, writer, specs)
        topics = 'topic' if len(specs) == 1 else 'topics'
        began = f'Recording {len(specs)} {topics} to {directory}; ' + (
            f'ends after {seconds:g} s.' if seconds else 'Ctrl-C ends.')
        try:
            print(began, file=sys.stderr, flush=True)
            client.wait(lambda: False, math.inf if seconds is None else seconds)
        except KeyboardInterrupt:
            pass
        finally:
            client.recorder = None
            recorder.close()
        # several publishers of a topic count their messages separately
        several = [name for name in recorder.counts if client.node.count_publishers(name) > 1]
    rows = [
        {'topic': name, 'recorded': count.recorded,
         'lost': None if name in several else count.lost}
        for name, count in recorder.counts.items()]
    recorded = sum(count.recorded for count in recorder.counts.values())
    lost = sum(count.lost for name, count in recorder.counts.items() if name not in several)
    text = text_table(['topic', 'recorded', 'lost'], [
        ['-' if cell is None else str(cell) for cell in row.values()] for row in rows],
        left_columns=1)
    if several:
        text += '\n-: several publishers, whose losses cannot be counted'
    return Answer(
        {'node': client.name, 'directory': str(directory), 'recorded': recorded, 'lost': lost,
         'topics': rows},
        f'{text}\n{directory}: {recorded} messages recorded, {lost} lost')


def _description(client: DynamicsClient) -> str | None:
    try:
        return client.description()
    except RobotDynamicsError as error:  # in a file on another computer
        print(f'The recording has no URDF: {" ".join(str(error).split())}', file=sys.stderr)
        return None


# ------------------------------------------------------------------------------ topics

def topic_specs(client: DynamicsClient, topics: Sequence[str]) -> list[TopicSpec]:
    """Return the topics with their types and QoS; raise InvalidInputError."""
    if topics:
        names = [client.resolve(topic) for topic in topics]
        types = [_published_type(client, name) for name in names]
    else:
        names = [client.joint_state_topic(), *map(client.resolve, list(TOPICS)[1:])]
        types = list(TOPICS.values())
        client.wait(lambda: all(map(client.node.count_publishers, names)), DISCOVERY_TIME)
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f'TOPIC has {name!r} twice, expected each topic once')
    return [TopicSpec(name, kind, qos=_qos(client, name)) for name, kind in zip(names, types)]


def _published_type(client: DynamicsClient, name: str) -> type:
    """Return the message class of a topic; raise InvalidInputError, RecordingError."""
    def kinds() -> list[str]:
        return list(dict(client.node.get_topic_names_and_types()).get(name, ()))

    if not client.wait(kinds):
        raise InvalidInputError(
            f'TOPIC is {name!r}, expected a topic that exists, such as '
            f'{client.joint_state_topic()}')
    if len(kinds()) > 1:
        raise InvalidInputError(
            f'TOPIC is {name!r} of the types {", ".join(kinds())}, expected one type')
    package, _, message = kinds()[0].split('/')
    check_type(name, kinds()[0])
    try:
        found: type = getattr(importlib.import_module(f'{package}.msg'), message)
    except (ImportError, AttributeError):
        raise InvalidInputError(
            f'TOPIC is {name!r} of type {kinds()[0]!r}, which is not installed here, expected an '
            'installed type') from None
    return found


def _qos(client: DynamicsClient, name: str) -> TopicQos:
    """Return the QoS that all publishers offer; the least without any."""
    offered = [one.qos_profile for one in client.node.get_publishers_info_by_topic(name)]
    return TopicQos(
        reliable=bool(offered) and all(
            one.reliability == ReliabilityPolicy.RELIABLE for one in offered),
        transient_local=bool(offered) and all(
            one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered))
