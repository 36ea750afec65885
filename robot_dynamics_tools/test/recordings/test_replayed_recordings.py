# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings, made here and by rosbag2, replayed through the real node: bit-identical efforts."""

from collections.abc import Iterator
from pathlib import Path
import struct
import time

from builtin_interfaces.msg import Time
import numpy as np
import pytest
from recordings import KnownMotion, recording_path, recordings_of
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.recordings.reader import Recording
from ros_harness import DYNAMICS, KEEP_MANY, NodeProcess, RosClient, UNHURRIED
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

pytest.importorskip('rosbags')
NAMES = ['joint1', 'joint2']
COUNTS = {'made_mcap': len(KnownMotion().q), 'mcap': 1903}
"""Joint states of each recording."""
MOST = 300
"""Joint states of a recording that are replayed."""
STAMP = struct.Struct('<iI')
"""`header.stamp`, after four bytes of encapsulation."""


class Replay:
    """Publishes recorded joint states unchanged, and returns the answers of the node."""

    def __init__(self, client: RosClient, namespace: str) -> None:
        self._client = client
        self.answers = client.collect(
            JointState, f'{namespace}/dynamics/gravity_compensation', KEEP_MANY)
        self.answers.wait_matched()
        self._states = client.publisher(JointState, f'{namespace}/joint_states', 1)

    def answer(self, data: bytes) -> JointState:
        """Publish a serialized state until it is answered; return the answer."""
        stamp = STAMP.unpack_from(data, 4)
        self.answers.clear()
        return self._client.ask(
            self._states, data, self.answers,
            lambda m: (m.header.stamp.sec, m.header.stamp.nanosec) == stamp)


@pytest.fixture(scope='module')
def replay(client: RosClient) -> Iterator[Replay]:
    with NodeProcess(DYNAMICS, {**UNHURRIED, 'joints': NAMES}, namespace='/bag'):
        yield Replay(client, '/bag')


def states_of(path: Path) -> list[bytes]:
    """Return the serialized joint states of a recording."""
    with Recording(path) as recording:
        return [data for _, data in recording.raw_messages('/joint_states')]


@pytest.mark.parametrize('name', recordings_of(COUNTS))
def test_the_efforts_are_those_of_the_library_and_of_the_recording(replay, name, tmp_path):
    dynamics = ArmDynamics(load_arm(default_arm_urdf(), NAMES))
    path = recording_path(name, tmp_path)
    with Recording(path) as recording:
        positions = recording.joint_series('/joint_states').position
        recorded = recording.joint_series('/dynamics/gravity_compensation').effort
    states = states_of(path)
    assert len(states) == COUNTS[name]
    efforts = np.array([replay.answer(data).effort for data in states[:MOST]])
    assert np.array_equal(efforts, [dynamics.rigid_body.gravity(q) for q in positions[:MOST]])
    assert np.array_equal(efforts, recorded[:MOST])


@pytest.mark.parametrize('name', recordings_of(['sqlite3_zstd']))
def test_with_its_clock_a_replay_of_ten_minutes_ago_is_answered(client, name, tmp_path):
    """As `ros2 bag play --clock` publishes it, to a node with `use_sim_time`."""
    states = states_of(recording_path(name, tmp_path))[:100]
    shift = int(time.time()) - 600 - STAMP.unpack_from(states[0], 4)[0]
    with NodeProcess(
            DYNAMICS, {'use_sim_time': True}, namespace='/clocked',
            remaps={'/clock': '/clocked/clock'}) as node:
        replay, clock = Replay(client, '/clocked'), client.publisher(Clock, '/clocked/clock')
        for data in states:
            seconds, nanoseconds = STAMP.unpack_from(data, 4)
            stamp = Time(sec=seconds + shift, nanosec=nanoseconds)
            clock.publish(Clock(clock=stamp))
            replay.answer(data[:4] + STAMP.pack(stamp.sec, stamp.nanosec) + data[12:])
        assert 'Dropped a joint state' not in node.log
        assert 'ros2 bag play' not in node.log
