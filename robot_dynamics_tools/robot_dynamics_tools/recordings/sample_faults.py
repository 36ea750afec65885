# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Samples that are missing, repeated or out of order in a recording.

These faults are not corrected, but counted with their times. Of several messages with the same
stamp, the first is kept. Of messages out of order, the smallest number is omitted such that the
stamps of the others increase.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, IntArray, NANOSECONDS_PER_SECOND

GAP = 1.5
"""Interval between two samples, in median periods, beyond which samples are missing."""
SHOWN_TIMES = 3
"""Number of times that a report lists; further times are only counted."""


class Gap(NamedTuple):
    """A time span without samples [ns], and the approximate number of missing samples."""

    start_ns: int
    end_ns: int
    missing: int


@dataclass(frozen=True, eq=False)
class SampleFaults:
    """
    The faults of the messages of a series.

    `gaps` are the intervals beyond GAP median periods, `duplicated_ns` the repeated stamps, and
    `backward_ns` the stamps out of order, behind or ahead of their neighbours. `other_joints`,
    `incomplete` and `unreadable` count messages without the wanted joints, without a finite
    number in a field that others have, and with bytes that are no joint state.
    `never_finite` lists fields that only some joints have, such as 'effort of joint2'. With
    `arrival_times` no message had a stamp: the times are those at which they were recorded.
    """

    period_ns: int = 0
    gaps: tuple[Gap, ...] = ()
    duplicated_ns: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    backward_ns: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    other_joints: int = 0
    incomplete: int = 0
    unreadable: int = 0
    never_finite: tuple[str, ...] = ()
    arrival_times: bool = False
    start_ns: int = 0

    @property
    def dropped(self) -> int:
        """Approximate number of missing samples, computed with the median period."""
        return sum(gap.missing for gap in self.gaps)

    def words(self) -> list[str]:
        """Return one line for each kind of fault that occurred, with times since the start."""
        lines = []
        if self.arrival_times:
            lines.append('no stamps: the times are those at which messages were recorded')
        if self.gaps:
            longest = max(self.gaps, key=lambda gap: gap.end_ns - gap.start_ns)
            lines.append(
                f'dropped: about {self.dropped} samples, in '
                f'{counted(len(self.gaps), "gap")} beyond {GAP:g} median periods of '
                f'{1e-6 * self.period_ns:.3g} ms, the longest '
                f'{1e-6 * (longest.end_ns - longest.start_ns):.3g} ms; '
                + self._at([gap.start_ns for gap in self.gaps]))
        for what, stamps in (
                ('duplicated', self.duplicated_ns), ('out of order', self.backward_ns)):
            if len(stamps):
                lines.append(f'{what}: {counted(len(stamps), "sample")} left out; '
                             + self._at(stamps.tolist()))
        for what, count in (
                ('without the wanted joints', self.other_joints),
                ('with a number missing or not finite', self.incomplete),
                ('that cannot be decoded', self.unreadable)):
            if count:
                lines.append(f'left out: {counted(count, "message")} {what}')
        return lines + [f'no finite number: {each}' for each in self.never_finite]

    def _at(self, stamps: Sequence[int]) -> str:
        times = [f'{(stamp - self.start_ns) / NANOSECONDS_PER_SECOND:.3f}'
                 for stamp in stamps[:SHOWN_TIMES]]
        more = len(stamps) - len(times)
        return f'at {", ".join(times)} s' + (f' and {more} more' if more > 0 else '')


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless the count is 1."""
    return f'{count} {noun}{"" if count == 1 else "s"}'


def advancing_and_repeated(stamps: IntArray) -> tuple[BoolArray, BoolArray]:
    """Return which stamps form the longest increasing series, and which are repeated."""
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
    Return the indices of a longest increasing subsequence of distinct values.

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


def gaps_between(stamps: IntArray, periods: IntArray, period: int) -> tuple[Gap, ...]:
    """Return the gaps in increasing stamps, given their differences and the median of these."""
    if period <= 0:
        return ()
    return tuple(
        Gap(int(stamps[i]), int(stamps[i + 1]), max(1, round(int(periods[i]) / period) - 1))
        for i in np.flatnonzero(periods > GAP * period))
