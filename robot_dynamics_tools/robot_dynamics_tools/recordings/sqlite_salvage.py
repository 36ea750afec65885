# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A damaged sqlite3 file of rosbag2, read page by page as far as possible.

A truncated database cannot be opened in the ordinary way, because its header counts more pages
than the file has. Its rows are found by their ids: if a row cannot be read, the next readable row
is found by doubling the step, and then by bisection.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
import sqlite3
from urllib.parse import quote

from robot_dynamics_tools.recordings.loss import Loss
from robot_dynamics_tools.recordings.topics import RecordedTopic, TopicQos

MAGIC = b'SQLite format 3\0'
_SMALLEST_ROW = 32
"""Smallest size [bytes] of a message with its numbers in the database; bounds their count."""


class SalvagedSqlite:
    """The readable part of a sqlite3 file; complete after construction."""

    def __init__(self, path: Path) -> None:
        """Read through the file once; raise OSError."""
        self._path = path
        self.losses: list[Loss] = []
        self.topics: list[RecordedTopic] = []
        self._types: dict[int, tuple[str, str]] = {}
        self._lost_rows = 0
        self._missing_from: int | None = None
        self._missing_to: int | None = None
        size = path.stat().st_size
        if size == 0:
            self.losses.append(Loss(path.name, 'is empty'))
            return
        with path.open('rb') as file:
            head = file.read(100)
        if head[:16] != MAGIC or len(head) < 100:
            self.losses.append(Loss(
                path.name, 'does not begin as a sqlite3 database', lost_bytes=size))
            return
        page = int.from_bytes(head[16:18], 'big')
        stated = int.from_bytes(head[28:32], 'big') * (65536 if page == 1 else page)
        self._most_rows = max(stated, size) // _SMALLEST_ROW
        self._survey(stated - size)

    def _survey(self, missing_bytes: int) -> None:
        try:
            with closing(self._connect()) as connection:
                self._types = {
                    number: (str(name), str(kind)) for number, name, kind in connection.execute(
                        'SELECT id, name, type FROM topics') if isinstance(number, int)}
        except sqlite3.Error as error:
            self.losses.append(Loss(
                self._path.name, f'its list of topics cannot be read ({error})',
                lost_bytes=self._path.stat().st_size))
            return
        counts = Counter(topic for topic, _, _ in self._rows())
        self.topics = [RecordedTopic(name, kind, counts[number], TopicQos())
                       for number, (name, kind) in self._types.items()]
        if missing_bytes > 0 or self._lost_rows:
            reason = 'cut off' if missing_bytes > 0 else 'has pages that cannot be read'
            self.losses.append(Loss(
                self._path.name, reason, lost_bytes=missing_bytes if missing_bytes > 0 else None,
                lost_messages=None if missing_bytes > 0 else self._lost_rows,
                start_ns=self._missing_from, end_ns=self._missing_to))

    def messages(self, topic: str) -> list[tuple[int, bytes]]:
        """Return the times [ns] and bytes of all messages of a topic that can be read."""
        numbers = {number for number, (name, _) in self._types.items() if name == topic}
        return [(time_ns, data) for number, time_ns, data in self._rows() if number in numbers]

    def _connect(self) -> sqlite3.Connection:
        # Read the file as it is, without repair and without a journal.
        connection = sqlite3.connect(
            f'file:{quote(str(self._path.resolve()))}?immutable=1', uri=True)
        connection.execute('PRAGMA writable_schema=ON')  # opens a truncated database
        return connection

    def _rows(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield topic, time and data of all rows that can be read, in the order of their ids."""
        self._lost_rows, begin = 0, 0
        newest: int | None = None
        with closing(self._connect()) as connection:
            top = self._last_id(connection)
            while True:
                after = begin - 1
                try:
                    for number, topic, time_ns, data in connection.execute(
                            'SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? '
                            'ORDER BY id', (begin,)):
                        if not isinstance(number, int) or number <= after:
                            raise sqlite3.DatabaseError('pages that refer to earlier pages')
                        after = number
                        if not (isinstance(data, bytes) and isinstance(time_ns, int)
                                and isinstance(topic, int)):
                            self._lost_rows += 1
                            continue
                        if self._lost_rows and self._missing_to is None:
                            self._missing_to = time_ns
                        newest = time_ns
                        yield topic, time_ns, data
                    return
                except sqlite3.Error:
                    self._missing_from = newest if self._missing_from is None else (
                        self._missing_from)
                    found = self._next_readable(connection, max(after, begin), top)
                    if found is None:
                        self._missing_to = None
                        return
                    self._lost_rows += found - after - 1
                    begin = found

    def _last_id(self, connection: sqlite3.Connection) -> int:
        try:
            return int(connection.execute('SELECT max(id) FROM messages').fetchone()[0] or 0)
        except sqlite3.Error:
            return self._most_rows

    def _next_readable(self, connection: sqlite3.Connection, after: int, top: int) -> int | None:
        """Return the next id beyond `after` whose row can be read, or None."""
        def is_readable(number: int) -> bool:
            try:
                return connection.execute(
                    'SELECT data FROM messages WHERE id = ?', (number,)).fetchone() is not None
            except sqlite3.Error:
                return False

        candidates = [after + 2**k for k in range(max(top - after, 0).bit_length())]
        found = next(filter(is_readable, [*candidates, top]), None)
        if found is None or found <= after:
            return None
        last_bad = max([after, *(number for number in candidates if number < found)])
        ids = range(last_bad + 1, found + 1)
        return ids[bisect_left(ids, True, key=is_readable)]
