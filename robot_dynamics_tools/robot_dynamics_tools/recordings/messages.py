# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of recordings, decoded and written by the library `rosbags`, as plain CDR."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics_tools.recordings.topics import common_types, JOINT_STATE

FIELDS = ('position', 'velocity', 'effort')


class RecordedState(NamedTuple):
    """
    One message with n joints: its index among all messages, and its header stamp.

    `values` has an array (n,) by field, for the fields with one value for each joint.
    """

    row: int
    joint_names: tuple[str, ...]
    stamp_ns: int
    values: dict[str, FloatArray]


def decode_joint_states(messages: Sequence[bytes]) -> tuple[tuple[RecordedState, ...], int]:
    """
    Return the serialized messages of sensor_msgs/msg/JointState, and how many cannot be read.

    Raises MissingDependencyError without `rosbags`.
    """
    decode = common_types().deserialize_cdr
    serde_error = optional('rosbags.serde', 'a recording').SerdeError
    states = []
    for row, data in enumerate(messages):
        try:
            message = decode(data, JOINT_STATE)
        except serde_error:
            continue
        names, stamp = tuple(message.name), message.header.stamp
        values = {field: getattr(message, field) for field in FIELDS}
        states.append(RecordedState(
            row, names, stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec,
            {field: v for field, v in values.items() if len(names) == len(v) > 0}))
    return tuple(states), len(messages) - len(states)


def joint_state_messages(
    stamps_ns: IntArray, joint_names: Sequence[str], position: FloatArray | None = None,
    velocity: FloatArray | None = None, effort: FloatArray | None = None,
) -> list[bytes]:
    """Return m messages of sensor_msgs/msg/JointState; arrays are (m, n), or None for no field."""
    nothing = np.empty((len(stamps_ns), 0))
    arrays = (nothing if values is None else values for values in (position, velocity, effort))
    return stamped_messages(
        JOINT_STATE, stamps_ns, dict(zip(FIELDS, arrays)), name=list(joint_names))


def stamped_messages(
    message_type: str, stamps_ns: IntArray, columns: Mapping[str, FloatArray], **fields: object,
) -> list[bytes]:
    """Return m messages with a header; `columns` (m, …) differ in each, `fields` do not."""
    types, messages = common_types(), []
    header, time = (types.types[name] for name in (
        'std_msgs/msg/Header', 'builtin_interfaces/msg/Time'))
    for stamp, *values in zip(stamps_ns.tolist(), *columns.values(), strict=True):
        stamped = header(stamp=time(*divmod(stamp, NANOSECONDS_PER_SECOND)), frame_id='')
        message = types.types[message_type](header=stamped, **fields, **dict(zip(columns, values)))
        messages.append(bytes(types.serialize_cdr(message, message_type, little_endian=True)))
    return messages
