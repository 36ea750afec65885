# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Writing a recording of rosbag2 without ROS, by the library `rosbags`.

Messages are written as the bytes that were received, with the definitions of their types. They are
not re-encoded, and any reader can decode them.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.tools.command_line import ToolError
from robot_dynamics_tools.recordings import topics
from robot_dynamics_tools.recordings.bag_files import METADATA
from robot_dynamics_tools.recordings.interrupts import uninterrupted


class RecordingWriter(AbstractContextManager['RecordingWriter']):
    """
    Writes a recording, a directory of rosbag2 with MCAP storage; for use in `with`.

    The written messages are readable after `close`, which the `with` statement also calls after
    an exception.
    """

    def __init__(self, directory: Path) -> None:
        """
        Create `directory`.

        Raises RecordingError if the directory exists, ToolError if it cannot be written, which
        `write` and `close` raise too, MissingDependencyError without `rosbags`.
        """
        rosbag2 = optional('rosbags.rosbag2', 'a recording')
        self.directory = directory
        self._connections: dict[str, Any] = {}
        try:
            self._writer = rosbag2.Writer(
                directory, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
            self._writer.set_custom_data('written_by', 'robot_dynamics')
            with self._writing():
                self._writer.open()
        except rosbag2.WriterError as error:
            raise RecordingError(f'recording {str(directory)!r}: {error}') from None
        self._open = True

    def add_topic(self, name: str, message_type: str, qos: topics.TopicQos | None = None) -> None:
        """Announce a topic; raise RecordingError for a type that `common_types` does not have."""
        topics.check_type(name, message_type)
        self._connections[name] = self._writer.add_connection(
            name, message_type, typestore=topics.common_types(),
            offered_qos_profiles=[topics.qos_to_rosbags(qos or topics.TopicQos())])

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        """Write a serialized message (CDR) of a topic under this time [ns]."""
        with self._writing():
            self._writer.write(self._connections[topic], time_ns, data)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            with uninterrupted():
                yield
        except OSError as error:
            raise ToolError(f'cannot write {self.directory}: {error.strerror}') from None

    def close(self) -> None:
        """Complete and close the files; further calls have no effect."""
        with self._writing():
            if self._open:
                self._open = False
                self._writer.close()

    def __exit__(self, *_: object) -> None:
        self.close()


def prepare_recording(directory: Path, option: str, force: bool = False) -> None:
    """
    Raise InvalidInputError if the directory of a new recording exists.

    With `force`, a recording that RecordingWriter has written is removed instead.
    """
    if force:
        remove_recording(directory)
    if directory.exists():
        expected = 'that of a recording with --force' if force else 'a new directory'
        raise InvalidInputError(
            f'{option} is {str(directory)!r}, which exists; expected {expected}')


def remove_recording(directory: Path) -> None:
    """Remove a recording that RecordingWriter has written, and no other directory."""
    names = {METADATA, f'{directory.name}.mcap'}
    if directory.is_dir() and {entry.name for entry in directory.iterdir()} <= names:
        for name in names:
            (directory / name).unlink(missing_ok=True)
        directory.rmdir()
