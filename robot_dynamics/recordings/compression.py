# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Compressed data of recordings, decompressed up to a limit.

A compressed file may expand to thousands of times its size. One pass over a file may decompress at
most LARGEST_RATIO times the size of the file on disk, but at least LEAST_LIMIT. The library `mcap`
decompresses complete chunks only; this module decompresses the first part of a truncated chunk.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
import sys
from typing import Any

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError

LEAST_LIMIT = 1 << 28
"""Bytes that any file may expand to."""
LARGEST_RATIO = 200
"""Bytes that each compressed byte of a file may expand to on average."""
_PIECE = 4096


class DecompressionLimitError(RecordingError):
    """A file expands to more than its limit."""


class Budget:
    """The amount of data that one pass over a file may still decompress."""

    def __init__(self, name: str, size: int) -> None:
        """`name` is that of the file in messages, `size` [bytes] its size on disk."""
        self.limit = max(LEAST_LIMIT, LARGEST_RATIO * size)
        """[bytes]"""
        self._name, self._size, self._left = name, size, self.limit

    def most(self, size: int) -> int:
        """Return the number of bytes to decompress of data that should expand to `size` bytes."""
        return max(min(size, self._left), 0) + 1

    def spend(self, count: int) -> None:
        """Count decompressed bytes; raise DecompressionLimitError beyond the limit."""
        self._left -= count
        if self._left < 0:
            raise DecompressionLimitError(
                f'{self._name} has {self._size} bytes and expands to more than {self.limit}, '
                f'expected at most {LARGEST_RATIO} times its size, or {LEAST_LIMIT} bytes; if the '
                'recording is genuine, decompress it first, with zstd -d (a file .zstd) or '
                'ros2 bag convert')

    def decompress(
        self, data: bytes, compression: str = 'zstd', size: int = sys.maxsize - 1,
    ) -> bytes:
        """
        Return the decompressed data; `size` [bytes] is their expected size.

        Raises DecompressionLimitError, and for damaged data the errors of the library.
        """
        if compression == '':
            self.spend(len(data))  # an index may list a chunk many times
            return data
        parts = []
        while True:
            decompressor = _decompressor(compression)
            parts.append(decompressor.decompress(data, self.most(size)))
            self.spend(len(parts[-1]))
            if not decompressor.eof:
                raise EOFError('compressed data ended before their end mark')
            data = decompressor.unused_data or b''
            if not data or compression == 'lz4':
                return b''.join(parts)


_BUDGET: ContextVar[Budget] = ContextVar('budget of the file that rosbags reads')


@contextmanager
def limited(budget: Budget) -> Iterator[None]:
    """Limit the decompression of MCAP chunks by rosbags to a budget, for use in `with`."""
    token = _BUDGET.set(budget)
    try:
        yield
    finally:
        _BUDGET.reset(token)


def limit_rosbags() -> bool:
    """
    Apply the budget of `limited` to rosbags; return whether this version of rosbags permits it.

    rosbags has no limit, so that this function replaces its table of decompressors.
    """
    storage = optional('rosbags.rosbag2.storage_mcap', 'a recording')
    table = getattr(storage, 'DECOMPRESSORS', None)
    if table is None:
        return False
    for compression in ('', 'lz4', 'zstd'):
        usual = table[compression]
        if not hasattr(usual, 'is_limited'):
            table[compression] = _limited(compression, usual)
    return True


def _limited(compression: str, usual: Any) -> Any:
    """Return a decompressor for rosbags; outside `limited` it calls the usual one."""
    def decompress(data: bytes, size: int) -> bytes:
        budget = _BUDGET.get(None)
        if budget is None:
            return bytes(usual(data, size))
        return budget.decompress(data, compression, size)

    decompress.is_limited = True  # type: ignore[attr-defined]
    return decompress


def decompress_chunk(
    data: bytes, compression: str, size: int, budget: Budget,
) -> tuple[bytes, bool]:
    """
    Return the part of a chunk that can be decompressed, and whether it is the whole chunk.

    Raises DecompressionLimitError.
    """
    if compression == '':
        return data[:size], len(data) >= size
    out = b''.join(_pieces(data, compression, budget.most(size)))
    budget.spend(len(out))
    return out[:size], len(out) == size


def _pieces(data: bytes, compression: str, most: int) -> Iterator[bytes]:
    """Yield decompressed data until the decompression fails or has returned `most` bytes."""
    if compression not in ('lz4', 'zstd'):
        return
    try:
        decompressor = _decompressor(compression)
        for at in range(0, len(data), _PIECE):
            piece = decompressor.decompress(data[at:at + _PIECE], most)
            yield piece
            most -= len(piece)
            if most <= 0:
                return
    except (EOFError, MemoryError, RuntimeError, ValueError, OSError, zstd_module().ZstdError):
        return


def _decompressor(compression: str) -> Any:
    if compression == 'zstd':
        return zstd_module().ZstdDecompressor()
    from lz4.frame import LZ4FrameDecompressor
    return LZ4FrameDecompressor()


def zstd_module() -> Any:
    """Return Python's module of Zstandard, or its replacement before Python 3.14."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd
