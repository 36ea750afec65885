# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A damaged MCAP file, read record by record as far as possible.

A truncated file has no footer and no index. Its records are read in sequence from the beginning,
including the part of the last chunk that can be decompressed. If a chunk fails its checksum or
cannot be decompressed, reading continues with the next chunk.

The library `mcap` decodes the records and the summary. Two parts are own code, because
`mcap.stream_reader.StreamReader` would lose messages that can be read: the loop over the records
(`StreamReader` discards an incomplete last chunk, reads beyond the end of a malformed record and
skips zeros without an error), and the search for the next message after noise in a chunk that
has no checksum, such as those that rosbags and rosbag2 write.
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
from robot_dynamics.recordings.compression import Budget, decompress_chunk
from robot_dynamics.recordings.loss import Loss

_FRAME = struct.Struct('<BQ')
"""The opcode of a record and the length [bytes] of its content, which follows."""
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_MALFORMED = (McapError, struct.error, ValueError, OverflowError)
"""Errors that the library raises for content that is not of the expected kind."""


class SalvagedMcap:
    """
    The readable part of an MCAP file.

    `channels` and `schemas` are indexed by their numbers, `counts` (of messages) by topic; these
    fields and `losses` are complete after construction.
    """

    def __init__(self, path: Path, name: str, size: int) -> None:
        """
        Read through the file once; raise OSError or DecompressionLimitError.

        `name` and `size` [bytes] are those of the file before it was decompressed as a whole.
        """
        self.path = path
        self._stored = name, size
        self._budget = Budget(name, size)
        self.losses: list[Loss] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: dict[str, int] = {}
        self._unknown = 0
        self._read_summary()
        for channel, _, _ in self._messages():
            self.counts[channel.topic] = self.counts.get(channel.topic, 0) + 1
        if self._unknown:
            self._lose('messages of topics whose description is lost', lost_messages=self._unknown)
        self._quiet = True

    _quiet = False

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """Return the times [ns] and bytes of all messages of a topic that can be read."""
        return [(time_ns, data) for channel, time_ns, data in self._messages()
                if channel.topic == topic]

    def _read_summary(self) -> None:
        """Read the descriptions of topics that a complete file repeats at its end."""
        with self.path.open('rb') as file:
            try:
                summary = SeekingReader(
                    file, record_size_limit=self.path.stat().st_size).get_summary()
            except (*_MALFORMED, OSError):  # the file is shorter than a footer, or was cut off
                return
        if summary is not None:
            self.schemas |= summary.schemas
            self.channels |= summary.channels

    def _lose(self, reason: str, **figures: Any) -> None:
        if not self._quiet:
            self.losses.append(Loss(self.path.name, reason, **figures))

    def _messages(self) -> Iterator[tuple[Channel, int, bytes]]:
        size = self.path.stat().st_size
        self._budget = Budget(*self._stored)
        with self.path.open('rb') as file:
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
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
            self.counts.setdefault(record.topic, 0)
        elif isinstance(record, Message):
            if record.channel_id in self.channels:
                yield self.channels[record.channel_id], record.log_time, record.data
            else:
                self._unknown += 1

    def _chunk(
        self, chunk: Chunk, whole: bool, start: int,
    ) -> Iterator[tuple[Channel, int, bytes]]:
        first, last, size = (
            chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size)
        data, sound = decompress_chunk(
            chunk.data, chunk.compression, size, self._budget)
        times = {'start_ns': first, 'end_ns': last} if 0 < first <= last else {}
        if whole and not sound:
            self._lose(f'the chunk at byte {start} cannot be decompressed ({chunk.compression}) '
                       f'from byte {len(data)} of {size} on', lost_bytes=size - len(data), **times)
        elif whole and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            self._lose(f'the chunk at byte {start} fails its checksum: the whole chunk is skipped',
                       lost_bytes=len(chunk.data), **times)
            return
        yield from self._records_of_chunk(data, whole and sound, start, (first, last))

    def _records_of_chunk(
        self, data: bytes, complete: bool, start: int, span: tuple[int, int],
    ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages in a chunk; noise between them is skipped."""
        at, newest = 0, None
        while at + _FRAME.size <= len(data):
            opcode, length = _FRAME.unpack_from(data, at)
            end = at + _FRAME.size + length
            if end > len(data) or opcode not in _IN_CHUNKS or (
                    opcode == Opcode.MESSAGE and not self._is_message(data, at, span)):
                found = self._next_message(data, at + 1, span)
                if complete or found < len(data):
                    self._lose(f'no record at byte {at} of the chunk at byte {start}',
                               lost_bytes=found - at, start_ns=newest)
                at = found
                continue
            for message in self._record(opcode, data[at + _FRAME.size:end], True, start):
                newest = message[1]
                yield message
            at = end

    def _is_message(self, data: bytes, at: int, span: tuple[int, int]) -> bool:
        """Return whether a message with a channel and a time of this chunk begins here."""
        start = at + _FRAME.size
        length = _FRAME.unpack_from(data, at)[1] if start <= len(data) else 0
        if start + length > len(data):
            return False
        try:
            message = _decoded(Opcode.MESSAGE, data[start:start + length])
        except _MALFORMED:
            return False
        return message.channel_id in self.channels and span[0] <= message.log_time <= span[1]

    def _next_message(self, data: bytes, at: int, span: tuple[int, int]) -> int:
        """Return the offset of the next message of this chunk, or the length of the data."""
        while (at := data.find(bytes([Opcode.MESSAGE]), at)) >= 0:
            if self._is_message(data, at, span):
                return at
            at += 1
        return len(data)


def _decoded(opcode: int, content: bytes) -> Any:
    """Return a record of one of the four kinds that are read; raise one of `_MALFORMED`."""
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.MESSAGE:
        return Message.read(stream, len(content))
    readers = {Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read, Opcode.CHUNK: Chunk.read}
    return readers[Opcode(opcode)](stream)
