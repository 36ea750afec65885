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
Compressed data of recordings, as far as it can be decompressed.

The library `mcap` decompresses complete chunks only; of a chunk that was cut off the first part
is needed too.
"""

from collections.abc import Iterator
from typing import Any


def decompress_chunk(data: bytes, compression: str, size: int) -> tuple[bytes, bool]:
    """Return as much of a chunk as comes out, and whether that is all of it."""
    if compression == '':
        return data[:size], len(data) >= size
    out = b''.join(_pieces(data, compression))
    return out[:size], len(out) == size


def _pieces(data: bytes, compression: str) -> Iterator[bytes]:
    """Yield what can be decompressed, until it fails."""
    try:
        if compression == 'zstd':
            decompressor: Any = zstd_module().ZstdDecompressor()
        elif compression == 'lz4':
            from lz4.frame import LZ4FrameDecompressor
            decompressor = LZ4FrameDecompressor()
        else:
            return
        for at in range(0, len(data), 4096):
            yield decompressor.decompress(data[at:at + 4096])
    except (EOFError, RuntimeError, ValueError, OSError, zstd_module().ZstdError):
        return


def zstd_module() -> Any:
    """Return Python's module of Zstandard, or what stands for it before Python 3.14."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    return zstd
