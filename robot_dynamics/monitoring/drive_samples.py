# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Samples of an arm for the drive check: commanded, reported and needed torque over short intervals.

The torque that the motion between two states needs is the change of the momentum p = M v, and
what gravity and C take meanwhile (the momentum observer, without its filter):

    y = (p₁ − p₀) / T + mean(g − Cᵀ v)

y is the torque of the drive minus dry friction, loads and contacts that the model lacks.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics

START = 0.2
"""[s] after the first motion in which the drives are not known."""
INTERVAL, FIRST_INTERVAL = 0.04, 0.01
"""[s], at least, of a sample, and of one within START."""
LONGEST = 0.1
"""[s] between two states after which the motion between them is not known."""
AGREEMENT = 0.25, 0.75, 0.01
"""
Relative errors of mean velocities with which the first and later samples count, and error at rest.

The last one is in [rad/s] or [m/s]. The velocity of the first state is assumed to be 0.
"""
UNEVEN, FORGETTING = 0.1, 0.9
"""
Error of a velocity by its change, where the acceleration is not constant; and factor per sample of
the largest error beyond it, which is noise.
"""
AT_REST, AT_ONCE = 0.1, 0.04
"""
[rad/s] or [m/s] up to which an arm is at rest at the first command, and [s] in which it then moves
if a drive is wrong: what moves it later are pushes, contacts, or brakes that release it late.
"""
SLOW = 0.02
"""[rad/s] or [m/s] up to which dry friction has any value."""
SMOOTHED = 5
COUNT = 80
"""Samples in the window, at least 2 s."""


class DriveWindow(NamedTuple):
    """
    The last k samples: end t (k,) [s], and torques (k, n) [N·m] or [N].

    `commanded` u is the mean command, `needed` y, `reported` r the report at the begin of the
    sample, NaN without one, `in_force` the command at that time, `gravity` g, `velocity` and
    `acceleration` the mean ones [rad/s, rad/s²] or [m/s, m/s²], `position` that at the end [rad]
    or [m], `inertia` the diagonal of M [kg·m²] or [kg].
    """

    time: FloatArray
    commanded: FloatArray
    needed: FloatArray
    reported: FloatArray
    in_force: FloatArray
    gravity: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    position: FloatArray
    inertia: FloatArray
    error: FloatArray

    def between(self, begin: float, end: float) -> 'DriveWindow':
        """Return the samples that end between two times [s]."""
        chosen = (self.time > begin) & (self.time <= end)
        return DriveWindow(*(values[chosen] for values in self))


class _Begin(NamedTuple):
    """Time, state, momentum, g − Cᵀ v, diagonal of M and g at the begin of an interval."""

    time: float
    q: FloatArray
    v: FloatArray
    momentum: FloatArray
    drift: FloatArray
    inertia: FloatArray
    gravity: FloatArray


class DriveSamples:
    """Takes the states of n joints; for one thread. No sample spans a gap or a restart."""

    def __init__(self, n: int) -> None:
        self._rows = np.full((COUNT, 10, n), np.nan)
        self._error = np.zeros(n)
        self._times = np.zeros(COUNT)
        self.count = 0
        """Number of samples since the first command."""
        self.start = -np.inf
        """Time [s] of the first command."""
        self.moved_first: BoolArray = np.zeros(n, dtype=bool)
        """Which joints (n,) have moved within AT_ONCE after the first one, if it was at rest."""
        self.moved_since = np.inf
        """Time [s] at which the first joint has moved."""
        self._was_at_rest = False
        self.due = -np.inf
        """Time [s] from which a state ends the interval."""
        self.commands: list[FloatArray] = []
        """The commands (n,) of the interval."""
        self.since: list[float] = []
        """From when [s] on they are active."""
        self.last = np.zeros(n), np.zeros(n), np.zeros(n)
        """Commanded and needed torque, and acceleration (n,) of the last sample."""
        self._nothing = np.full(n, np.nan)
        self._report = self._in_force = self.active = self._nothing
        """`active` is the torque of the command (n,) before the interval, NaN without one."""
        self.wants_report = True
        """Whether this interval needs a report."""
        self._first: _Begin | None = None
        self._skips = True

    def begin(self, time: float, v: FloatArray) -> None:
        """Begin at the first command, at a time [s], with velocities v (n,)."""
        self.start, self.count = time, 0
        self._was_at_rest = bool((np.abs(v) < AT_REST).all())
        self.moved_first, self.moved_since = np.zeros_like(self.moved_first), np.inf
        self.restart()
        self._skips = False  # an arm at rest has the velocity 0 of a first state

    def restart(self) -> None:
        """Forget the interval that has begun; the velocity of the next state is not known."""
        self._skips = True
        self._first, self.due = None, -np.inf
        self.commands.clear()
        self.since.clear()

    def report(self, torque: FloatArray) -> None:
        """Take the torque (n,) that the drives report at the begin of the interval."""
        self._report, self._in_force = torque, self.active

    def command(self, time: float, effort: FloatArray) -> None:
        """Take an effort (n,) that is commanded from a time [s] on."""
        self.commands.append(effort)
        self.since.append(time)

    def mean_command(self, time: float) -> FloatArray | None:
        """Return the mean command (n,) of the interval that ends now, None if it has a gap."""
        since = self.since
        if not since or time <= since[0]:
            return None
        passed = [after - at for at, after in zip(since, (*since[1:], time))]
        if min(passed) < 0.0 or max(passed) > LONGEST:
            return None
        return np.asarray(
            np.array(passed) @ np.array(self.commands) / (time - since[0]))

    def take(
        self, time: float, q: FloatArray, v: FloatArray, torque: FloatArray | None,
        dynamics: UncheckedArmDynamics,
    ) -> bool:
        """
        End the interval with a state at a time [s], and begin the next one.

        `torque` (n,) is its mean command at the joints. Returns whether there is a new sample.
        """
        if self._skips:
            self._skips = False
            return False
        first, of_report = self._first, (self._report, self._in_force)
        now = self._begin(time, q, v, dynamics)
        if first is None or torque is None or not 0.0 < time - first.time <= 2.0 * LONGEST:
            return False
        T, mean = time - first.time, 0.5 * (first.v + v)
        moved = (q - first.q) / T
        if self._was_at_rest and time <= min(self.moved_since, self.start + START) + AT_ONCE:
            self.moved_first = self.moved_first | (np.abs(moved) > SLOW)
            if self.moved_first.any():
                self.moved_since = min(self.moved_since, time)
        relative, error = AGREEMENT[0 if self.count == 0 else 1], np.abs(moved - mean)
        noise = error - UNEVEN * np.abs(v - first.v)
        self._error = np.maximum(noise, FORGETTING * self._error)
        if (error > relative * np.abs(moved) + AGREEMENT[2]).any():
            return False  # the velocities are not those of the positions
        y = (now.momentum - first.momentum) / T + 0.5 * (first.drift + now.drift)
        a = (v - first.v) / T
        self._rows[self.count % COUNT] = (
            torque, y, *of_report, now.gravity, mean, a, q, now.inertia, self._error)
        self.last = torque, y, a
        self._times[self.count % COUNT] = time
        self.count += 1
        return True

    def _begin(
        self, time: float, q: FloatArray, v: FloatArray, dynamics: UncheckedArmDynamics,
    ) -> _Begin:
        body, viscous = dynamics.rigid_body, dynamics.friction.viscous
        g, C, M = body.gravity(q), body.coriolis_matrix(q, v), body.mass_matrix(q)
        now = _Begin(time, q, v, M @ v, g - v @ C + viscous * v, M.diagonal(), g)
        self._first, self.wants_report = now, True
        self._report = self._in_force = self._nothing
        self.commands.clear()
        self.since.clear()
        self.due = time - 1e-6 + (
            FIRST_INTERVAL if time < self.settled else INTERVAL)
        return now

    @property
    def settled(self) -> float:
        """The time [s] START after the first motion, or after the first command without one."""
        return START + (self.moved_since if np.isfinite(self.moved_since) else self.start)

    @property
    def moves_at_once(self) -> bool:
        """Whether the first command has moved an arm that was at rest."""
        return self.moved_since <= self.start + AT_ONCE

    def window(self, most: int = COUNT) -> DriveWindow:
        """Return the last samples, at most `most`, in the order of time."""
        k = min(self.count, most, COUNT)
        places = np.arange(self.count - k, self.count) % COUNT
        return DriveWindow(self._times[places], *np.moveaxis(self._rows[places], 1, 0))


def smoothed(acceleration: FloatArray) -> FloatArray:
    """Return the mean accelerations (k, n) of SMOOTHED samples, whose noise moves no load."""
    ones = np.ones(min(SMOOTHED, len(acceleration)))
    count = np.convolve(np.ones(len(acceleration)), ones, 'same')
    return np.stack([np.convolve(a, ones, 'same') / count for a in acceleration.T], axis=1)
