# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged serialized messages: truncated, with wrong element counts, or with random bytes."""

from collections.abc import Iterator
import random
import struct

from rclpy.serialization import deserialize_message

HEAD = 4
"""Length of the encapsulation before the data [bytes]."""
LIES = (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0x20000000, 100_000_000, 1_000_000)
"""Element counts that no message of the tests has."""


def is_readable(data: bytes, message_type: type) -> bool:
    """Return whether rclpy can deserialize these bytes."""
    try:
        deserialize_message(data, message_type)
    except Exception:  # the exception type of rclpy
        return False
    return True


def cut_short(data: bytes, message_type: type) -> Iterator[bytes]:
    """Yield the message truncated to every length that is too short."""
    for length in range(HEAD, len(data)):
        if is_readable(data[:length], message_type):
            return
        yield data[:length]


def with_lies(data: bytes) -> Iterator[bytes]:
    """Yield the message with each word of four bytes replaced by a wrong element count."""
    for at in range(HEAD, len(data) - 3, 4):
        for lie in LIES:
            yield data[:at] + struct.pack('<I', lie) + data[at + 4:]


def with_noise(data: bytes, count: int, seed: int = 1) -> Iterator[bytes]:
    """Yield the message with one to eight bytes replaced by random ones."""
    rng = random.Random(seed)
    for _ in range(count):
        noisy = bytearray(data)
        for _ in range(rng.randint(1, 8)):
            noisy[rng.randrange(HEAD, len(data))] = rng.randrange(256)
        yield bytes(noisy)


def noise(count: int, seed: int = 2) -> Iterator[bytes]:
    """Yield up to 200 random bytes, every other time after the header of a message."""
    rng = random.Random(seed)
    for i in range(count):
        yield (b'', b'\x00\x01\x00\x00')[i % 2] + rng.randbytes(rng.randrange(HEAD, 200))
