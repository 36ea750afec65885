# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Contacts: external efforts above a level per joint that grows with the speed, θ = a + b |q̇|.

The levels are learned from a motion without contact, for a promised rate of false alarms. The
line follows the 99 % quantile of the external effort by the speed (R. Koenker and G. Bassett,
"Regression quantiles", Econometrica 46(1), 1978), and is then scaled: the promise, such as one
alarm per hour, lies far beyond a recording of minutes. The largest ratios of effort and line, one
per block of 0.5 s so that they are independent, exceed a threshold u by amounts that are taken
for exponential with their mean m. They occur ν times per second, therefore the scale u + m ln(ν /
rate) is exceeded at the promised rate (peaks over threshold: R. Davison and R. L. Smith, J. Royal
Statistical Society B 52(3), 1990). Errors of Gaussian noise exceed high levels less often than an
exponential law states.

This detects contacts and is no safety function.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.validation import check_scalar

ALARMS_PER_HOUR = 1.0
"""Promised rate of false alarms of all joints together."""
SHORTEST = 60.0
"""[s] of motion from which levels are learned, at least."""
BLOCK = 0.5
"""[s] that a peak and its neighbours take; also the time below all levels that ends a contact."""
OTHER_CAUSES = 'a changed payload, a limit stop or stiction'
_QUANTILE, _PEAKS = 0.99, 20


@dataclass(frozen=True, eq=False)
class ContactLevels:
    """
    The levels of n joints.

    `effort` (n,) [N·m] or [N] is a, 0 for a joint without a level; `per_velocity` (n,) is b, in
    [N·m·s/rad] or [N·s/m].
    """

    effort: FloatArray
    per_velocity: FloatArray

    def at(self, v: FloatArray) -> FloatArray:
        """Return the levels (..., n) at velocities, infinite for joints without a level."""
        level = self.effort + self.per_velocity * np.abs(v)
        return np.where(self.effort > 0.0, level, np.inf)


class Contact(NamedTuple):
    """The joint whose effort exceeds its level most, with both [N·m] or [N]."""

    joint: str
    effort: float
    level: float

    def __str__(self) -> str:
        return (f'external effort at {self.joint!r} is {self.effort:.3g}, level {self.level:.3g}: '
                f'a contact, or {OTHER_CAUSES}')


class ContactDetector:
    """Finds the beginnings of contacts, in states in the order of time."""

    def __init__(self, levels: ContactLevels, joint_names: Sequence[str]) -> None:
        self.levels, self._names = levels, joint_names
        self._left = 0.0

    def update(self, dt: float, v: FloatArray, effort: FloatArray) -> Contact | None:
        """
        Return the contact that begins at a state dt [s] after the previous one, or None.

        `v` and the external `effort` are (n,). A contact lasts until no joint has exceeded its
        level for 0.5 s.
        """
        level = self.levels.at(v)
        j = int(np.argmax(np.abs(effort) / level))
        self._left -= dt
        if abs(effort[j]) <= level[j]:
            return None
        was_on, self._left = self._left > 0.0, BLOCK
        return None if was_on else Contact(self._names[j], float(effort[j]), float(level[j]))


class LearnedLevels(NamedTuple):
    """
    Learned levels, and from what.

    `duration` [s] is that of the motion, `exceeded` (n,) the scale of the levels by the largest
    ratio in this motion: above 1 they are extrapolated.
    """

    levels: ContactLevels
    duration: float
    exceeded: FloatArray


def detection_delay(level: npt.ArrayLike, effort: npt.ArrayLike, bandwidth: float) -> FloatArray:
    """
    Return the delay [s] until a constant external effort is found, infinite for one at its level.

    It is −ln(1 − θ / τ) / K with K = 2π `bandwidth` [Hz]; up to one period of the states adds.
    """
    ratio = np.asarray(level, np.float64) / np.abs(effort)
    with np.errstate(divide='ignore', invalid='ignore'):
        delay = -np.log1p(-ratio) / (2.0 * math.pi * bandwidth)
    return np.where(ratio < 1.0, delay, np.inf)


def learn_contact_levels(
    times: FloatArray, v: FloatArray, effort: FloatArray, joint_names: Sequence[str],
    alarms_per_hour: float = ALARMS_PER_HOUR,
) -> LearnedLevels:
    """
    Return levels for a promised rate of false alarms, from a motion without contact.

    `times` (m,) [s] are increasing and may have gaps; `v` and the external `effort` are (m, n).
    Raises InvalidInputError if the motion is shorter than 60 s, or an effort is constantly 0.
    """
    check_scalar('alarms_per_hour', alarms_per_hour, 0.0, exclusive_minimum=True)
    duration = len(times) * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if duration < SHORTEST:
        raise InvalidInputError(
            f'the motion lasts {duration:.1f} s, expected at least {SHORTEST:g} s without '
            'contact, better 10 minutes')
    rate = alarms_per_hour / 3600.0 / len(joint_names)
    starts = np.flatnonzero(np.diff(np.floor(times / BLOCK), prepend=-1.0))
    levels, exceeded = [], []
    for name, speed, r in zip(joint_names, np.abs(v).T, np.abs(effort).T):
        if not r.any():
            raise InvalidInputError(
                f'the external effort at {name!r} is 0 throughout, expected a measured effort')
        line = _line(speed, r)
        ratio = r / (line[0] + line[1] * speed)
        peaks = np.sort(np.maximum.reduceat(ratio, starts))[::-1]
        u, highest = peaks[_PEAKS], peaks[:_PEAKS]
        scale = u + (highest - u).mean() * max(math.log(_PEAKS / duration / rate), 0.0)
        levels.append(scale * line)
        exceeded.append(scale / peaks[0])
    a, b = np.array(levels).T
    return LearnedLevels(ContactLevels(a, b), duration, np.array(exceeded))


def _line(speed: FloatArray, r: FloatArray) -> FloatArray:
    """Return a > 0 and b >= 0 of the quantile a + b · speed of r: the least pinball loss."""
    def offset(b: float) -> float:
        return max(float(np.quantile(r - b * speed, _QUANTILE)), 1e-3 * float(r.max()))

    def loss(b: float) -> float:
        above = r - b * speed - offset(b)
        return float(np.maximum(_QUANTILE * above, (_QUANTILE - 1.0) * above).mean())

    steepest = 2.0 * float(np.quantile(r, _QUANTILE)) / max(float(np.quantile(speed, 0.9)), 1e-9)
    search = optional('scipy.optimize', 'levels of contacts').minimize_scalar
    b = float(search(loss, bounds=(0.0, steepest), method='bounded').x)
    b = b if loss(b) < loss(0.0) else 0.0
    return np.array([offset(b), b])
