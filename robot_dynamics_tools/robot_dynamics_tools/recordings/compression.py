# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Compressed data of recordings, decompressed up to a limit.

A compressed file may expand to thousands of times its size. One pass over a file may decompress at
most LARGEST_RATIO times the size of the file on disk, but at least LEAST_LIMIT. The chunks of an
MCAP file are decompressed by rosbags, which has no limit.
"""

from typing import Any

from robot_dynamics.exceptions import RecordingError

LEAST_LIMIT = 1 << 28
"""Bytes that any file may expand to."""
LARGEST_RATIO = 200
"""Bytes that each compressed byte of a file may expand to on average."""


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
