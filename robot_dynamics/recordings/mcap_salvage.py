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
A damaged MCAP file, read record by record as far as that goes.

A file that was cut off has no footer and no index: its records are read one after another from
the beginning, and of the last chunk as much as can be decompressed. Where a chunk fails its
checksum or cannot be decompressed, the next one is gone on with. Source: the MCAP format
specification, version 0 (records 0x03 schema, 0x04 channel, 0x05 message, 0x06 chunk).
"""

from collections.abc import Iterator
from pathlib import Path
import struct
from typing import Any, BinaryIO, NamedTuple
import zlib

from robot_dynamics.recordings.compression import decompress_chunk
from robot_dynamics.recordings.loss import Loss

MAGIC = b'\x89MCAP0\r\n'
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 1, 2, 3, 4, 5, 6, 15
_IN_CHUNKS = (_SCHEMA, _CHANNEL, _MESSAGE)
_LAST_OPCODE = 0x0F
_RECORD = struct.Struct('<BQ')
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_CHUNK_HEAD = struct.Struct('<QQQI')
_TAIL = struct.Struct('<BQQQI8s')
"""The footer, and the magic behind it."""
_LARGEST_CHUNK = 1 << 32
"""[bytes]; what says more is noise."""


class Channel(NamedTuple):
    """A topic of the file; `definition` is the text of its type, empty where it was lost."""

    topic: str
    message_type: str
    definition: str
    encoding: str


class SalvagedMcap:
    """What is left of an MCAP file; `losses` are known once it is made."""

    def __init__(self, path: Path) -> None:
        """Read through the file once; raise OSError."""
        self.path = path
        self.losses: list[Loss] = []
        self.channels: dict[int, Channel] = {}
        self.counts: dict[str, int] = {}
        self._schemas: dict[int, tuple[str, str, str]] = {}
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
        """Read the descriptions of topics that a whole file repeats at its end."""
        with self.path.open('rb') as file:
            size = file.seek(0, 2)
            file.seek(max(size - _TAIL.size, 0))
            tail = file.read()
            if len(tail) < _TAIL.size:
                return
            code, length, begin, _, _, magic = _TAIL.unpack(tail)
            if (code, length, magic) != (_FOOTER, 20, MAGIC) or not 0 < begin < size:
                return
            file.seek(begin)
            data = file.read(size - _TAIL.size - begin)
        at = 0
        while at + _RECORD.size <= len(data):
            code, length = _RECORD.unpack_from(data, at)
            body = data[at + _RECORD.size:at + _RECORD.size + length]
            if code in (_SCHEMA, _CHANNEL):
                for _ in self._record(code, body, True, begin + at):
                    pass
            at += _RECORD.size + length

    def _lose(self, reason: str, **figures: Any) -> None:
        if not self._quiet:
            self.losses.append(Loss(self.path.name, reason, **figures))

    def _messages(self) -> Iterator[tuple[Channel, int, bytes]]:
        size = self.path.stat().st_size
        with self.path.open('rb') as file:
            if size == 0:
                self._lose('is empty')
                return
            if file.read(len(MAGIC)) != MAGIC:
                self._lose('does not begin as an MCAP file', lost_bytes=size)
                return
            yield from self._records(file, size)

    def _records(self, file: BinaryIO, size: int) -> Iterator[tuple[Channel, int, bytes]]:
        ended = False
        newest: int | None = None
        while (start := file.tell()) < size:
            head = file.read(_RECORD.size)
            code, length = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, size)
            if code in (_DATA_END, _FOOTER) and start + _RECORD.size + length <= size:
                ended = True
                break
            if len(head) == _RECORD.size and not 0 < code <= _LAST_OPCODE:
                self._lose(f'no record at byte {start}: the rest cannot be read',
                           lost_bytes=size - start, start_ns=newest)
                return
            whole = start + _RECORD.size + length <= size
            if code in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
                body = file.read(min(length, size))
                for message in self._record(code, body, whole, start):
                    newest = message[1]
                    yield message
            if not whole:
                self._lose(f'cut off inside the record at byte {start}', start_ns=newest)
                return
            file.seek(start + _RECORD.size + length)
        if not ended:
            self._lose('cut off after a whole record: no end and no index', start_ns=newest)

    def _record(
        self, code: int, body: bytes, whole: bool, start: int,
    ) -> Iterator[tuple[Channel, int, bytes]]:
        if code == _CHUNK:
            yield from self._chunk(body, whole, start)
        elif not whole:
            return
        elif code == _MESSAGE and len(body) >= _MESSAGE_HEAD.size:
            number, _, time_ns, _ = _MESSAGE_HEAD.unpack_from(body)
            if number in self.channels:
                yield self.channels[number], time_ns, body[_MESSAGE_HEAD.size:]
            else:
                self._unknown += 1
        elif code in (_SCHEMA, _CHANNEL):
            try:
                self._describe(code, body)
            except (struct.error, UnicodeDecodeError, IndexError):
                self._lose(f'the description of a topic at byte {start} cannot be read')

    def _describe(self, code: int, body: bytes) -> None:
        (number,) = struct.unpack_from('<H', body)
        if code == _SCHEMA:
            name, at = _text(body, 2)
            encoding, at = _text(body, at)
            self._schemas[number] = name, encoding, _text(body, at)[0]
            return
        (schema,) = struct.unpack_from('<H', body, 2)
        topic, at = _text(body, 4)
        name, encoding, definition = self._schemas.get(schema, ('', '', ''))
        self.channels[number] = Channel(topic, name, definition, encoding)
        self.counts.setdefault(topic, 0)

    def _chunk(
        self, body: bytes, whole: bool, start: int,
    ) -> Iterator[tuple[Channel, int, bytes]]:
        try:
            first, last, size, crc = _CHUNK_HEAD.unpack_from(body)
            compression, at = _text(body, _CHUNK_HEAD.size)
        except (struct.error, UnicodeDecodeError):
            if whole:
                self._lose(f'a chunk at byte {start} cannot be read', lost_bytes=len(body))
            return
        data, sound = decompress_chunk(body[at + 8:], compression, min(size, _LARGEST_CHUNK))
        times = {'start_ns': first, 'end_ns': last} if 0 < first <= last else {}
        if whole and not sound:
            self._lose(f'the chunk at byte {start} cannot be decompressed ({compression}) from '
                       f'byte {len(data)} of {size} on', lost_bytes=size - len(data), **times)
        elif whole and crc and zlib.crc32(data) != crc:
            self._lose(f'the chunk at byte {start} fails its checksum: all of it is left out',
                       lost_bytes=len(body), **times)
            return
        yield from self._records_of_chunk(data, whole and sound, start, (first, last))

    def _records_of_chunk(
        self, data: bytes, complete: bool, start: int, span: tuple[int, int],
    ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages in a chunk; noise between them is passed over."""
        at, newest = 0, None
        while at + _RECORD.size <= len(data):
            code, length = _RECORD.unpack_from(data, at)
            end = at + _RECORD.size + length
            if end > len(data) or code not in _IN_CHUNKS or (
                    code == _MESSAGE and not self._is_message(data, at, span)):
                found = self._next_message(data, at + 1, span)
                if complete or found < len(data):
                    self._lose(f'no record at byte {at} of the chunk at byte {start}',
                               lost_bytes=found - at, start_ns=newest)
                at = found
                continue
            for message in self._record(code, data[at + _RECORD.size:end], True, start):
                newest = message[1]
                yield message
            at = end

    def _is_message(self, data: bytes, at: int, span: tuple[int, int]) -> bool:
        """Tell whether what is there looks like a message of this chunk."""
        if at + _RECORD.size + _MESSAGE_HEAD.size > len(data):
            return False
        _, length = _RECORD.unpack_from(data, at)
        number, _, time_ns, _ = _MESSAGE_HEAD.unpack_from(data, at + _RECORD.size)
        return (number in self.channels and span[0] <= time_ns <= span[1]
                and _MESSAGE_HEAD.size <= length <= len(data) - at - _RECORD.size)

    def _next_message(self, data: bytes, at: int, span: tuple[int, int]) -> int:
        """Return where the next record is that looks like a message of this chunk."""
        while (at := data.find(bytes([_MESSAGE]), at)) >= 0:
            if self._is_message(data, at, span):
                return at
            at += 1
        return len(data)


def _text(body: bytes, at: int) -> tuple[str, int]:
    """Return the string at a place, and where it ends."""
    (length,) = struct.unpack_from('<I', body, at)
    end = at + 4 + int(length)
    if end > len(body):
        raise struct.error('string beyond its record')
    return body[at + 4:end].decode(), end
