# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states with velocities of another number than their names: those of a gripper lack one."""

import array

import pytest
from rclpy.serialization import serialize_message
from robot_dynamics.ros.middleware.cdr_templates import JointStateDecoder
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from sensor_msgs.msg import JointState


@pytest.mark.parametrize('velocity', [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0]])
def test_the_positions_are_used_and_all_velocities_are_missing(velocity):
    reader, decoder = JointStateReader(('a', 'b')), JointStateDecoder()
    message = JointState(name=['a', 'b', 'claw'], position=array.array('d', [0.1, 0.2, 0.3]),
                         velocity=array.array('d', velocity))
    for _ in range(3):  # also once the layout is known
        q, v = reader.read(decoder.decode(serialize_message(message)))
        assert q.tolist() == [0.1, 0.2]
        assert v is None
    message.velocity = array.array('d', [1.0, 2.0, 3.0])
    q, v = reader.read(decoder.decode(serialize_message(message)))
    assert v.tolist() == [1.0, 2.0]
