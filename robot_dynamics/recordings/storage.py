# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One file of a recording, read by the library `rosbags`, or its intact part if it is damaged.

A file that was compressed as a whole is first decompressed into a temporary directory, as far as
possible. If the recorder left a journal of a sqlite3 file, the file is completed there as well.
"""

from abc import ABC, abstractmethod
from contextlib import closing, suppress
import importlib
from pathlib import Path
import shutil
import sqlite3
import struct
from typing import Any, NamedTuple, Protocol

from robot_dynamics.dependencies import optional
from robot_dynamics.recordings.compression import (
    Budget,
    DecompressionLimitError,
    limit_rosbags,
    limited,
    zstd_module,
)
from robot_dynamics.recordings.loss import Loss
from robot_dynamics.recordings.sqlite_salvage import SalvagedSqlite
from robot_dynamics.recordings.topics import qos_from_rosbags, TopicQos

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_COPY = 1 << 20


class StoredTopic(NamedTuple):
    """A topic of one file; `definition` is the text of its type and `encoding` its language."""

    name: str
    message_type: str
    message_count: int
    qos: TopicQos
    definition: str
    encoding: str


class StoredFile(Protocol):
    """A file that is open for reading; `losses` may grow while it is read."""

    topics: list[StoredTopic]
    losses: list[Loss]
    notes: list[str]

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """Return times [ns] and bytes of the messages of a topic, in the order of time."""

    def close(self) -> None:
        """Close the file."""


def open_stored_file(path: Path, scratch: Path) -> StoredFile:
    """
    Open a file of a recording; `scratch` is a directory for decompressed data.

    Raises OSError if the file cannot be opened, MissingDependencyError without `rosbags`, and
    DecompressionLimitError if the file expands to more than its limit.
    """
    optional('rosbags.rosbag2', 'a recording')
    losses: list[Loss] = []
    notes: list[str] = []
    unpacked = path
    if path.suffix == '.zstd':
        unpacked = scratch / f'{len(list(scratch.iterdir()))}_{path.stem}'
        losses += _decompress(path, unpacked)
    elif path.suffix == '.db3':
        unpacked = _with_journal(path, scratch, notes)
    if unpacked.suffix == '.mcap':
        return McapFile(unpacked, path, losses, notes)
    return SqliteFile(unpacked, path, losses, notes)


class _File(ABC):
    """The common part of both kinds of storage: rosbags first, the salvager if rosbags fails."""

    def __init__(self, path: Path, stored: Path, losses: list[Loss], notes: list[str]) -> None:
        """Open `path`, the file `stored` of the recording or a decompressed copy of it."""
        self.losses, self.notes = losses, notes
        self._path, self._name, self._size = path, stored.name, stored.stat().st_size
        self._salvaged: Any = None
        self._reader: Any = None
        self.topics: list[StoredTopic] = []
        reader = optional('rosbags.rosbag2', 'a recording').Reader(path)
        if not self._can_be_limited():
            self._salvage()
            return
        try:
            with limited(self._budget()):
                reader.open()
        except DecompressionLimitError:
            raise
        except _errors_of_damage():
            self._salvage()
            return
        self._reader = reader
        for connection in reader.connections:
            self.topics.append(StoredTopic(
                connection.topic, connection.msgtype, connection.msgcount,
                qos_from_rosbags(connection), connection.msgdef.data,
                connection.msgdef.format.name))

    def _budget(self) -> Budget:
        """Return the budget of one pass over the file."""
        return Budget(self._name, self._size)

    def _can_be_limited(self) -> bool:
        """Return whether the decompression by rosbags can be limited."""
        return True

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """
        Return times [ns] and bytes of the messages of a topic, in the order of time.

        Raises DecompressionLimitError.
        """
        if self._reader is not None:
            wanted = [c for c in self._reader.connections if c.topic == topic]
            try:
                with limited(self._budget()):
                    read = list(self._reader.messages(wanted)) if wanted else []
            except DecompressionLimitError:
                raise
            except _errors_of_damage():
                read = []
            messages = [
                (time_ns, data) for _, time_ns, data in read if _is_valid(time_ns, data)]
            if len(messages) >= sum(connection.msgcount for connection in wanted):
                return self._plain(messages)
            self._salvage()  # the library may interpret noise as the end of the file
        found = [message for message in self._salvaged.messages(topic) if _is_valid(*message)]
        found.sort(key=lambda message: message[0])
        return self._plain(found)

    def _plain(self, messages: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """Return the decompressed messages of a recording with compression per message."""
        if not any(data[:4] == ZSTD_MAGIC for _, data in messages):
            return messages
        zstd, plain, bad, budget = zstd_module(), [], 0, self._budget()
        for time_ns, data in messages:
            try:
                plain.append((time_ns, budget.decompress(data)))
            except DecompressionLimitError:
                raise
            except (zstd.ZstdError, EOFError, ValueError):
                bad += 1
        if bad:
            self.losses.append(Loss(
                self._name, 'messages that cannot be decompressed', lost_messages=bad))
        return plain

    def _salvage(self) -> None:
        self.close()
        self._salvaged = self._salvager()
        for loss in self._salvaged.losses:
            named = loss._replace(file=self._name)
            self.losses += [named] if named not in self.losses else []
        self.topics = self._salvaged_topics()

    @abstractmethod
    def _salvager(self) -> Any:
        """Return the reader of the intact part of a damaged file."""

    @abstractmethod
    def _salvaged_topics(self) -> list[StoredTopic]:
        """Return the topics that the salvager finds."""

    def close(self) -> None:
        """Close the file."""
        reader, self._reader = self._reader, None
        if reader is not None:
            with suppress(OSError, _error_of_sqlite()):
                reader.close()


def _errors_of_damage() -> tuple[type[Exception], ...]:
    """
    Return the errors that rosbags, and the libraries below it, raise for a damaged file.

    rosbags checks little of its input: noise reaches Python's own functions. Only calls of rosbags
    may be guarded with these errors, which would hide faults of this package's own code.
    """
    return (
        optional('rosbags.rosbag2', 'a recording').ReaderError,
        _error_of_sqlite(),
        zstd_module().ZstdError,
        RuntimeError,  # of lz4
        struct.error,  # a record that is too short
        MemoryError, OSError, OverflowError,  # a size or an offset larger than any file
        ValueError,  # also UnicodeDecodeError: noise instead of text
        LookupError,  # noise instead of a key, or a number without digits (ruamel.yaml)
        AssertionError, AttributeError, TypeError,  # a value of another type
    )


def _error_of_sqlite() -> type[Exception]:
    """Return the error of the sqlite3 library of rosbags, which is not that of Python."""
    try:
        error: type[Exception] = importlib.import_module('apsw').Error
    except ImportError:  # earlier versions of rosbags
        return sqlite3.Error
    return error


def _is_valid(time_ns: Any, data: Any) -> bool:
    """Return whether a time is one of ROS (int64) and a message is bytes; noise may be neither."""
    return isinstance(time_ns, int) and abs(time_ns) < 1 << 63 and isinstance(data, bytes)


class McapFile(_File):
    """A file of MCAP."""

    def _can_be_limited(self) -> bool:
        return limit_rosbags()

    def _salvager(self) -> Any:
        optional('mcap', f'{self._name} is damaged: its intact part')
        from robot_dynamics.recordings.mcap_salvage import SalvagedMcap
        return SalvagedMcap(self._path, self._name, self._size)

    def _salvaged_topics(self) -> list[StoredTopic]:
        topics = []
        for channel in {c.topic: c for c in self._salvaged.channels.values()}.values():
            schema = self._salvaged.schemas.get(channel.schema_id)
            name, encoding, definition = ('', '', b'') if schema is None else (
                schema.name, schema.encoding, schema.data)
            topics.append(StoredTopic(
                channel.topic, name, self._salvaged.counts.get(channel.topic, 0), TopicQos(),
                definition.decode(errors='replace'), _LANGUAGES.get(encoding, 'NONE')))
        return topics


class SqliteFile(_File):
    """A file of sqlite3."""

    def _salvager(self) -> SalvagedSqlite:
        return SalvagedSqlite(self._path)

    def _salvaged_topics(self) -> list[StoredTopic]:
        salvaged: SalvagedSqlite = self._salvaged
        topics = []
        for name, kind in dict(salvaged.types.values()).items():
            encoding, definition = salvaged.definitions.get(kind, ('', ''))
            topics.append(StoredTopic(
                name, kind, salvaged.counts.get(name, 0), TopicQos(), definition,
                _LANGUAGES.get(encoding, 'NONE')))
        return topics


_LANGUAGES = {'ros2msg': 'MSG', 'ros2idl': 'IDL', 'omgidl': 'IDL'}


def _decompress(path: Path, out: Path) -> list[Loss]:
    """
    Write the contents of a compressed file; return the losses.

    Raises DecompressionLimitError.
    """
    zstd = zstd_module()
    decompressor: Any = zstd.ZstdDecompressor()
    size = path.stat().st_size
    budget = Budget(path.name, size)
    done = 0
    with path.open('rb') as source, out.open('wb') as target:
        while part := source.read(_COPY // 16):
            try:
                while part or not (decompressor.eof or decompressor.needs_input):
                    if decompressor.eof:
                        decompressor = zstd.ZstdDecompressor()
                    budget.spend(target.write(decompressor.decompress(part, _COPY)))
                    part = decompressor.unused_data if decompressor.eof else b''
            except zstd.ZstdError as error:
                return [Loss(path.name, f'cannot be decompressed from about byte {done} of '
                                        f'{size} on ({error})', lost_bytes=size - done)]
            done = source.tell()
    if size == 0:
        return [Loss(path.name, 'is empty')]
    return [] if decompressor.eof else [Loss(path.name, 'compressed, and cut off')]


def _with_journal(path: Path, scratch: Path, notes: list[str]) -> Path:
    """Return the file, or a completed copy if its recorder left a journal next to the file."""
    beside = [path.with_name(f'{path.name}{suffix}') for suffix in ('-wal', '-journal')]
    journals = [file for file in beside if file.is_file() and file.stat().st_size > 0]
    if not journals:
        return path
    folder = scratch / f'{len(list(scratch.iterdir()))}'
    folder.mkdir()
    copy = folder / path.name
    for file in (path, *journals):
        shutil.copyfile(file, folder / file.name)
    try:
        with closing(sqlite3.connect(copy)) as connection:
            connection.execute('PRAGMA journal_mode=DELETE')
    except sqlite3.Error:
        notes.append(f'{path.name} is read without its journal, which cannot be applied')
        return path
    notes.append(f'{path.name} was not closed by its recorder; its journal '
                 f'{journals[0].name} is read too')
    return copy
