# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of recordings, decoded and written by the library `rosbags`, as plain CDR."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics_tools.recordings.topics import common_types, DYNAMICS_TERMS, JOINT_STATE

FIELDS = ('position', 'velocity', 'effort')
_TERMS = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')


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
    m = len(stamps_ns)
    arrays = [_checked(np.empty((m, 0)) if values is None else values, m)
              for values in (position, velocity, effort)]
    return [
        _serialized(JOINT_STATE, header=header, name=list(joint_names),
                    **dict(zip(FIELDS, values)))
        for header, *values in zip(_headers(stamps_ns), *arrays)]


def dynamics_terms_messages(
    stamps_ns: IntArray, joint_names: Sequence[str], terms: Sequence[FloatArray],
    kinetic_energy: FloatArray, potential_energy: FloatArray,
) -> list[bytes]:
    """
    Return m messages of robot_dynamics_interfaces/msg/DynamicsTerms.

    `terms` are inertial, coriolis, gravity, friction, external and effort, each (m, n); energies
    are (m,) [J].
    """
    arrays = [_checked(values, len(stamps_ns)) for values in terms]
    return [
        _serialized(DYNAMICS_TERMS, header=header, joint_names=list(joint_names),
                    kinetic_energy=kinetic, potential_energy=potential,
                    **dict(zip(_TERMS, values)))
        for header, kinetic, potential, *values in zip(
            _headers(stamps_ns), kinetic_energy.tolist(), potential_energy.tolist(), *arrays)]


def _serialized(message_type: str, **fields: Any) -> bytes:
    message = common_types().types[message_type](**fields)
    return bytes(common_types().serialize_cdr(message, message_type, little_endian=True))


def _headers(stamps_ns: IntArray) -> Iterator[Any]:
    """Yield a std_msgs/Header without a frame for each stamp."""
    types = common_types().types
    for stamp_ns in stamps_ns.tolist():
        sec, nanosec = divmod(stamp_ns, NANOSECONDS_PER_SECOND)
        yield types['std_msgs/msg/Header'](
            stamp=types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec), frame_id='')


def _checked(values: FloatArray, m: int) -> FloatArray:
    if values.ndim != 2 or len(values) != m:
        raise InvalidInputError(
            f'values have the shape {values.shape}, expected ({m}, n), one row per stamp')
    return values
