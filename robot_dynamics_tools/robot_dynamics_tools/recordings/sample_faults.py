# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Samples that are missing, repeated or out of order in a recording.

These faults are not corrected, but counted with their times. Of several messages with the same
stamp, the first is kept. Of messages out of order, the smallest number is omitted such that the
stamps of the others increase.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, IntArray, NANOSECONDS_PER_SECOND

GAP = 1.5
"""Interval between two samples, in median periods, beyond which samples are missing."""
SHOWN_TIMES = 3
"""Number of times that a report lists; further times are only counted."""


@dataclass(frozen=True)
class SampleFaults:
    """
    The faults of the messages of a series, as lines of text.

    `never_finite` lists fields that only some joints have, such as 'effort of joint2'. With
    `arrival_times` no message had a stamp: the times are those at which they were recorded.
    """

    lines: tuple[str, ...] = ()
    never_finite: tuple[str, ...] = ()
    arrival_times: bool = False

    def words(self) -> list[str]:
        """Return one line for each kind of fault that occurred, with times since the start."""
        unstamped = ['no stamps: the times are those at which messages were recorded']
        return [*(unstamped if self.arrival_times else []), *self.lines,
                *(f'no finite number: {each}' for each in self.never_finite)]


def fault_lines(
    stamps: IntArray, duplicated: IntArray, backward: IntArray, left_out: Mapping[str, int],
) -> tuple[str, ...]:
    """
    Return one line for each kind of fault of a series with these increasing stamps (m,) [ns].

    Gaps are intervals beyond GAP median periods. `duplicated` and `backward` are the stamps that
    are repeated, and out of order; `left_out` counts other messages by their fault.
    """
    def at(faulty: IntArray) -> str:
        times = [f'{t:.3f}' for t in (faulty[:SHOWN_TIMES] - stamps[0]) / NANOSECONDS_PER_SECOND]
        more = len(faulty) - len(times)
        return f'at {", ".join(times)} s' + (f' and {more} more' if more > 0 else '')

    lines, periods = [], np.diff(stamps)
    period = int(np.median(periods)) if len(periods) else 0
    gaps = np.flatnonzero(periods > GAP * period)
    if len(gaps):
        missing = np.maximum(1, np.round(periods[gaps] / period) - 1).sum()
        lines.append(
            f'dropped: about {missing:.0f} samples, in {counted(len(gaps), "gap")} beyond {GAP:g} '
            f'median periods of {1e-6 * period:.3g} ms, the longest '
            f'{1e-6 * periods.max():.3g} ms; {at(stamps[gaps])}')
    lines += [f'{what}: {counted(len(faulty), "sample")} left out; {at(faulty)}'
              for what, faulty in (('duplicated', duplicated), ('out of order', backward))
              if len(faulty)]
    return (*lines, *(f'left out: {counted(count, "message")} {what}'
                      for what, count in left_out.items() if count))


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
