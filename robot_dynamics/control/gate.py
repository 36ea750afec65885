# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
What is known of each joint now: the only place that judges the measured values of a state.

A state that cannot follow the last one, by its stamp or its position, is missing as a whole
(`state_plausibility`). Then each joint is judged.

The velocity of a joint is the measured one as long as it agrees with the positions
(`velocity_agreement`), else the difference quotient d of the positions over SPAN_NS, or over one
period of the states if that is longer: v = (q_k − q_j) / (t_k − t_j) with t_k − t_j ≥ SPAN_NS. It
is late by half of this span (P. R. Bélanger, "Estimation of angular velocity and acceleration from
shaft encoder measurements", IEEE Int. Conf. Robotics and Automation, 1992). No velocity can
therefore drive an arm away, and a wrong judgement costs only bandwidth. If the measured velocities
are so noisy that d permits a higher bandwidth, d is used for all joints (`gain_scaling`).

A joint does not stop between two samples: at a constant deceleration, its last step is at most a
third of the step before. If its position repeats bit by bit although its last two steps, of more
than INCREMENTS, were equal within a factor of 2, and it was faster than REST_SPEED, its sample is
missing, unless a new velocity reports a stop. Until its position changes it moves on with its
last velocity and the acceleration of its reference, so that its error stays as it was. After
STATE_TIMEOUT the joint has no signal: the fault brakes it, and its velocity is assumed to decay
with DECAY, as far as the limits of the effort let the arm brake. A slower joint may stand. It has
no signal if its reference moves on by LEFT where friction cannot hold it, while others move, or if
its velocity, which agreed, repeats as well and would have moved it by FLOOR. If the whole state
repeats in motion, there is no new state; without a command, brakes may hold the arm.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, NANOSECONDS_PER_SECOND, wrap_to_pi
from robot_dynamics.control.gains.gain_scaling import Candidates, LOOP_DELAY
from robot_dynamics.control.gains.oscillation import REST_SPEED
from robot_dynamics.control.laws.error_feedback import DEFAULT_NATURAL_FREQUENCY
from robot_dynamics.control.safety.faults import STATE_TIMEOUT
from robot_dynamics.monitoring.state_plausibility import StatePlausibility, StateVerdict
from robot_dynamics.monitoring.velocity_agreement import AGREEMENT, FLOOR, VelocityAgreement
from robot_dynamics.trajectories.interpolation import Reference

SPAN_NS = round(1e9 * LOOP_DELAY)
"""[ns]: half of it adds to the delay of the loop."""
LEAST_SPAN_NS = SPAN_NS // 4
"""Stamps of a shorter span, after a first state, are too inexact."""
INCREMENTS = 2.5
"""Increments of an encoder, which are the smallest step of its joint so far: a shorter step may be
one in which the joint has stopped."""
LEFT = 0.03
"""[rad] or [m] that the reference of a joint that stands may move, and may be away from it: dry
friction may hold it, and a gearbox may yield."""
DECAY = DEFAULT_NATURAL_FREQUENCY
"""[1/s] with which a lost joint stops: `braking.FAULT_DAMPING` times K_d of the default gains."""
_LOST_NS = round(STATE_TIMEOUT * NANOSECONDS_PER_SECOND)
_PAUSE_NS = NANOSECONDS_PER_SECOND // 2
"""[ns] between two states after which the difference of their positions gives no velocity."""
_MOST = 100
"""Number of stored states within a span."""


class Signals(NamedTuple):
    """
    Position and velocity (n,) in use, the verdict on the state, and both velocities with delays.

    `lost` (n,) marks joints without a signal, None for none. The velocity of a first state is 0.
    """

    q: FloatArray
    v: FloatArray
    verdict: StateVerdict
    candidates: Candidates = ()
    lost: BoolArray | None = None


class Gate:
    """Judges the states of n joints one after the other; for one thread."""

    def __init__(
        self, joint_names: tuple[str, ...], wraps: BoolArray, velocity_limit: FloatArray,
        max_age: float, reference: Callable[[], Reference | None] = lambda: None,
        is_held: Callable[[FloatArray, FloatArray], BoolArray] = (
            lambda q, error: np.zeros(len(q), dtype=bool)),
        is_commanded: Callable[[], bool] = lambda: False,
        choice: Callable[[], int] = lambda: 0,
    ) -> None:
        """
        Take the velocity limits (n,), infinite for none, and the largest age of a state [s].

        `wraps` (n,) marks the continuous joints: their positions may jump by a turn. `reference`
        returns the reference, or None. `is_held` returns at which joints (n,) friction can hold an
        arm at q (n,) with a position error (n,). `is_commanded` returns whether a command moves or
        holds the arm. `choice` returns 0 for the measured velocity, 1 for that of the
        positions.
        """
        self.plausibility = StatePlausibility(joint_names, velocity_limit, max_age, wraps)
        self._reference, self._is_held, self._is_commanded = reference, is_held, is_commanded
        self._choice = choice
        self._wraps, self._any_wraps = wraps, bool(wraps.any())
        self._velocities = VelocityAgreement(velocity_limit)
        self._none: BoolArray = np.zeros(len(wraps), dtype=bool)
        self._measured: FloatArray = np.full(len(wraps), np.nan)
        self._measured_v: FloatArray | None = None
        self._increment: FloatArray = np.full(len(wraps), np.inf)
        """The smallest step (n,) of each joint so far."""
        self.braking: FloatArray | float = 1.0
        """Share (n,) of the damping of a lost joint that the last effort has had."""
        self._first(StateVerdict(False), self._measured)

    def _first(self, verdict: StateVerdict, q: FloatArray) -> Signals:
        """Return the signals at a first state."""
        zero = np.zeros(len(q))
        self._signals = Signals(q, zero, verdict, 2 * ((zero, 0.0),))
        self._ways: deque[tuple[int, FloatArray]] = deque([(verdict.stamp, q)], maxlen=_MOST)
        """Stamps [ns], and the sums (n,) of the steps until then."""
        self._velocities.restart()
        self._steps = ((1.0, zero), (1.0, zero))
        """Durations [s] and lengths (n,) of the last two steps."""
        self._missing_ns = np.zeros(len(q), dtype=np.int64)
        """Time (n,) since the last sample of each joint that is missing, 0 for others."""
        self.plausibility.unseen = zero
        self._lost: BoolArray | None = None
        """Which joints (n,) have no signal, None for none."""
        self.planned = zero
        """The speeds (n,) of an arm that brakes after the loss of a joint."""
        self._left: FloatArray | None = None
        """The reference (n,) when the position of each joint began to repeat."""
        self._claimed = zero
        """Way (n,) that measured velocities state, while they and the positions repeat."""
        self._is_missing = self._is_silent = False
        return self._signals

    @property
    def doubtful(self) -> BoolArray:
        """Whether the measured velocity of each joint is not used, because it is wrong, (n,)."""
        return self._velocities.doubtful

    def take(
        self, stamp_ns: int, q: FloatArray, v: FloatArray | None, clock_ns: int | None = None,
        steady_ns: int | None = None, has_several_publishers: Callable[[], bool] = lambda: False,
    ) -> Signals:
        """
        Return the signals at a state (q, v), each (n,); v is None if it is not measured.

        A state that is not new has the signals of the last one. The times are those of
        `StatePlausibility.judge`, which raises ImplausibleStateError for a missing state.
        """
        verdict = self.plausibility.judge(
            stamp_ns, stamp_ns if clock_ns is None else clock_ns, q, has_several_publishers,
            steady_ns)
        if not verdict.is_new:
            return self._signals._replace(verdict=verdict)
        same, self._measured = q == self._measured, q
        v_before, self._measured_v = self._measured_v, v
        repeats = same.tolist()
        are_all, passed_ns = all(repeats), verdict.stamp - self._ways[-1][0]
        if verdict.restart or (not are_all if self._is_silent else passed_ns > _PAUSE_NS):
            return self._first(verdict, q)
        fast = moves = self._none
        if any(repeats) and (
                self._is_missing or self._signals.v.dot(self._signals.v) > REST_SPEED**2):
            moves = self._moves(v, v_before)
            fast = moves & self._cannot_stand()
        if are_all and fast.any():
            if not self._is_commanded() and (v is None or not v.any()):
                return self._first(verdict, q)
            self._is_silent = True
            return self._signals._replace(verdict=verdict._replace(is_new=False))
        step = q - self._signals.q
        if self._any_wraps and not step.dot(step) <= np.pi**2:
            step = np.where(self._wraps, wrap_to_pi(step), step)
        if self._is_missing or any(repeats) and not are_all:
            reference = None if are_all else self._reference()
            left = self._left_behind(q, same, reference)
            if v is not None and v_before is not None:
                left = left | self._contradicts(1e-9 * passed_ns, same & (v == v_before), v)
            q, step = self._continued(
                passed_ns, q, step, same & (fast | moves & (self._missing_ns > 0)), same & left,
                reference)
        else:
            self._left, self._claimed = None, 0.0 * q
        return self._taken(verdict, 1e-9 * passed_ns, q, v, step)

    def _taken(
        self, verdict: StateVerdict, dt: float, q: FloatArray, v: FloatArray | None,
        step: FloatArray,
    ) -> Signals:
        """Return the signals at a state that follows the last one after a step (n,)."""
        ways, stamp_ns, last_v = self._ways, verdict.stamp, self._signals.v
        ways.append((stamp_ns, ways[-1][1] + step))
        while len(ways) > 2 and stamp_ns - ways[1][0] >= SPAN_NS:
            ways.popleft()
        (begin_ns, begin), (_, end) = ways[0], ways[-1]
        span = (stamp_ns - begin_ns) / NANOSECONDS_PER_SECOND
        d = (end - begin) / span if stamp_ns - begin_ns >= LEAST_SPAN_NS else last_v
        if self._is_missing:
            d = np.where(self._missing_ns > 0, last_v, d)
        used, is_late = (d, True) if v is None else self._velocities.used(
            dt, d, v, step, last_v, self._missing_ns)
        if self._velocities.has_jumped:
            return self._first(verdict._replace(restart='jump'), q)
        self._steps = self._steps[1], (dt, step)
        if not self._is_missing:
            np.minimum(self._increment, np.abs(step), out=self._increment, where=step != 0.0)
        candidates = (used, 0.5 * span if is_late else 0.0), (d, 0.5 * span)
        self._signals = Signals(
            q, candidates[self._choice()][0], verdict, candidates, self._lost)
        return self._signals

    def _moves(self, v: FloatArray | None, before: FloatArray | None) -> BoolArray:
        """Return which joints (n,) have no new velocity that is less than half of the last one."""
        return ~self._none if v is None or before is None else (
            (v == before) | (v == 0.0) | (np.abs(v) > 0.5 * np.abs(self._signals.v)))

    def _cannot_stand(self) -> BoolArray:
        """Return which joints (n,) were too fast in the last two steps to stand now."""
        (dt_before, before), (dt, step) = self._steps
        if dt > 2.0 * dt_before:  # it may have stopped in a gap
            return self._none
        speed, last = np.abs(step) / dt, before * np.sign(step) / dt_before
        return np.asarray(
            (np.minimum(speed, np.abs(self._signals.v)) > REST_SPEED)
            & (speed > 0.5 * last) & (speed < 2.0 * last)
            & (np.abs(step) > INCREMENTS * self._increment) & (self._missing_ns == 0))

    def _left_behind(
        self, q: FloatArray, same: BoolArray, reference: Reference | None,
    ) -> BoolArray:
        """Return which joints (n,) stand although their reference leaves them, and others move."""
        desired, before = None if reference is None else reference.position, self._left
        if desired is None or before is None:
            self._left = desired
            return self._none
        self._left = np.where(same, before, desired)
        left = same & (np.abs(desired - self._left) > LEFT)
        return left & ~self._is_held(q, desired - q) if left.any() else left

    def _contradicts(self, dt: float, repeats: BoolArray, v: FloatArray) -> BoolArray:
        """Return which joints (n,) repeat a velocity with which they cannot stand so long."""
        claimed = max(1.0 - dt / AGREEMENT, 0.0) * self._claimed + dt * np.abs(v)
        self._claimed = np.where(repeats, claimed, 0.0)
        return (self._claimed > FLOOR) & ~self.doubtful

    def _continued(
        self, passed_ns: int, q: FloatArray, step: FloatArray, missing: BoolArray, left: BoolArray,
        reference: Reference | None,
    ) -> tuple[FloatArray, FloatArray]:
        """
        Return positions and steps (n,) with those of `missing` and `left` joints continued.

        The first step of a joint that is found is also that of its last velocity.
        """
        last, dt, was_missing = self._signals, 1e-9 * passed_ns, self._missing_ns > 0
        missing = missing | left
        if not (self._is_missing or missing.any()):
            return q, step
        missing_ns = np.where(left & ~was_missing, _LOST_NS, self._missing_ns)
        self._missing_ns = np.where(missing, missing_ns + passed_ns, 0)
        self._is_missing = bool(missing.any())
        lost = self._missing_ns > _LOST_NS
        if self._lost is None:
            self.planned, self.braking = np.abs(last.v), 1.0
        self._lost = lost if lost.any() else None
        self.plausibility.unseen = self._missing_ns / NANOSECONDS_PER_SECOND
        decay = np.exp(-DECAY * dt * self.braking)
        self.planned = np.max(decay) * self.planned
        v = np.where(lost, decay * last.v, last.v + (
            0.0 if reference is None else dt * reference.acceleration))
        self._signals = last._replace(v=v)
        step = np.where(missing | was_missing, dt * v, step)
        return np.where(missing, last.q + step, q), step
