# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The feedback of position and velocity errors along a reference.

Source: B. Siciliano et al., *Robotics: Modelling, Planning and Control*, Springer 2009, section
8.5.2 (inverse dynamics control): with
τ = M(q)(q̈_ref + K_d ė + K_p e) + C(q, q̇) q̇ + g(q) + friction and an exact model, the error
e = q_ref − q obeys ë + K_d ė + K_p e = 0 at each joint, independently of the other joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, wrap_angle, wrap_to_pi
from robot_dynamics.control.gains.gain_scaling import USUAL_FREQUENCY
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Segment
from robot_dynamics.validation import check_per_joint, LARGEST_VALUE

DEFAULT_NATURAL_FREQUENCY = USUAL_FREQUENCY
"""[rad/s]"""
DEFAULT_DAMPING_RATIO = 1.0
LEAST_DAMPING = 0.3
"""Damping ratio below which a tracking error oscillates for several periods."""


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of n joints: `kp` (n,) [1/s²] on the position, `kd` (n,) [1/s] on the velocity."""

    kp: FloatArray
    kd: FloatArray

    @cached_property
    def change(self) -> FloatArray:
        """Return K_p + K_d² (n,) [1/s²]: the rate of the feedback per error of the velocity."""
        with np.errstate(over='ignore'):
            return np.asarray(self.kp + self.kd**2)

    @cached_property
    def ratio(self) -> FloatArray:
        """Return K_p/K_d (n,) [1/s], 0 where K_d is 0."""
        with np.errstate(over='ignore'):
            return np.divide(
                self.kp, self.kd, out=np.zeros_like(self.kp), where=self.kd > 0.0)


def make_gains(
    joint_names: Sequence[str],
    natural_frequency: npt.ArrayLike = DEFAULT_NATURAL_FREQUENCY,
    damping_ratio: npt.ArrayLike = DEFAULT_DAMPING_RATIO,
) -> Gains:
    """
    Return gains from ω [rad/s] and ζ per joint: K_p = ω², K_d = 2 ζ ω.

    Each is one number for all joints, or one value per joint. Raises InvalidInputError for another
    number of values, a negative value or one beyond LARGEST_VALUE, and a ζ below LEAST_DAMPING.
    """
    omega = per_joint('gains.natural_frequency', natural_frequency, joint_names)
    zeta = per_joint('gains.damping_ratio', damping_ratio, joint_names)
    if (zeta < LEAST_DAMPING).any():
        raise InvalidInputError(
            f'gains.damping_ratio is {zeta.tolist()}, expected at least {LEAST_DAMPING:g}: the '
            'tracking error would oscillate')
    return Gains(omega**2, 2.0 * zeta * omega)


def per_joint(field: str, value: npt.ArrayLike, joint_names: Sequence[str]) -> FloatArray:
    """Return non-negative values (n,), from one number for all joints or one value per joint."""
    values = check_per_joint(field, value, joint_names, LARGEST_VALUE)
    if (values < 0.0).any():
        raise InvalidInputError(f'{field} is {values.tolist()}, expected no value below 0')
    return values


class Tracking(NamedTuple):
    """
    The feedback at one state, each (n,).

    `acceleration` is q̈_ref + K_d ė + K_p e [rad/s² or m/s²]. `velocity` is q̇_ref [rad/s or m/s],
    and `error` is e, at which friction is compensated. `exceeds_limit` is true if the error of a
    joint exceeds its limit. `largest` is the largest |ė|.
    """

    acceleration: FloatArray
    velocity: FloatArray
    error: FloatArray
    exceeds_limit: bool
    largest: float


class ErrorFeedback:
    """
    The commanded acceleration q̈_ref + K_d ė + K_p e along a trajectory; for one thread.

    The position error of a continuous joint is the shortest angular distance. The feedback is
    computed joint by joint: for the few joints of an arm, plain floats take half of the time of
    arrays, and less on a control path, where the code of numpy is not in the cache.
    """

    def __init__(
        self, gains: Gains, joint_kinds: Sequence[str], largest_error: FloatArray | None = None,
    ) -> None:
        """`largest_error` (n,) [rad] or [m] is the limit of the position error, None: no limit."""
        self.gains = gains
        self.largest_error = (
            np.full(len(gains.kp), np.inf) if largest_error is None else largest_error)
        self._turns = [kind == 'continuous' for kind in joint_kinds]
        self._continuous = np.array(self._turns) if any(self._turns) else None
        self._reference: ActiveTrajectory | None = None
        self._segment: Segment | None = None
        self._joints: list[Any] = []

    def track(
        self, reference: ActiveTrajectory, now_ns: int, q: FloatArray, v: FloatArray,
    ) -> Tracking:
        """Return the feedback at the state (q, v), each (n,), at `now_ns`."""
        segment = self._segment
        if reference is not self._reference or segment is None or not (
                segment.since_ns <= now_ns < segment.end_ns):
            segment = self._take_segment(reference, now_ns)
        s = 1e-9 * (now_ns - segment.begin_ns) / segment.duration
        acceleration, velocity, error, exceeds_limit, largest = [], [], [], False, 0.0
        for ((p0, p1, p2, p3, p4, p5), (d0, d1, d2, d3, d4, _), (dd0, dd1, dd2, dd3, _, _),
             K_p, K_d, turns, e_max), q_j, v_j in zip(
                self._joints, q.tolist(), v.tolist()):
            e = p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5)))) - q_j
            if turns and not -pi < e <= pi:
                e = wrap_angle(e)
            if not -e_max <= e <= e_max:
                exceeds_limit = True
            v_ref = d0 + s * (d1 + s * (d2 + s * (d3 + s * d4)))
            e_dot = v_ref - v_j
            acceleration.append(
                dd0 + s * (dd1 + s * (dd2 + s * dd3)) + K_d * e_dot + K_p * e)
            velocity.append(v_ref)
            error.append(e)
            if not -largest <= e_dot <= largest:
                largest = abs(e_dot)
        return Tracking(
            np.array(acceleration), np.array(velocity), np.array(error), exceeds_limit, largest)

    def _take_segment(self, reference: ActiveTrajectory, now_ns: int) -> Segment:
        """Prepare the segment that is active at `now_ns`."""
        segment = reference.segment(now_ns)
        n = len(self.gains.kp)
        position, velocity, acceleration = (
            segment.coefficients[:, k * n:(k + 1) * n].T.tolist() for k in range(3))
        self._joints = list(zip(
            position, velocity, acceleration, self.gains.kp.tolist(), self.gains.kd.tolist(),
            self._turns, self.largest_error.tolist()))
        self._reference, self._segment = reference, segment
        return segment

    def position_error(self, reference: FloatArray, q: FloatArray) -> FloatArray:
        """Return q_ref − q, (n,) [rad] or [m]."""
        e = reference - q
        if self._continuous is not None and not e.dot(e) <= np.pi**2:
            e = np.where(self._continuous, wrap_to_pi(e), e)
        return e

    def worst_error(self, e: FloatArray, joint_names: Sequence[str]) -> str:
        """Return which position error (n,) is the largest by its limit, with both values."""
        limit = self.largest_error
        j = int(np.argmax(np.abs(e) / limit))
        return (f'position of {joint_names[j]!r} is {abs(e[j]):.3g} from its reference, '
                f'expected at most {limit[j]:.3g} (following_error_limit)')

    def scaled(self, scale: FloatArray | float) -> 'ErrorFeedback':
        """Return the feedback at these fractions (n,) of its bandwidth, at the same damping."""
        gains = Gains(scale**2 * self.gains.kp, scale * self.gains.kd)
        kinds = ['continuous' if turns else '' for turns in self._turns]
        return ErrorFeedback(gains, kinds, self.largest_error)
