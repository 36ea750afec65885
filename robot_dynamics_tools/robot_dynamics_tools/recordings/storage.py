# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One file of a recording, read by the library `rosbags`.

A file that was compressed as a whole is first decompressed into a temporary directory. If the
recorder left a journal of a sqlite3 file, the file is completed there as well. A damaged file is
an error that names the program that repairs it.

A compressed file may expand to thousands of times its size. One pass over a file may decompress at
most LARGEST_RATIO times the size of the file on disk, but at least LEAST_LIMIT. The chunks of an
MCAP file are decompressed by rosbags, which has no limit.
"""

from contextlib import closing, suppress
from pathlib import Path
import shutil
import sqlite3
from typing import Any

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.topics import RecordedTopic

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_COPY = 1 << 20
LEAST_LIMIT = 1 << 28
"""Bytes that any file may expand to."""
LARGEST_RATIO = 200
"""Bytes that each compressed byte of a file may expand to on average."""

REPAIRS = {
    '.mcap': 'mcap recover {name} -o repaired.mcap (of the MCAP command line)',
    '.db3': "sqlite3 {name} '.recover' | sqlite3 repaired.db3",
    '.zstd': 'zstd -d {name}, and then the repair of the file that this writes'}
"""Commands that repair a damaged file, by its suffix."""


class DecompressionLimitError(RecordingError):
    """A file expands to more than its limit."""


class Budget:
    """The amount of data that one pass over a file may still decompress."""

    def __init__(self, name: str, size: int) -> None:
        """`name` is that of the file in messages, `size` [bytes] its size on disk."""
        self.limit = max(LEAST_LIMIT, LARGEST_RATIO * size)
        """[bytes]"""
        self._name, self._size, self._left = name, size, self.limit

    def spend(self, count: int) -> None:
        """Count decompressed bytes; raise DecompressionLimitError beyond the limit."""
        self._left -= count
        if self._left < 0:
            raise DecompressionLimitError(
                f'{self._name} has {self._size} bytes and expands to more than {self.limit}, '
                f'expected at most {LARGEST_RATIO} times its size, or {LEAST_LIMIT} bytes; if the '
                'recording is genuine, decompress it first, with zstd -d (a file .zstd) or '
                'ros2 bag convert')

    def decompress(self, data: bytes) -> tuple[bytes, bool]:
        """
        Return the data that can be decompressed, and whether they are whole.

        Raises DecompressionLimitError.
        """
        decompressor: Any = zstd_module().ZstdDecompressor()
        try:
            out = bytes(decompressor.decompress(data, self._left + 1))
        except (EOFError, MemoryError, ValueError, zstd_module().ZstdError):
            return b'', False
        self.spend(len(out))
        return out, decompressor.eof


def zstd_module() -> Any:
    """Return Python's module of Zstandard, or its replacement before Python 3.14."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd


def damaged(path: Path, reason: object) -> RecordingError:
    """Return the error of a file that cannot be read, with the programs that repair it."""
    repair = REPAIRS.get(path.suffix, 'its backup').format(name=path.name)
    return RecordingError(
        f'{path.name} is damaged: {reason}. Repair it with: {repair}; then ros2 bag reindex '
        'DIRECTORY for a directory of rosbag2')


class StoredFile:
    """A file that is open for reading."""

    def __init__(self, stored: Path, scratch: Path) -> None:
        """
        Open a file of a recording; `scratch` is a directory for decompressed data.

        Raises OSError if the file cannot be opened, RecordingError if it is damaged,
        MissingDependencyError without `rosbags`, and DecompressionLimitError if the file expands
        to more than its limit.
        """
        reader_type = optional('rosbags.rosbag2', 'a recording').Reader
        self.notes: list[str] = []
        self._stored, self._size, path = stored, stored.stat().st_size, stored
        if self._size == 0:
            raise damaged(stored, 'it is empty')
        if stored.suffix == '.zstd':
            path = scratch / f'{len(list(scratch.iterdir()))}_{stored.stem}'
            _decompress(stored, path)
        elif stored.suffix == '.db3':
            path = _with_journal(stored, scratch, self.notes)
        try:
            self._reader = reader_type(path)
            self._reader.open()
        except Exception as error:  # rosbags checks little of its input: noise raises any error
            raise damaged(stored, error) from error
        self.topics = [
            RecordedTopic(one.topic, one.msgtype, one.msgcount)
            for one in self._reader.connections]

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """
        Return times [ns] and bytes of the messages of a topic, in the order of time.

        Raises RecordingError if the file is damaged, and DecompressionLimitError.
        """
        wanted = [one for one in self._reader.connections if one.topic == topic]
        try:
            found = [(time_ns, data) for _, time_ns, data in self._reader.messages(wanted)
                     ] if wanted else []
        except Exception as error:  # as at opening
            raise damaged(self._stored, error) from error
        stated = sum(one.msgcount for one in wanted)
        if len(found) < stated:  # the library may interpret noise as the end of the file
            raise damaged(
                self._stored, f'{len(found)} of {stated} messages of {topic} can be read')
        if not all(_is_valid(*message) for message in found):
            raise damaged(self._stored, f'a message of {topic} has no valid time or content')
        return self._plain(found)

    def _plain(self, messages: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """Return the decompressed messages of a recording with compression per message."""
        if not any(data[:4] == ZSTD_MAGIC for _, data in messages):
            return messages
        budget, plain = Budget(self._stored.name, self._size), []
        for time_ns, packed in messages:
            data, is_whole = budget.decompress(packed)
            if not is_whole:
                raise damaged(self._stored, 'a compressed message cannot be decompressed')
            plain.append((time_ns, data))
        return plain

    def close(self) -> None:
        """Close the file."""
        with suppress(Exception):  # of a damaged file
            self._reader.close()


def _is_valid(time_ns: Any, data: Any) -> bool:
    """Return whether a time is one of ROS (int64) and a message is bytes; noise may be neither."""
    return isinstance(time_ns, int) and abs(time_ns) < 1 << 63 and isinstance(data, bytes)


def _decompress(path: Path, out: Path) -> None:
    """Write the contents of a compressed file; raise RecordingError, DecompressionLimitError."""
    zstd = zstd_module()
    budget = Budget(path.name, path.stat().st_size)
    with path.open('rb') as packed, zstd.ZstdFile(packed) as source, out.open('wb') as target:
        try:
            while part := source.read1(_COPY):
                budget.spend(target.write(part))
        except (EOFError, zstd.ZstdError) as error:
            raise damaged(path, error) from error


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
