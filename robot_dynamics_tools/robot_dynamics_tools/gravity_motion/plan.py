# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The plan of a calibration motion: poses in their order, each approached from both sides.

A pose q is reached from q + δ and then from q − δ, so that dry friction acts in both directions
at the same position. A displacement that is larger than the step is divided into several moves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, wrap_to_pi
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools.excitation.demo_motion import rest_to_rest_seconds
from robot_dynamics_tools.gravity_calibration.holds import per_joint
from robot_dynamics_tools.gravity_calibration.poses import approach_distance

SHORTEST_HOLD = 1.5
"""[s]: the calculation needs LEAST_DURATION, which it measures in blocks."""
LONGEST_HOLD = 600.0
"""[s]"""
VELOCITY_SHARE = 0.5
"""Largest used share of a joint's velocity limit."""
APPROACH_VELOCITY = 0.1
"""Share of the velocity for the last move to a pose: dry friction keeps its sign if no joint
overshoots."""
LARGEST_TURN = 1.5
"""[rad]: largest step of a continuous joint, for which the node takes the shortest angle."""
APPROACH_SHARE = 0.05
"""Largest default of the approach, as a share of the position range."""


class MotionSettings(NamedTuple):
    """
    How the arm moves.

    `hold` [s]: rest at a pose. The others are for all joints, [rad] or [m], velocity per second;
    None is the default of the kind of joint. `approach`: distance δ from which a pose is
    approached. `step`: largest displacement of a move. `tolerance`: largest distance between a
    measured position and its goal.
    """

    hold: float = 2.0
    approach: float | None = None
    step: float | None = None
    velocity: float | None = None
    tolerance: float | None = None


class Move(NamedTuple):
    """A motion from rest to rest at `goal` (n,), its duration [s], and the hold [s] after it."""

    goal: FloatArray
    duration: float
    hold: float


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """
    The poses (m, n) in their order, and the limits of the motion of each joint, (n,).

    The motion begins at `start` (n,), the measured position within a turn around 0. All goals of a
    continuous joint are within the range of its poses, so that it does not wind up.
    """

    arm: ArmModel
    start: FloatArray
    poses: FloatArray
    hold: float
    approach: FloatArray
    step: FloatArray
    velocity: FloatArray
    tolerance: FloatArray

    def moves(self) -> Iterator[tuple[int, Move]]:
        """Yield the moves in their order, each with the index of its pose."""
        here = self.start
        for i, pose in enumerate(self.poses):
            for side in (1.0, -1.0):
                aside = pose + side * self.approach
                for goal in (*self._steps(here, aside), pose):
                    velocity, hold = (self.velocity, 0.0) if goal is not pose else (
                        APPROACH_VELOCITY * self.velocity, self.hold)
                    yield i, Move(goal, rest_to_rest_seconds(goal - here, velocity), hold)
                    here = goal

    @property
    def seconds(self) -> float:
        """Duration [s] of all moves and holds."""
        return sum(move.duration + move.hold for _, move in self.moves())

    def _steps(self, here: FloatArray, goal: FloatArray) -> Iterator[FloatArray]:
        way = goal - here
        count = max(1, int(np.ceil(np.max(np.abs(way) / self.step, initial=0.0) - 1e-9)))
        for k in range(1, count):
            yield here + k / count * way
        yield goal


def make_plan(
    arm: ArmModel, start: FloatArray, poses: FloatArray, settings: MotionSettings,
) -> MotionPlan:
    """
    Return the plan for `poses` (m, n) from the measured position `start` (n,).

    Raises InvalidInputError for a setting that is not positive.
    """
    hold = check_scalar('--hold', settings.hold, SHORTEST_HOLD, LONGEST_HOLD)
    velocity = _given_or((0.5, 0.1), arm, '--velocity', settings.velocity)
    velocity = np.minimum(velocity, VELOCITY_SHARE * arm.limits.velocity)
    step = _given_or((0.5, 0.1), arm, '--step', settings.step)
    step = np.where(arm.is_continuous, np.minimum(step, LARGEST_TURN), step)
    return MotionPlan(
        arm, within_a_turn(arm, start), poses, hold, approach_of(arm, settings.approach), step,
        velocity, _given_or((0.2, 0.05), arm, '--tolerance', settings.tolerance))


def approach_of(arm: ArmModel, given: float | None) -> FloatArray:
    """Return δ (n,), by default `approach_distance`, at most 0.05 of the position range."""
    if given is not None:
        return _given_or((0.0, 0.0), arm, '--approach', given)
    span = arm.limits.upper - arm.limits.lower
    return np.minimum(approach_distance(arm), APPROACH_SHARE * span)


def position_bounds(
    arm: ArmModel, ranges: Sequence[Sequence[str]], approach: FloatArray, is_finite: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """
    Return the bounds (n,) of poses, so that pose ± δ is within the limits and the given ranges.

    `ranges` are JOINT, MIN, MAX as texts. With `is_finite`, a joint without position limits moves
    within one turn, or 1 m, around 0. Raises InvalidInputError.
    """
    reach = per_joint((np.pi, 1.0) if is_finite else (np.inf, np.inf), arm.joint_kinds)
    low = np.where(np.isfinite(arm.limits.lower), arm.limits.lower, -reach)
    high = np.where(np.isfinite(arm.limits.upper), arm.limits.upper, reach)
    for name, *texts in ranges:
        if name not in arm.joint_names:
            raise InvalidInputError(
                f'--range has joint {name!r}, expected one of: {", ".join(arm.joint_names)}')
        j = arm.joint_names.index(name)
        least, most = (
            check_scalar(f'--range of {name}', _number(text), float(low[j]), float(high[j]))
            for text in texts)
        low[j], high[j] = least, most
    low, high = low + approach, high - approach
    for j in np.flatnonzero(low > high)[:1]:
        raise InvalidInputError(
            f'the range of {arm.joint_names[j]} is [{low[j] - approach[j]:g}, '
            f'{high[j] + approach[j]:g}], expected one of at least {2.0 * approach[j]:g}: the '
            'approach from both sides')
    return low, high


def within_a_turn(arm: ArmModel, position: FloatArray) -> FloatArray:
    """Return a position (n,) with continuous joints in (−π, π]."""
    return np.where(arm.is_continuous, wrap_to_pi(position), position)


def _given_or(
    defaults: tuple[float, float], arm: ArmModel, option: str, given: float | None,
) -> FloatArray:
    """Return the value of each joint (n,); the defaults are as those of `per_joint`."""
    if given is None:
        return per_joint(defaults, arm.joint_kinds)
    return np.full(arm.joint_count, check_scalar(option, given, 0.0, 1e3, exclusive_minimum=True))


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
