# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of a recording, their message types, and the QoS under which they are written."""

import functools
from typing import Any, NamedTuple

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError

ROBOT_DESCRIPTION = '/robot_description'
JOINT_STATE = 'sensor_msgs/msg/JointState'
DYNAMICS_TERMS = 'robot_dynamics_interfaces/msg/DynamicsTerms'
DYNAMICS_TERMS_TEXT = """std_msgs/Header header
string[] joint_names
float64[] inertial
float64[] coriolis
float64[] gravity
float64[] friction
float64[] external
float64[] effort
float64 kinetic_energy
float64 potential_energy
"""
"""The definition of the type, for reading and writing recordings where it is not installed."""


class TopicQos(NamedTuple):
    """The QoS that a publisher offers, as far as a player has to offer it again."""

    depth: int = 1
    reliable: bool = True
    transient_local: bool = False


class RecordedTopic(NamedTuple):
    """A topic of a recording; `message_type` is for example 'sensor_msgs/msg/JointState'."""

    name: str
    message_type: str
    message_count: int


@functools.cache
def common_types() -> Any:
    """
    Return the typestore with the common packages of ROS 2 Jazzy, and DynamicsTerms.

    The definitions in a recording are not used: rosbags would execute code that it generates from
    them.
    """
    typesys = optional('rosbags.typesys', 'a recording')
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    types.register(typesys.get_types_from_msg(DYNAMICS_TERMS_TEXT, DYNAMICS_TERMS))
    return types


def check_type(topic: str, message_type: str) -> None:
    """Raise RecordingError if messages of this type cannot be decoded."""
    if message_type not in common_types().fielddefs:
        raise RecordingError(
            f'topic {topic!r} has type {message_type!r}, expected a type of the common packages '
            'of ROS 2 Jazzy, or DynamicsTerms')


def qos_to_rosbags(qos: TopicQos) -> Any:
    """Return the QoS as the type Qos of the library rosbags."""
    interfaces = optional('rosbags.interfaces', 'a recording')
    forever = interfaces.QosTime(9223372036, 854775807)
    return interfaces.Qos(
        history=interfaces.QosHistory.KEEP_LAST,
        depth=qos.depth,
        reliability=(interfaces.QosReliability.RELIABLE if qos.reliable
                     else interfaces.QosReliability.BEST_EFFORT),
        durability=(interfaces.QosDurability.TRANSIENT_LOCAL if qos.transient_local
                    else interfaces.QosDurability.VOLATILE),
        deadline=forever, lifespan=forever,
        liveliness=interfaces.QosLiveliness.AUTOMATIC, liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False)
