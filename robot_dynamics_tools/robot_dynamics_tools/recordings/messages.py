# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Many messages of one kind at once, by the library `rosbags`; those written are plain CDR.

Joint states are grouped by joint names: messages of one publisher have the same names and fields,
so that their numbers stack into arrays.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics_tools.recordings.topics import common_types, DYNAMICS_TERMS, JOINT_STATE

FIELDS = ('position', 'velocity', 'effort')
_TERMS = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')


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
