# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A series of joint states: samples with increasing stamps, and the faults of the others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray, NANOSECONDS_PER_SECOND
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.validation import LARGEST_VALUE
from robot_dynamics_tools.recordings import sample_faults
from robot_dynamics_tools.recordings.messages import FIELDS, RecordedState

BRAKES_LAST = 0.06
"""[s] of zero effort between two samples with effort that are interpreted as brakes."""
LONGEST_HOLE = 0.05
"""Longest gap [s] that is bridged, unless `LONGEST_HOLE_SAMPLES` median periods are longer."""
LONGEST_HOLE_SAMPLES = 2.5


@dataclass(frozen=True, eq=False)
class JointSeries:
    """
    The joint states, or efforts, of one topic: m samples of n joints, in the order of stamps.

    `stamps_ns` (m,) are strictly increasing. `position`, `velocity` and `effort` are (m, n)
    [rad or m, per second, N·m or N], or None if no message has the field. `passed_over` counts
    the omitted messages: other joints, a repeated stamp or one out of order, or a field that is
    missing, not finite or beyond LARGEST_VALUE while other messages have it; `faults` lists them.
    """

    joint_names: tuple[str, ...]
    stamps_ns: IntArray
    position: FloatArray | None
    velocity: FloatArray | None
    effort: FloatArray | None
    passed_over: int
    faults: sample_faults.SampleFaults = field(default_factory=sample_faults.SampleFaults)

    @property
    def times(self) -> FloatArray:
        """Seconds since the first sample, (m,)."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) / NANOSECONDS_PER_SECOND)

    def first(self, seconds: float) -> 'JointSeries':
        """Return the samples of the first `seconds` [s]."""
        return self.at(np.arange(int(np.searchsorted(self.times, seconds, side='right'))))

    def stretches(self) -> list[IntArray]:
        """Return the rows of each stretch of samples without a gap."""
        periods = np.diff(self.times)
        if not len(periods):
            return [np.arange(len(self.stamps_ns))]
        longest = max(LONGEST_HOLE, LONGEST_HOLE_SAMPLES * float(np.median(periods)))
        return np.split(np.arange(len(self.stamps_ns)), np.flatnonzero(periods > longest) + 1)

    def unwrapped(self, is_continuous: BoolArray) -> 'JointSeries':
        """
        Return the samples without steps of whole turns at continuous joints (`angle_wrapping`).

        `is_continuous` is (n,). Each stretch without a gap begins at its recorded position,
        because the turns during a gap are not known.
        """
        if self.position is None:
            return self
        return replace(self, position=np.concatenate([
            np.where(is_continuous, np.unwrap(each, axis=0), each) for each in (
                self.position[rows] for rows in self.stretches())]))

    def driven(self) -> 'JointSeries':
        """
        Return the samples without those in which brakes hold the arm.

        Brakes are recognised by an effort of exactly zero at every joint: at the beginning, at the
        end, or for BRAKES_LAST seconds in between. If no effort was measured, all are returned.
        """
        if self.effort is None or not self.effort.any():
            return self
        is_driven = np.asarray(self.effort.any(axis=1))
        edges = np.flatnonzero(np.diff(is_driven)) + 1
        runs = np.split(np.arange(len(is_driven)), edges)
        kept = [
            rows for rows in runs if is_driven[rows[0]] or (
                rows[0] > 0 and rows[-1] < len(is_driven) - 1
                and self.times[rows[-1] + 1] - self.times[rows[0] - 1] <= BRAKES_LAST)]
        return self.at(np.concatenate(kept))

    def at(self, rows: IntArray) -> 'JointSeries':
        """Return the samples at these rows."""
        return replace(self, stamps_ns=self.stamps_ns[rows], **self._each(lambda x: x[rows]))

    def of_joints(self, joint_names: Sequence[str]) -> 'JointSeries':
        """Return the samples of these joints, in this order."""
        columns = [self.joint_names.index(name) for name in joint_names]
        return replace(self, joint_names=tuple(joint_names), **self._each(lambda x: x[:, columns]))

    def _each(self, chosen: Callable[[FloatArray], FloatArray]) -> dict[str, Any]:
        """Return what `chosen` returns of each recorded field."""
        return {name: chosen(values) for name in FIELDS
                if (values := getattr(self, name)) is not None}


@dataclass(frozen=True, eq=False)
class RecordedJointStates:
    """
    All messages of a topic, before joints are chosen.

    `unreadable` is the number of further messages, which could not be read; `source` names topic
    and recording in errors.
    """

    source: str
    states: tuple[RecordedState, ...]
    unreadable: int

    @property
    def layouts(self) -> tuple[tuple[str, ...], ...]:
        """The names of joints that occur in one message, in the order of the first message."""
        return tuple(dict.fromkeys(state.joint_names for state in self.states))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Every joint that a message names, in the order of their first mention."""
        return tuple(dict.fromkeys(name for layout in self.layouts for name in layout))

    def together(self, joint_names: Sequence[str]) -> tuple[str, ...]:
        """Return the largest set of these joints that one message contains, in this order."""
        sets = [tuple(name for name in joint_names if name in layout) for layout in self.layouts]
        return max(sets, key=len, default=())

    def renamed(self, names: Mapping[str, str]) -> 'RecordedJointStates':
        """Return the same with other names for some joints, {recorded: new}."""
        return replace(self, states=tuple(
            state._replace(joint_names=tuple(names.get(name, name) for name in state.joint_names))
            for state in self.states))

    def _joined(self, joint_names: tuple[str, ...]) -> JointSeries:
        """
        Return the messages with most of these joints, with all of them, those of others between.

        A value is interpolated from the messages before and after, at most two periods apart.
        """
        together = set(self.together(joint_names))
        stamps = np.array([
            state.time_ns for state in self.states if together <= set(state.joint_names)])
        return self._kept(joint_names, stamps, {field: np.stack([
            self._between(stamps, name, field) for name in joint_names], axis=1)
            for field in FIELDS}, False)

    def _between(self, stamps_ns: IntArray, name: str, field: str) -> FloatArray:
        """Return a field of a joint at these stamps (m,), NaN where its messages are apart."""
        own = [(state.time_ns, state.values[field][state.joint_names.index(name)])
               for state in self.states if name in state.joint_names and field in state.values]
        if len(own) < 2:
            return np.full(len(stamps_ns), np.nan)
        times, values = np.array(sorted(own)).T
        after = np.clip(np.searchsorted(times, stamps_ns), 1, len(times) - 1)
        is_far = times[after] - times[after - 1] > 2.5 * np.median(np.diff(times))
        return np.where(is_far & ~np.isin(stamps_ns, times), np.nan, np.interp(
            stamps_ns, times, values, left=np.nan, right=np.nan))

    def series(self, joint_names: Sequence[str] = ()) -> JointSeries:
        """
        Return the samples of these joints, in this order; empty means those of the first message.

        Times are the header stamps, or the recording times if all stamps are zero. Joints that
        come in several messages are interpolated. Raises RecordingError if no message has a joint,
        or a complete sample.
        """
        names = tuple(joint_names or next(iter(self.layouts), ()))
        if set(names) <= set(self.joint_names) and len(self.together(names)) < len(names):
            return self._joined(names)
        places = {layout: np.array([layout.index(name) for name in names])
                  for layout in self.layouts if names and set(names) <= set(layout)}
        states = [state for state in self.states if state.joint_names in places]
        if not states:
            raise RecordingError(
                f'{self.source} has no message with the joints '
                f'{[name for name in names if name not in self.joint_names]}; it has '
                f'{sorted(self.joint_names)}')
        stamps = np.array([state.stamp_ns for state in states], dtype=np.int64)
        arrival_times = not stamps.any()
        if arrival_times:
            stamps = np.array([state.recorded_ns for state in states], dtype=np.int64)
        nothing = np.full(len(names), np.nan)
        columns = {field: np.array([
            state.values[field][places[state.joint_names]] if field in state.values else nothing
            for state in states], dtype=np.float64) for field in FIELDS}
        return self._kept(names, stamps, columns, arrival_times)

    def _kept(
        self, names: tuple[str, ...], stamps: IntArray, columns: Mapping[str, FloatArray],
        arrival_times: bool,
    ) -> JointSeries:
        """Return the series of the finite samples with increasing stamps, and count the others."""
        finite = {f: (np.abs(values) <= LARGEST_VALUE).all(axis=1)  # False for NaN
                  for f, values in columns.items()}
        fields = [f for f in FIELDS if finite[f].any()]
        whole = np.logical_and.reduce([finite[f] for f in fields]) if fields else (
            np.zeros(len(stamps), dtype=np.bool_))
        if not whole.any():
            raise RecordingError(
                f'no message of {self.source} has all its fields finite at the joints '
                f'{list(names)}')
        places = np.flatnonzero(whole)
        advancing, repeated = sample_faults.advancing_and_repeated(stamps[whole])
        keep = places[advancing]
        kept = stamps[keep]
        count = len(self.states) + self.unreadable
        faults = sample_faults.SampleFaults(
            sample_faults.fault_lines(
                kept, stamps[places[repeated]], stamps[places[~advancing & ~repeated]], {
                    'without the wanted joints': len(self.states) - len(stamps),
                    'with a number missing or not finite': int((~whole).sum()),
                    'that cannot be decoded': self.unreadable}),
            tuple(
                f'{field_name} of {name}' for field_name, values in columns.items()
                if np.isfinite(values).any() for name, column in zip(names, values.T)
                if not np.isfinite(column).any()), arrival_times)

        position, velocity, effort = (columns[f][keep] if f in fields else None for f in FIELDS)
        return JointSeries(names, kept, position, velocity, effort, count - len(kept), faults)
