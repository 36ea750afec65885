# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Recordings of rosbag2 on disk, read and written without ROS, by the library `rosbags`.

Messages are written as the bytes that came over the wire, with the definitions of their types,
so that nothing is re-encoded and any reader can decode them. Read are the formats that `rosbags`
knows: directories of rosbag2, and single files of MCAP or sqlite3.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
import signal
import threading
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.exceptions import MissingDependencyError, RecordingError
from robot_dynamics.validation import FloatArray

JOINT_STATE = 'sensor_msgs/msg/JointState'
NANOSECONDS_PER_SECOND = 1_000_000_000

IntArray = npt.NDArray[np.int64]
_ENDING = (signal.SIGINT, signal.SIGTERM)


class TopicQos(NamedTuple):
    """What a publisher offers, as far as a player has to offer it again."""

    depth: int = 1
    reliable: bool = True
    transient_local: bool = False


class RecordedTopic(NamedTuple):
    """A topic of a recording; `message_type` is as 'sensor_msgs/msg/JointState'."""

    name: str
    message_type: str
    message_count: int
    qos: TopicQos


@dataclass(frozen=True, eq=False)
class JointSeries:
    """
    The joint states, or efforts, of one topic: m samples of n joints, in the order of stamp.

    `stamps_ns` (m,) are strictly increasing. `position`, `velocity` and `effort` are (m, n)
    [rad or m, per second, N·m or N], or None where no message has the field. `passed_over` counts
    messages left out: other joints, a stamp that does not advance, or a field that is missing
    or not finite while others have it.
    """

    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None
    passed_over: int

    @property
    def times(self) -> FloatArray:
        """Seconds since the first sample, (m,)."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND)

    def first(self, seconds: float) -> 'JointSeries':
        """Return the samples of the first so many seconds."""
        rows = np.arange(int(np.searchsorted(self.times, seconds, side='right')))
        return self._chosen(rows, np.arange(len(self.joint_names)))

    def after(self, count: int) -> 'JointSeries':
        """Return the samples without so many first ones."""
        rows = np.arange(count, len(self.stamps_ns))
        return self._chosen(rows, np.arange(len(self.joint_names)))

    def of_joints(self, joint_names: Sequence[str]) -> 'JointSeries':
        """Return the samples of these joints, in this order."""
        columns = np.array([self.joint_names.index(name) for name in joint_names], dtype=np.intp)
        return self._chosen(np.arange(len(self.stamps_ns)), columns)

    def _chosen(self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> (
            'JointSeries'):
        def chosen(values: FloatArray | None) -> FloatArray | None:
            return None if values is None else np.asarray(values[np.ix_(rows, columns)])

        return replace(
            self, joint_names=tuple(self.joint_names[i] for i in columns),
            stamps_ns=self.stamps_ns[rows], position=chosen(self.position),
            velocity=chosen(self.velocity), effort=chosen(self.effort))


class RecordingWriter:
    """
    Writes a recording, a directory of rosbag2 with MCAP storage; for use in `with`.

    What was written is readable after `close`, which the `with` statement calls also where an
    exception leaves it.
    """

    def __init__(self, directory: Path, definitions: Mapping[str, str] | None = None) -> None:
        """
        Create `directory`.

        `definitions` are the texts of message types beyond those of ROS 2 Jazzy's common
        packages, by name, as in {'my_msgs/msg/Pair': 'float64 a'}. Raises RecordingError where
        the directory exists or cannot be made, MissingDependencyError without `rosbags`.
        """
        rosbag2, typesys = _rosbags('rosbag2'), _rosbags('typesys')
        self.directory = directory
        self._types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
        for name, text in (definitions or {}).items():
            self._types.register(typesys.get_types_from_msg(text, name))
        self._connections: dict[str, Any] = {}
        try:
            self._writer = rosbag2.Writer(
                directory, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
            self._writer.set_custom_data('written_by', 'robot_dynamics')
            self._writer.open()
        except (rosbag2.WriterError, OSError) as error:
            raise RecordingError(f'recording {str(directory)!r}: {error}') from None
        self._open = True

    def add_topic(self, name: str, message_type: str, qos: TopicQos | None = None) -> None:
        """Announce a topic; raise RecordingError for a type whose definition is not known."""
        if message_type not in self._types.fielddefs:
            raise RecordingError(
                f'topic {name!r} has type {message_type!r}, expected a type of the common '
                'packages of ROS 2 Jazzy, or one whose definition was given')
        self._connections[name] = self._writer.add_connection(
            name, message_type, typestore=self._types,
            offered_qos_profiles=[_qos_to_rosbags(qos or TopicQos())])

    def write(self, topic: str, time_ns: int, data: bytes) -> None:
        """Write a serialized message (CDR) of a topic under this time [ns]."""
        with uninterrupted():
            self._writer.write(self._connections[topic], time_ns, data)

    def write_message(self, topic: str, time_ns: int, message: Any) -> None:
        """Write a message in the form that `Recording` gives it out, or of the same fields."""
        connection = self._connections[topic]
        self.write(topic, time_ns, bytes(self._types.serialize_cdr(message, connection.msgtype)))

    def make_message(self, message_type: str, **fields: Any) -> Any:
        """Return a message of a known type, for `write_message`."""
        return self._types.types[message_type](**fields)

    def close(self) -> None:
        """Finish the files; once is enough."""
        with uninterrupted():
            if self._open:
                self._open = False
                self._writer.close()

    def __enter__(self) -> 'RecordingWriter':
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Recording:
    """A recording that is open for reading; for use in `with`."""

    def __init__(self, path: Path) -> None:
        """
        Open a directory of rosbag2, or one file of MCAP or sqlite3.

        Raises RecordingError where there is none or it cannot be read, MissingDependencyError
        without `rosbags`.
        """
        highlevel, typesys = _rosbags('highlevel'), _rosbags('typesys')
        self.path = path
        if not path.exists():
            raise RecordingError(f'recording {str(path)!r} does not exist')
        if path.is_dir() and not (path / 'metadata.yaml').exists():
            raise RecordingError(
                f'recording {str(path)!r} is a directory without metadata.yaml, expected a '
                'directory of rosbag2, or a file .mcap or .db3')
        try:
            self._reader = highlevel.AnyReader(
                [path], default_typestore=typesys.get_typestore(typesys.Stores.ROS2_JAZZY))
            self._reader.open()
        except Exception as error:  # the errors of rosbags have no common base
            raise self._unreadable(error) from error

    def _unreadable(self, error: Exception) -> RecordingError:
        return RecordingError(f'recording {str(self.path)!r} cannot be read: {error}')

    @property
    def topics(self) -> tuple[RecordedTopic, ...]:
        """All topics, by name."""
        connections: dict[str, list[Any]] = {}
        for connection in self._reader.connections:
            connections.setdefault(connection.topic, []).append(connection)
        return tuple(
            RecordedTopic(name, all_of_it[0].msgtype, sum(c.msgcount for c in all_of_it),
                          _qos_from_rosbags(all_of_it[0]))
            for name, all_of_it in sorted(connections.items()))

    def topic(self, name: str) -> RecordedTopic:
        """Return the topic of this name; raise RecordingError, which lists the others."""
        for topic in self.topics:
            if topic.name == name:
                return topic
        raise RecordingError(
            f'recording {str(self.path)!r} has no topic {name!r}, expected one of '
            f'{[topic.name for topic in self.topics]}')

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Yield the time [ns] and the message of all of a topic; raise RecordingError."""
        self.topic(topic)
        connections = [c for c in self._reader.connections if c.topic == topic]
        try:
            for connection, time_ns, raw in self._reader.messages(connections):
                yield time_ns, self._reader.deserialize(raw, connection.msgtype)
        except Exception as error:  # the errors of rosbags have no common base
            raise self._unreadable(error) from error

    def joint_state_topic(self) -> str:
        """
        Return the topic of joint states: /joint_states, or the only one of that type.

        Raises RecordingError where there is none, or more than one to choose from.
        """
        names = [t.name for t in self.topics if t.message_type == JOINT_STATE and t.message_count]
        if '/joint_states' in names:
            return '/joint_states'
        if len(names) != 1:
            given = f'has the topics {names} of that type' if names else 'has none: its topics ' \
                f'are {[f"{t.name} ({t.message_type})" for t in self.topics]}'
            raise RecordingError(
                f'recording {str(self.path)!r}: expected one topic of type {JOINT_STATE} with '
                f'messages, or one called /joint_states, but it {given}')
        return names[0]

    def joint_series(self, topic: str, joint_names: Sequence[str] = ()) -> JointSeries:
        """
        Return the samples of a topic of sensor_msgs/msg/JointState.

        `joint_names` choose joints and their order; empty means those of the first message.
        Times are the header stamps, or those of the recording where all stamps are zero. Raises
        RecordingError for another type, unknown joints, or no samples.
        """
        found = self.topic(topic)
        if found.message_type != JOINT_STATE:
            raise RecordingError(
                f'topic {topic!r} has type {found.message_type!r}, expected {JOINT_STATE}')
        messages = list(self.messages(topic))
        names = tuple(joint_names or (messages[0][1].name if messages else ()))
        rows = [(time_ns, message, _columns(message.name, names)) for time_ns, message in messages]
        rows = [row for row in rows if row[2] is not None]
        if not rows:
            spoken = sorted({name for _, message in messages for name in message.name})
            raise RecordingError(
                f'topic {topic!r} of recording {str(self.path)!r} has no message with all of '
                f'the joints {list(names)}; it has {spoken}')
        return _series(names, rows, len(messages))

    def close(self) -> None:
        self._reader.close()

    def __enter__(self) -> 'Recording':
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """
    Let signals wait until the block is done, so that no half record is left in a file.

    Signals interrupt the main thread alone; in other threads this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, Any]] = []
    before = {
        number: signal.signal(number, lambda *call: arrived.append(call)) for number in _ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for signum, frame in arrived[:1]:
            handler = before[signal.Signals(signum)]
            if callable(handler):
                handler(signum, frame)


def stamp_ns(header: Any) -> int:
    """Return the nanoseconds of a header's stamp."""
    return int(header.stamp.sec) * NANOSECONDS_PER_SECOND + int(header.stamp.nanosec)


def stack(messages: Iterable[tuple[int, Any]], fields: Sequence[str]) -> (
        tuple[IntArray, dict[str, FloatArray]]):
    """Return the header stamps (m,) [ns] of messages, and some of their arrays, each (m, n)."""
    kept = [message for _, message in messages]
    return (
        np.array([stamp_ns(message.header) for message in kept], dtype=np.int64),
        {field: np.array([getattr(message, field) for message in kept]) for field in fields})


def _columns(given: Sequence[str], wanted: Sequence[str]) -> list[int] | None:
    index = {name: i for i, name in enumerate(given)}
    return [index[name] for name in wanted] if all(name in index for name in wanted) else None


def _series(
    names: tuple[str, ...], rows: list[tuple[int, Any, Any]], message_count: int,
) -> JointSeries:
    stamps = np.array([stamp_ns(message.header) for _, message, _ in rows], dtype=np.int64)
    if not stamps.any():
        stamps = np.array([time_ns for time_ns, _, _ in rows], dtype=np.int64)
    newest = np.maximum.accumulate(stamps)
    keep = np.concatenate(([True], stamps[1:] > newest[:-1]))
    fields: dict[str, FloatArray] = {}
    for field in ('position', 'velocity', 'effort'):
        values = np.array([
            np.asarray(given)[columns] if len(given := getattr(message, field)) == len(
                message.name) else np.full(len(names), np.nan)
            for _, message, columns in rows])
        known = np.isfinite(values).all(axis=1)
        if known.any():
            fields[field] = values
            keep &= known
    if not keep.any():
        raise RecordingError('no message of the joint states has all its fields finite')

    def kept(field: str) -> FloatArray | None:
        return fields[field][keep] if field in fields else None

    return JointSeries(
        names, stamps[keep], kept('position'), kept('velocity'), kept('effort'),
        message_count - int(keep.sum()))


def _rosbags(module: str) -> Any:
    try:
        import importlib
        return importlib.import_module(f'rosbags.{module}')
    except ImportError:
        raise MissingDependencyError(
            'recordings need the library rosbags (pip install rosbags)') from None


def _qos_to_rosbags(qos: TopicQos) -> Any:
    interfaces = _rosbags('interfaces')
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


def _qos_from_rosbags(connection: Any) -> TopicQos:
    profiles = getattr(connection.ext, 'offered_qos_profiles', [])
    if not profiles:
        return TopicQos()
    return TopicQos(
        profiles[0].depth, profiles[0].reliability.name != 'BEST_EFFORT',
        profiles[0].durability.name == 'TRANSIENT_LOCAL')
