# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Writing a recording of rosbag2 without ROS, by the library `rosbags`.

Messages are written as the bytes that were received, with the definitions of their types. They are
not re-encoded, and any reader can decode them.
"""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings import topics
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

        Raises RecordingError if the directory exists or cannot be made, MissingDependencyError
        without `rosbags`.
        """
        rosbag2 = optional('rosbags.rosbag2', 'a recording')
        self.directory = directory
        self._connections: dict[str, Any] = {}
        try:
            self._writer = rosbag2.Writer(
                directory, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
            self._writer.set_custom_data('written_by', 'robot_dynamics')
            self._writer.open()
        except (rosbag2.WriterError, OSError) as error:
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
        with uninterrupted():
            self._writer.write(self._connections[topic], time_ns, data)

    def close(self) -> None:
        """Complete and close the files; further calls have no effect."""
        with uninterrupted():
            if self._open:
                self._open = False
                self._writer.close()

    def __exit__(self, *_: object) -> None:
        self.close()
