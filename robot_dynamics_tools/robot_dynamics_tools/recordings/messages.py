# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of recordings, decoded and written by the library `rosbags`, as plain CDR."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics_tools.recordings.topics import common_types, JOINT_STATE

FIELDS = ('position', 'velocity', 'effort')


class RecordedState(NamedTuple):
    """
    One message with n joints: the time at which it was recorded, and its header stamp [ns].

    `values` has an array (n,) by field, for the fields with one value for each joint.
    """

    recorded_ns: int
    joint_names: tuple[str, ...]
    stamp_ns: int
    values: dict[str, FloatArray]

    @property
    def time_ns(self) -> int:
        """The stamp, or the time of the recording without one [ns]."""
        return self.stamp_ns or self.recorded_ns


def decode_joint_states(
    messages: Sequence[tuple[int, bytes]],
) -> tuple[tuple[RecordedState, ...], int]:
    """
    Return the messages of sensor_msgs/msg/JointState, and how many of them cannot be read.

    `messages` are times [ns] and bytes. Raises MissingDependencyError without `rosbags`.
    """
    decode = common_types().deserialize_cdr
    serde_error = optional('rosbags.serde', 'a recording').SerdeError
    states = []
    for time_ns, data in messages:
        with suppress(serde_error):
            states.append(recorded_state(time_ns, decode(data, JOINT_STATE)))
    return tuple(states), len(messages) - len(states)


def recorded_state(time_ns: int, message: Any) -> RecordedState:
    """Return a sensor_msgs/msg/JointState of `rosbags` or rclpy that was recorded at `time_ns`."""
    values = {field: np.asarray(getattr(message, field)) for field in FIELDS}
    return RecordedState(time_ns, tuple(message.name), stamp_ns(message.header), {
        field: each for field, each in values.items() if len(message.name) == len(each) > 0})


def stamp_ns(header: Any) -> int:
    """Return the nanoseconds of a header's stamp."""
    return int(header.stamp.sec) * NANOSECONDS_PER_SECOND + int(header.stamp.nanosec)


def joint_state_messages(
    stamps_ns: IntArray, joint_names: Sequence[str], position: FloatArray | None = None,
    velocity: FloatArray | None = None, effort: FloatArray | None = None,
) -> list[bytes]:
    """Return m messages of sensor_msgs/msg/JointState; arrays are (m, n), or None for no field."""
    nothing = np.empty((len(stamps_ns), 0))
    arrays = (nothing if values is None else np.ascontiguousarray(values)
              for values in (position, velocity, effort))
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
