# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
One file of a recording, read by the library `rosbags`, or its intact part if it is damaged.

A file that was compressed as a whole is first decompressed into a temporary directory, as far as
possible. If the recorder left a journal of a sqlite3 file, the file is completed there as well.
"""

from contextlib import closing, suppress
from pathlib import Path
import shutil
import sqlite3
from typing import Any, Protocol

from robot_dynamics.dependencies import optional
from robot_dynamics_tools.recordings.compression import Budget, zstd_module
from robot_dynamics_tools.recordings.loss import Loss
from robot_dynamics_tools.recordings.sqlite_salvage import SalvagedSqlite
from robot_dynamics_tools.recordings.topics import qos_from_rosbags, RecordedTopic

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_COPY = 1 << 20


class Salvaged(Protocol):
    """The readable part of a damaged file."""

    losses: list[Loss]

    @property
    def topics(self) -> list[RecordedTopic]:
        """The topics that were found."""

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """Return the times [ns] and bytes of all messages of a topic that can be read."""


class StoredFile:
    """A file that is open for reading; `losses` may grow while it is read."""

    def __init__(self, stored: Path, scratch: Path) -> None:
        """
        Open a file of a recording; `scratch` is a directory for decompressed data.

        Raises OSError if the file cannot be opened, MissingDependencyError without `rosbags`, and
        DecompressionLimitError if the file expands to more than its limit.
        """
        reader_type = optional('rosbags.rosbag2', 'a recording').Reader
        self.topics: list[RecordedTopic] = []
        self.losses: list[Loss] = []
        self.notes: list[str] = []
        self._name, self._size, self._path = stored.name, stored.stat().st_size, stored
        self._salvaged: Salvaged | None = None
        self._reader: Any = None
        if stored.suffix == '.zstd':
            self._path = scratch / f'{len(list(scratch.iterdir()))}_{stored.stem}'
            self.losses += _decompress(stored, self._path)
        elif stored.suffix == '.db3':
            self._path = _with_journal(stored, scratch, self.notes)
        try:
            self._reader = reader_type(self._path)
            self._reader.open()
        except Exception:  # rosbags checks little of its input: noise raises any error
            self._salvage()
            return
        self.topics = [
            RecordedTopic(one.topic, one.msgtype, one.msgcount, qos_from_rosbags(one))
            for one in self._reader.connections]

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """
        Return times [ns] and bytes of the messages of a topic, in the order of time.

        Raises DecompressionLimitError.
        """
        salvaged = self._salvaged
        if salvaged is None:
            wanted = [one for one in self._reader.connections if one.topic == topic]
            try:
                read = list(self._reader.messages(wanted)) if wanted else []
            except Exception:  # as at opening
                read = []
            found = [(time_ns, data) for _, time_ns, data in read if _is_valid(time_ns, data)]
            if len(found) >= sum(one.msgcount for one in wanted):
                return self._plain(found)
            salvaged = self._salvage()  # the library may interpret noise as the end of the file
        found = [message for message in salvaged.messages(topic) if _is_valid(*message)]
        return self._plain(sorted(found, key=lambda message: message[0]))

    def _plain(self, messages: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """Return the decompressed messages of a recording with compression per message."""
        if not any(data[:4] == ZSTD_MAGIC for _, data in messages):
            return messages
        budget, plain = Budget(self._name, self._size), []
        for time_ns, packed in messages:
            data, is_whole = budget.decompress(packed)
            if is_whole:
                plain.append((time_ns, data))
        if len(plain) < len(messages):
            self.losses.append(Loss(
                self._name, 'messages that cannot be decompressed',
                lost_messages=len(messages) - len(plain)))
        return plain

    def _salvage(self) -> Salvaged:
        self.close()
        if self._path.suffix == '.mcap':
            optional('mcap', f'{self._name} is damaged: its intact part')
            from robot_dynamics_tools.recordings.mcap_salvage import SalvagedMcap
            salvaged: Salvaged = SalvagedMcap(self._path, self._name, self._size)
        else:
            salvaged = SalvagedSqlite(self._path)
        losses = [loss._replace(file=self._name) for loss in salvaged.losses]
        self.losses += [loss for loss in losses if loss not in self.losses]
        self.topics, self._salvaged = salvaged.topics, salvaged
        return salvaged

    def close(self) -> None:
        """Close the file."""
        reader, self._reader = self._reader, None
        if reader is not None:
            with suppress(Exception):  # of a damaged file
                reader.close()


def _is_valid(time_ns: Any, data: Any) -> bool:
    """Return whether a time is one of ROS (int64) and a message is bytes; noise may be neither."""
    return isinstance(time_ns, int) and abs(time_ns) < 1 << 63 and isinstance(data, bytes)


def _decompress(path: Path, out: Path) -> list[Loss]:
    """
    Write the contents of a compressed file; return the losses.

    Raises DecompressionLimitError.
    """
    zstd, size = zstd_module(), path.stat().st_size
    budget = Budget(path.name, size)
    with path.open('rb') as packed, zstd.ZstdFile(packed) as source, out.open('wb') as target:
        try:
            while size and (part := source.read1(_COPY)):
                budget.spend(target.write(part))
        except EOFError:
            return [Loss(path.name, 'compressed, and cut off')]
        except zstd.ZstdError as error:
            done = packed.tell()
            return [Loss(path.name, f'cannot be decompressed from about byte {done} of {size} on '
                                    f'({error})', lost_bytes=size - done)]
    return [] if size else [Loss(path.name, 'is empty')]


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
