# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A damaged MCAP file, read record by record as far as possible.

A truncated file has no footer and no index. Its records are read in sequence from the beginning,
including the part of the last chunk that can be decompressed. If a chunk fails its checksum,
cannot be decompressed, or contains noise, reading continues with the next chunk.

The library `mcap` decodes the records and the summary. The loop over the records is own code:
`mcap.stream_reader.StreamReader` discards an incomplete last chunk, reads beyond the end of a
malformed record, and skips zeros without an error.
"""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
import struct
from typing import Any, BinaryIO
import zlib

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Message, Schema
from mcap.writer import MCAP0_MAGIC
from robot_dynamics_tools.recordings.compression import Budget
from robot_dynamics_tools.recordings.loss import Loss
from robot_dynamics_tools.recordings.topics import RecordedTopic, TopicQos

_FRAME = struct.Struct('<BQ')
"""The opcode of a record and the length [bytes] of its content, which follows."""
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_MALFORMED = (McapError, struct.error, ValueError, OverflowError)
"""Errors that the library raises for content that is not of the expected kind."""


class SalvagedMcap:
    """The readable part of an MCAP file; `topics` and `losses` are complete after construction."""

    def __init__(self, path: Path, name: str, size: int) -> None:
        """
        Read through the file once; raise OSError or DecompressionLimitError.

        `name` and `size` [bytes] are those of the file before it was decompressed as a whole.
        """
        self._path = path
        self._stored = name, size
        self._budget = Budget(name, size)
        self.losses: list[Loss] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: dict[str, int] = {}
        self._unknown = 0
        self._read_summary()
        for channel, _, _ in self._messages():
            self._counts[channel.topic] = self._counts.get(channel.topic, 0) + 1
        if self._unknown:
            self._lose('messages of topics whose description is lost', lost_messages=self._unknown)
        self._quiet = True

    _quiet = False

    @property
    def topics(self) -> list[RecordedTopic]:
        """The topics, each with the number of its messages."""
        kinds = {channel.topic: self._schemas.get(channel.schema_id)
                 for channel in self._channels.values()}
        return [
            RecordedTopic(
                name, '' if kind is None else kind.name, self._counts.get(name, 0), TopicQos())
            for name, kind in kinds.items()]

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """Return the times [ns] and bytes of all messages of a topic that can be read."""
        return [(time_ns, data) for channel, time_ns, data in self._messages()
                if channel.topic == topic]

    def _read_summary(self) -> None:
        """Read the descriptions of topics that a complete file repeats at its end."""
        with self._path.open('rb') as file:
            try:
                summary = SeekingReader(
                    file, record_size_limit=self._path.stat().st_size).get_summary()
            except (*_MALFORMED, OSError):  # the file is shorter than a footer, or was cut off
                return
        if summary is not None:
            self._schemas |= summary.schemas
            self._channels |= summary.channels

    def _lose(self, reason: str, **figures: Any) -> None:
        if not self._quiet:
            self.losses.append(Loss(self._path.name, reason, **figures))

    def _messages(self) -> Iterator[tuple[Channel, int, bytes]]:
        size = self._path.stat().st_size
        self._budget = Budget(*self._stored)
        with self._path.open('rb') as file:
            if size == 0:
                self._lose('is empty')
            elif file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                self._lose('does not begin as an MCAP file', lost_bytes=size)
            else:
                yield from self._records(file, size)

    def _records(self, file: BinaryIO, size: int) -> Iterator[tuple[Channel, int, bytes]]:
        newest: int | None = None
        while (start := file.tell()) + _FRAME.size <= size:
            opcode, length = _FRAME.unpack(file.read(_FRAME.size))
            end = start + _FRAME.size + length
            if opcode in (Opcode.DATA_END, Opcode.FOOTER) and end <= size:
                return
            if not 0 < opcode <= Opcode.DATA_END:
                self._lose(f'no record at byte {start}: the rest cannot be read',
                           lost_bytes=size - start, start_ns=newest)
                return
            if opcode in (*_IN_CHUNKS, Opcode.CHUNK):
                content = file.read(min(length, size))
                for message in self._record(opcode, content, end <= size, start):
                    newest = message[1]
                    yield message
            if end > size:
                break
            file.seek(end)
        self._lose('cut off after a whole record: no end and no index' if start == size
                   else f'cut off inside the record at byte {start}', start_ns=newest)

    def _record(
        self, opcode: int, content: bytes, whole: bool, start: int,
    ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages in a record, and keep the description of a topic."""
        if not whole and opcode != Opcode.CHUNK:
            return
        try:
            record = _decoded(opcode, content)
        except _MALFORMED:
            if whole:
                self._lose(f'the {Opcode(opcode).name.lower()} record at byte {start} cannot be '
                           'read', lost_bytes=len(content))
            return
        if isinstance(record, Chunk):
            yield from self._chunk(record, whole, start)
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
            self._counts.setdefault(record.topic, 0)
        elif isinstance(record, Message):
            if record.channel_id in self._channels:
                yield self._channels[record.channel_id], record.log_time, record.data
            else:
                self._unknown += 1

    def _chunk(
        self, chunk: Chunk, whole: bool, start: int,
    ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages in a chunk, up to the first noise."""
        first, last = chunk.message_start_time, chunk.message_end_time
        size, checksum = chunk.uncompressed_size, chunk.uncompressed_crc
        data, sound = self._budget.decompress(chunk.data, chunk.compression, size)
        times = {'start_ns': first, 'end_ns': last} if 0 < first <= last else {}
        if whole and not sound:
            self._lose(f'the chunk at byte {start} cannot be decompressed ({chunk.compression}) '
                       f'from byte {len(data)} of {size} on', lost_bytes=size - len(data), **times)
        elif whole and checksum and zlib.crc32(data) != checksum:
            self._lose(f'the chunk at byte {start} fails its checksum: the whole chunk is skipped',
                       lost_bytes=len(chunk.data), **times)
            return
        at = 0
        while at + _FRAME.size <= len(data):
            opcode, length = _FRAME.unpack_from(data, at)
            end = at + _FRAME.size + length
            if end > len(data) or opcode not in _IN_CHUNKS:
                break
            for channel, time_ns, message in self._record(
                    opcode, data[at + _FRAME.size:end], True, start):
                if first <= time_ns <= last:  # otherwise the record is noise
                    yield channel, time_ns, message
            at = end
        if whole and sound and at < len(data):
            self._lose(f'no record at byte {at} of the chunk at byte {start}: the rest of the '
                       'chunk is skipped', lost_bytes=len(data) - at, end_ns=times.get('end_ns'))


def _decoded(opcode: int, content: bytes) -> Any:
    """Return a record of one of the four kinds that are read; raise one of `_MALFORMED`."""
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.MESSAGE:
        return Message.read(stream, len(content))
    readers = {Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read, Opcode.CHUNK: Chunk.read}
    return readers[Opcode(opcode)](stream)
