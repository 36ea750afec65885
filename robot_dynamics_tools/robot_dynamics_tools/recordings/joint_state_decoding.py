# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint states decoded by the library `rosbags`, many messages at once, grouped by joint names.

Messages of one publisher have the same names and fields, so that their numbers stack into arrays.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics_tools.recordings.topics import common_types, JOINT_STATE

FIELDS = ('position', 'velocity', 'effort')


class JointStateBlock(NamedTuple):
    """
    A block of k messages with the same n joints and the same fields.

    `rows` (k,) are their indices among all messages, `stamps_ns` (k,) their header stamps. Each
    other field is (k, n), or None if the messages do not have one value for each joint.
    """

    rows: IntArray
    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None


def decode_joint_states(messages: Sequence[bytes]) -> tuple[tuple[JointStateBlock, ...], int]:
    """
    Return the serialized messages of sensor_msgs/msg/JointState, and how many cannot be read.

    Raises MissingDependencyError without `rosbags`.
    """
    decode = common_types().deserialize_cdr
    serde_error = optional('rosbags.serde', 'a recording').SerdeError
    groups: dict[tuple[tuple[str, ...], tuple[bool, ...]], list[tuple[int, int, list[Any]]]] = {}
    unreadable = 0
    for row, data in enumerate(messages):
        try:
            message = decode(data, JOINT_STATE)
        except serde_error:
            unreadable += 1
            continue
        names = tuple(message.name)
        values = [message.position, message.velocity, message.effort]
        is_whole = tuple(len(names) == len(numbers) > 0 for numbers in values)
        stamp = message.header.stamp
        stamp_ns = stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec
        groups.setdefault((names, is_whole), []).append((row, stamp_ns, values))
    return tuple(_block(*layout, group) for layout, group in groups.items()), unreadable


def _block(
    names: tuple[str, ...], is_whole: tuple[bool, ...], group: list[tuple[int, int, list[Any]]],
) -> JointStateBlock:
    rows, stamps, values = zip(*group)
    columns = [
        np.array(numbers, dtype=np.float64) if whole else None
        for whole, numbers in zip(is_whole, zip(*values))]
    return JointStateBlock(
        np.array(rows, dtype=np.intp), names, np.array(stamps, dtype=np.int64), *columns)
