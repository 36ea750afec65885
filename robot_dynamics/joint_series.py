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
A series of joint states: samples on strictly increasing stamps, and what was wrong with the rest.

A recording may have lost messages, have some twice, or out of order. None of that is mended here:
of repeated stamps the first message is kept, of those out of order as few are left out as make
the rest increase, and all of it is counted, with the times.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joint_state_bytes import (
    DecodedJointStates,
    FIELDS,
    IntArray,
    JointStateBlock,
    NANOSECONDS_PER_SECOND,
)
from robot_dynamics.validation import FloatArray, LARGEST_VALUE

GAP = 1.5
"""Median periods between two samples beyond which some are missing."""
SHOWN_TIMES = 3
"""Times that a report names; of more it says how many."""


class Gap(NamedTuple):
    """A time without samples: from one stamp to the next [ns], and about how many are missing."""

    start_ns: int
    end_ns: int
    missing: int


@dataclass(frozen=True, eq=False)
class SampleFaults:
    """
    What was wrong with the messages of a series.

    `gaps` are those beyond GAP median periods; `duplicated_ns` the stamps that came again,
    `backward_ns` those out of order, behind or ahead of the others around them. `other_joints`,
    `incomplete` and `unreadable` count messages without the wanted joints, without a finite
    number in a field that others have, and with bytes that are no joint state. With
    `arrival_times` no message had a stamp: the times are those at which they were recorded.
    """

    message_count: int = 0
    period_ns: int = 0
    gaps: tuple[Gap, ...] = ()
    duplicated_ns: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    backward_ns: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    other_joints: int = 0
    incomplete: int = 0
    unreadable: int = 0
    arrival_times: bool = False
    start_ns: int = 0

    @property
    def dropped(self) -> int:
        """About how many samples are missing, by the median period."""
        return sum(gap.missing for gap in self.gaps)

    def words(self) -> list[str]:
        """Return one line for each kind of fault that there is, with times from the start."""
        lines = []
        if self.arrival_times:
            lines.append('no stamps: the times are those at which messages were recorded')
        if self.gaps:
            longest = max(self.gaps, key=lambda gap: gap.end_ns - gap.start_ns)
            lines.append(
                f'dropped: about {self.dropped} samples, in '
                f'{_counted(len(self.gaps), "gap")} beyond {GAP:g} median periods of '
                f'{1e-6 * self.period_ns:.3g} ms, the longest '
                f'{1e-6 * (longest.end_ns - longest.start_ns):.3g} ms; '
                + self._at([gap.start_ns for gap in self.gaps]))
        for what, stamps in (
                ('duplicated', self.duplicated_ns), ('out of order', self.backward_ns)):
            if len(stamps):
                lines.append(f'{what}: {_counted(len(stamps), "sample")} left out; '
                             + self._at(stamps.tolist()))
        for what, count in (
                ('without the wanted joints', self.other_joints),
                ('with a number missing or not finite', self.incomplete),
                ('that cannot be decoded', self.unreadable)):
            if count:
                lines.append(f'left out: {_counted(count, "message")} {what}')
        return lines

    def _at(self, stamps: Sequence[int]) -> str:
        times = [f'{(stamp - self.start_ns) / NANOSECONDS_PER_SECOND:.3f}'
                 for stamp in stamps[:SHOWN_TIMES]]
        more = len(stamps) - len(times)
        return f'at {", ".join(times)} s' + (f' and {more} more' if more > 0 else '')


def _counted(count: int, noun: str) -> str:
    return f'{count} {noun}{"" if count == 1 else "s"}'


@dataclass(frozen=True, eq=False)
class JointSeries:
    """
    The joint states, or efforts, of one topic: m samples of n joints, in the order of stamp.

    `stamps_ns` (m,) are strictly increasing. `position`, `velocity` and `effort` are (m, n)
    [rad or m, per second, N·m or N], or None where no message has the field. `passed_over` counts
    messages left out: other joints, a stamp twice or out of order, or a field that is missing,
    not finite or beyond LARGEST_VALUE while others have it; `faults` says which.
    """

    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None
    passed_over: int
    faults: SampleFaults = field(default_factory=SampleFaults)

    @property
    def times(self) -> FloatArray:
        """Seconds since the first sample, (m,)."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND)

    def first(self, seconds: float) -> 'JointSeries':
        """Return the samples of the first so many seconds."""
        rows = np.arange(int(np.searchsorted(self.times, seconds, side='right')))
        return self._chosen(rows, np.arange(len(self.joint_names)))

    def after(self, count: int) -> 'JointSeries':
        """Return the samples without so many first ones."""
        rows = np.arange(count, len(self.stamps_ns))
        return self._chosen(rows, np.arange(len(self.joint_names)))

    def at(self, rows: npt.NDArray[np.intp]) -> 'JointSeries':
        """Return the samples at these places."""
        return self._chosen(rows, np.arange(len(self.joint_names)))

    def of_joints(self, joint_names: Sequence[str]) -> 'JointSeries':
        """Return the samples of these joints, in this order."""
        columns = np.array([self.joint_names.index(name) for name in joint_names], dtype=np.intp)
        return self._chosen(np.arange(len(self.stamps_ns)), columns)

    def _chosen(self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> (
            'JointSeries'):
        def chosen(values: FloatArray | None) -> FloatArray | None:
            return None if values is None else np.asarray(values[np.ix_(rows, columns)])

        return replace(
            self, joint_names=tuple(self.joint_names[i] for i in columns),
            stamps_ns=self.stamps_ns[rows], position=chosen(self.position),
            velocity=chosen(self.velocity), effort=chosen(self.effort))


@dataclass(frozen=True, eq=False)
class RecordedJointStates:
    """
    All messages of a topic, before joints are chosen.

    `times_ns` (m,) are those at which messages were recorded; `source` names topic and recording
    in errors.
    """

    source: str
    times_ns: IntArray
    decoded: DecodedJointStates

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Every joint that a message names, in the order of their first mention."""
        blocks = sorted(self.decoded.blocks, key=lambda block: int(block.rows[0]))
        return tuple(dict.fromkeys(name for block in blocks for name in block.joint_names))

    def together(self, joint_names: Sequence[str]) -> tuple[str, ...]:
        """Return most of these joints that one message has, in this order."""
        sets = [tuple(name for name in joint_names if name in block.joint_names)
                for block in self.decoded.blocks]
        return max(sets, key=len, default=())

    def renamed(self, names: Mapping[str, str]) -> 'RecordedJointStates':
        """Return the same with other names for some joints, {recorded: new}."""
        blocks = tuple(
            block._replace(joint_names=tuple(names.get(name, name) for name in block.joint_names))
            for block in self.decoded.blocks)
        return replace(self, decoded=self.decoded._replace(blocks=blocks))

    def series(self, joint_names: Sequence[str] = ()) -> JointSeries:
        """
        Return the samples of these joints, in this order; empty means those of the first message.

        Times are the header stamps, or those of the recording where all stamps are zero. Raises
        RecordingError where no message has these joints, or a whole sample of them.
        """
        blocks = sorted(self.decoded.blocks, key=lambda block: int(block.rows[0]))
        names = tuple(joint_names or (blocks[0].joint_names if blocks else ()))
        fitting = [block for block in blocks if names and set(names) <= set(block.joint_names)]
        if not fitting:
            raise RecordingError(
                f'{self.source} has no message with all of the joints {list(names)}; '
                f'it has {sorted(self.joint_names)}')
        rows = np.concatenate([block.rows for block in fitting])
        order = np.argsort(rows)
        rows = rows[order]
        stamps = np.concatenate([block.stamps_ns for block in fitting])[order]
        arrival_times = not stamps.any()
        if arrival_times:
            stamps = self.times_ns[rows]
        columns = {f: _column(fitting, f, names)[order] for f in FIELDS}
        return self._kept(names, stamps, columns, arrival_times)

    def _kept(
        self, names: tuple[str, ...], stamps: IntArray, columns: Mapping[str, FloatArray],
        arrival_times: bool,
    ) -> JointSeries:
        """Return the series of what advances and is finite, and count the rest."""
        finite = {f: (np.abs(values) <= LARGEST_VALUE).all(axis=1)  # nor is NaN
                  for f, values in columns.items()}
        fields = [f for f in FIELDS if finite[f].any()]
        whole = np.logical_and.reduce([finite[f] for f in fields]) if fields else (
            np.zeros(len(stamps), dtype=np.bool_))
        if not whole.any():
            raise RecordingError(
                f'no message of {self.source} has all its fields finite at the joints '
                f'{list(names)}')
        places = np.flatnonzero(whole)
        advancing, repeated = _advancing(stamps[whole])
        keep = places[advancing]
        kept = stamps[keep]
        count = len(self.times_ns)
        periods = np.diff(kept)
        period = int(np.median(periods)) if len(periods) else 0
        faults = SampleFaults(
            message_count=count, period_ns=period, gaps=_gaps(kept, periods, period),
            duplicated_ns=stamps[places[repeated]],
            backward_ns=stamps[places[~advancing & ~repeated]],
            other_joints=count - len(stamps) - len(self.decoded.unreadable),
            incomplete=int((~whole).sum()),
            unreadable=len(self.decoded.unreadable), arrival_times=arrival_times,
            start_ns=int(kept[0]))

        def chosen(name: str) -> FloatArray | None:
            return columns[name][keep] if name in fields else None

        return JointSeries(
            names, kept, chosen('position'), chosen('velocity'), chosen('effort'),
            count - len(kept), faults)


def _column(blocks: Sequence[JointStateBlock], name: str, joints: Sequence[str]) -> FloatArray:
    """Return a field of the joints, (m, n), with NaN where messages do not have it."""
    parts = []
    for block in blocks:
        values: FloatArray | None = getattr(block, name)
        index = [block.joint_names.index(joint) for joint in joints]
        parts.append(np.full((len(block.rows), len(joints)), np.nan) if values is None
                     else values[:, index])
    return np.concatenate(parts)


def _advancing(stamps: IntArray) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return which stamps make the longest increasing series, and which came before."""
    repeated = np.zeros(len(stamps), dtype=np.bool_)
    if (np.diff(stamps) > 0).all():
        return ~repeated, repeated
    repeated[:] = True
    repeated[np.unique(stamps, return_index=True)[1]] = False
    places = np.flatnonzero(~repeated)
    advancing = np.zeros(len(stamps), dtype=np.bool_)
    advancing[places[_longest_increasing(stamps[places].tolist())]] = True
    return advancing, repeated


def _longest_increasing(values: Sequence[int]) -> list[int]:
    """
    Return the places of a longest increasing subsequence of distinct values.

    Source: M. L. Fredman, *Discrete Mathematics* 11(1), 1975: patience sorting, m log m steps.
    """
    ends: list[int] = []
    places: list[int] = []
    before: list[int] = []
    for place, value in enumerate(values):
        length = bisect_left(ends, value)
        before.append(places[length - 1] if length else -1)
        if length == len(ends):
            ends.append(value)
            places.append(place)
        else:
            ends[length], places[length] = value, place
    chain = [places[-1]]
    while before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return chain[::-1]


def _gaps(stamps: IntArray, periods: IntArray, period: int) -> tuple[Gap, ...]:
    if period <= 0:
        return ()
    return tuple(
        Gap(int(stamps[i]), int(stamps[i + 1]), max(1, round(int(periods[i]) / period) - 1))
        for i in np.flatnonzero(periods > GAP * period))
