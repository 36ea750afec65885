# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Reader of recordings of rosbag2 on disk, without ROS, based on the library `rosbags`.

Supported are directories of rosbag2 and single files, sqlite3 and MCAP, compressed as a whole, per
message or per chunk, split over several files, with or without metadata.yaml. A damaged file is an
error. `writer` writes recordings.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.bag_files import METADATA, recording_files
from robot_dynamics_tools.recordings.joint_series import JointSeries, RecordedJointStates
from robot_dynamics_tools.recordings.messages import decode_joint_states, stamp_ns
from robot_dynamics_tools.recordings.storage import StoredFile
from robot_dynamics_tools.recordings.topics import (
    check_type,
    common_types,
    JOINT_STATE,
    RecordedTopic,
    ROBOT_DESCRIPTION,
)


class Recording(AbstractContextManager['Recording']):
    """
    A recording that is open for reading; for use in `with`.

    `notes` lists anomalies that were found so far, such as missing files.
    """

    def __init__(self, path: Path) -> None:
        """
        Open a directory of rosbag2, or one file of MCAP or sqlite3.

        Raises RecordingError if there is no recording or if a file is damaged,
        MissingDependencyError without `rosbags`.
        """
        self.path = path
        about = recording_files(path)
        self.notes: list[str] = list(about.notes)
        self._stated = about.stated
        with ExitStack() as stack:
            try:
                scratch = Path(stack.enter_context(TemporaryDirectory()))
                self._files = [
                    stack.enter_context(closing(StoredFile(file, scratch)))
                    for file in about.paths]
            except OSError as error:
                raise self._unreadable(str(error)) from error
            if not any(stored.topics for stored in self._files):
                raise self._unreadable('no topics')
            self._stack = stack.pop_all()
        self.notes += [note for stored in self._files for note in stored.notes]

    def _unreadable(self, reason: str) -> RecordingError:
        return RecordingError(f'recording {str(self.path)!r} cannot be read: {reason}')

    @property
    def topics(self) -> tuple[RecordedTopic, ...]:
        """All topics, by name."""
        found: dict[str, RecordedTopic] = {}
        for stored in self._files:
            for topic in stored.topics:
                before = found.get(topic.name)
                found[topic.name] = topic if before is None else before._replace(
                    message_count=before.message_count + topic.message_count)
        return tuple(found[name] for name in sorted(found))

    def topic(self, name: str) -> RecordedTopic:
        """Return the topic of this name; raise RecordingError, which lists the existing topics."""
        for topic in self.topics:
            if topic.name == name:
                return topic
        raise RecordingError(
            f'recording {str(self.path)!r} has no topic {name!r}, expected one of '
            f'{[topic.name for topic in self.topics]}')

    def raw_messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yield time [ns] and bytes (CDR) of all messages of a topic; raise RecordingError."""
        self.topic(topic)
        count = 0
        for stored in self._files:
            for message in stored.messages(topic):
                yield message
                count += 1
        stated = self._stated.pop(topic, count)  # compared once
        if stated != count:
            self.notes.append(
                f'{METADATA} states {stated} messages of {topic}, but {count} were found')

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """
        Yield the time [ns] and all messages of a topic.

        Raises RecordingError if its type is not one of `common_types`, or if a message cannot be
        decoded; `raw_messages` returns messages of any type.
        """
        kind, types = self.topic(topic).message_type, common_types()
        check_type(topic, kind)
        serde_error = optional('rosbags.serde', 'a recording').SerdeError
        for time_ns, data in self.raw_messages(topic):
            try:
                message = types.deserialize_cdr(data, kind)
            except (serde_error, OverflowError) as error:  # OverflowError: an impossible length
                raise self._unreadable(f'a message of {topic}: {error}') from error
            yield time_ns, message

    def description(self) -> str | None:
        """Return the first URDF on ROBOT_DESCRIPTION, None without one."""
        if not any(topic.name == ROBOT_DESCRIPTION and topic.message_count
                   for topic in self.topics):
            return None
        return str(next(self.messages(ROBOT_DESCRIPTION))[1].data)

    def joint_state_topic(self, wanted: str | None = None) -> str:
        """
        Return the topic of joint states: /joint_states, or the only one of that type.

        `wanted` is a topic, or a type such as 'sensor_msgs/msg/JointState' that only one topic
        has. Raises RecordingError if no topic or more than one topic matches.
        """
        kind = JOINT_STATE
        if wanted is not None and wanted in [topic.name for topic in self.topics]:
            return wanted
        if wanted is not None:
            if wanted.startswith('/') or wanted.count('/') not in (1, 2):
                return self.topic(wanted).name
            kind = '/'.join((wanted.split('/')[0], 'msg', wanted.split('/')[-1]))
        names = [t.name for t in self.topics if t.message_type == kind and t.message_count]
        if '/joint_states' in names and (wanted is None or len(names) == 1):
            return '/joint_states'
        if len(names) != 1:
            given = f'has the topics {names} of that type' if names else 'has none: its topics ' \
                f'are {[f"{t.name} ({t.message_type})" for t in self.topics]}'
            raise RecordingError(
                f'recording {str(self.path)!r}: expected one topic of type {kind} with '
                f'messages, or one called /joint_states, but it {given}')
        return names[0]

    def joint_states(self, topic: str) -> RecordedJointStates:
        """
        Return all messages of a topic of sensor_msgs/msg/JointState.

        Raises RecordingError if the topic is missing, is of another type, or has no message.
        """
        found = self.topic(topic)
        if found.message_type != JOINT_STATE:
            raise RecordingError(
                f'topic {topic!r} has type {found.message_type!r}, expected {JOINT_STATE}')
        messages = list(self.raw_messages(topic))
        if not messages:
            raise RecordingError(f'recording {str(self.path)!r} has no message of {topic}')
        return RecordedJointStates(
            f'topic {topic!r} of recording {str(self.path)!r}', *decode_joint_states(messages))

    def joint_series(self, topic: str, joint_names: Sequence[str] = ()) -> JointSeries:
        """
        Return the samples of a topic of sensor_msgs/msg/JointState.

        `joint_names` choose joints and their order; empty means those of the first message.
        Times are the header stamps, or the recording times if all stamps are zero. Raises
        RecordingError for another type, unknown joints, or no samples.
        """
        return self.joint_states(topic).series(joint_names)

    def close(self) -> None:
        self._stack.close()

    def __exit__(self, *_: object) -> None:
        self.close()


def stack(messages: Iterable[tuple[int, Any]], fields: Sequence[str]) -> (
        tuple[IntArray, dict[str, FloatArray]]):
    """Return the header stamps (m,) [ns] of messages, and some of their arrays, each (m, n)."""
    kept = [message for _, message in messages]
    return (
        np.array([stamp_ns(message.header) for message in kept], dtype=np.int64),
        {field: np.array([getattr(message, field) for message in kept]) for field in fields})
