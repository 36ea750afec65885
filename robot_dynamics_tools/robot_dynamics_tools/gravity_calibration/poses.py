# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Poses for the calibration of gravity: informative, within the limits, in a short order.

The poses are D-optimal: they maximise the determinant of the information on the scale and the
offset of each joint, and on the first moments of the last body, for equal relative noise of the
joints. They are chosen from random candidates one after the other, and exchanged while the
determinant grows: V. V. Fedorov, *Theory of Optimal Experiments*, Academic Press 1972, chapter 3.
Collisions are not checked.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.worst_gravity import search_box
from robot_dynamics.validation import check_vector
from robot_dynamics_tools.gravity_calibration.holds import per_joint
from robot_dynamics_tools.gravity_calibration.scale_fit import gravity_regressor, Observations

COUNTS = 8, 20
"""Smallest and largest number of poses."""
APPROACH_DISTANCE = 0.1, 0.02
"""Distance [rad], [m] from which a pose is approached, on both sides."""
POSITION_MARGIN = 0.05
"""Fraction of the position range that stays free at each limit, in addition to the approach."""
EFFORT_FRACTION = 0.6
"""Largest gravity torque in a pose, as a fraction of the effort limit."""
CANDIDATES = 400
_DRAWS = 10
"""Rounds of CANDIDATES random positions that may be drawn to find enough candidates."""
_PRIOR = 1e-4
"""Information on each parameter before the first pose, relative to that of a typical pose."""
_EXCHANGES = 3


class CalibrationPoses(NamedTuple):
    """Positions (count, n) [rad] or [m] in order, and the gravity torque (count, n) there."""

    positions: FloatArray
    gravity: FloatArray


def approach_distance(arm: ArmModel) -> FloatArray:
    """Return the distance (n,) [rad] or [m] from which each joint approaches a pose."""
    return per_joint(APPROACH_DISTANCE, arm.joint_kinds)


def select_poses(
    arm: ArmModel, count: int = 12, lower: npt.ArrayLike | None = None,
    upper: npt.ArrayLike | None = None, seed: int = 0,
) -> CalibrationPoses:
    """
    Return `count` poses within the position limits, and within `lower` and `upper` (n,) if given.

    The approach from both sides is within the limits of the arm, and within these bounds. The
    gravity torque of the arm, with its payloads, is at most EFFORT_FRACTION of the effort limits.
    Raises InvalidInputError for a count outside of COUNTS, and if bounds or limits permit no
    pose.
    """
    if not COUNTS[0] <= count <= COUNTS[1]:
        raise InvalidInputError(f'count is {count}, expected {COUNTS[0]} to {COUNTS[1]} poses')
    low, high = _bounds(arm, lower, upper)
    positions, gravity = _candidates(arm, low, high, count, np.random.default_rng(seed))
    chosen = _d_optimal(_information_rows(arm, positions, gravity), count)
    order = _short_order(positions[chosen], 0.5 * (low + high))
    return CalibrationPoses(positions[chosen][order], gravity[chosen][order])


def _bounds(
    arm: ArmModel, lower: npt.ArrayLike | None, upper: npt.ArrayLike | None,
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest position of a pose, (n,) each."""
    low, high = search_box(arm)
    margin = np.where(np.isfinite(arm.limits.upper - arm.limits.lower),
                      POSITION_MARGIN * (high - low), 0.0)
    low, high = low + margin, high - margin
    names, n = arm.joint_names, arm.joint_count
    if lower is not None:
        low = np.maximum(low, check_vector('lower', lower, n, names))
    if upper is not None:
        high = np.minimum(high, check_vector('upper', upper, n, names))
    low, high = low + approach_distance(arm), high - approach_distance(arm)
    for j in np.flatnonzero(low > high):
        raise InvalidInputError(
            f'the joint {names[j]!r} has the bounds {low[j]:.3g} and {high[j]:.3g} for a pose, '
            f'expected a range of more than {2.0 * approach_distance(arm)[j]:g} for the approach '
            'from both sides within the limits')
    return low, high


def _candidates(
    arm: ArmModel, low: FloatArray, high: FloatArray, count: int, rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return positions (m, n) whose gravity torque (m, n) is permitted."""
    q, g = np.zeros((2, 0, arm.joint_count))
    for _ in range(_DRAWS):
        drawn = rng.uniform(low, high, (CANDIDATES, arm.joint_count))
        gravity = RigidBody(arm).gravity_batch(drawn)
        good = (np.abs(gravity) <= EFFORT_FRACTION * arm.limits.effort).all(axis=1)
        q, g = np.concatenate([q, drawn[good]]), np.concatenate([g, gravity[good]])
        if len(q) >= CANDIDATES:
            break
    if len(q) < count:
        raise InvalidInputError(
            f'{len(q)} of {_DRAWS * CANDIDATES} random poses need at most '
            f'{100.0 * EFFORT_FRACTION:g} % of the effort limits, expected {count}: choose bounds '
            'in which the arm bears less, or a lighter weight')
    return q[:CANDIDATES], g[:CANDIDATES]


def _information_rows(arm: ArmModel, q: FloatArray, gravity: FloatArray) -> FloatArray:
    """Return the Jacobian (m, n, 2n + 3) of the effort, each column of size 1."""
    seen = Observations(gravity, gravity, gravity_regressor(arm, q)[:, :, -3:], gravity == gravity)
    exact = np.concatenate([np.ones(arm.joint_count), np.zeros(arm.joint_count + 3)])
    J = np.stack([seen.rows(j).jacobian(exact) for j in range(arm.joint_count)], axis=1)
    limit = arm.limits.effort  # the noise of each joint is proportional to it
    noise = np.where(
        np.isfinite(limit) & (limit > 0.0), limit, np.maximum(np.abs(gravity).max(axis=0), 1e-9))
    J *= 1.0 / noise[:, None]
    size = np.sqrt((J**2).sum(axis=1).mean(axis=0))
    return np.asarray(np.divide(J, size, out=np.zeros_like(J), where=size > 1e-9 * size.max()))


def _d_optimal(J: FloatArray, count: int) -> list[int]:
    """Return the rows of J (m, n, k) with the largest determinant of Σ Jᵀ J."""
    information = _PRIOR * np.eye(J.shape[2])
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(_best(J, information, chosen))
        information += J[chosen[-1]].T @ J[chosen[-1]]
    for _ in range(_EXCHANGES):
        before = list(chosen)
        for i, old in enumerate(before):
            information -= J[old].T @ J[old]
            chosen[i] = _best(J, information, chosen[:i] + chosen[i + 1:])
            information += J[chosen[i]].T @ J[chosen[i]]
        if chosen == before:
            break
    return chosen


def _best(J: FloatArray, information: FloatArray, taken: list[int]) -> int:
    """Return the row that increases the determinant most: |M + JᵀJ| = |M| |1 + J M⁻¹ Jᵀ|."""
    gain = np.linalg.slogdet(
        np.eye(J.shape[1]) + J @ np.linalg.inv(information) @ J.transpose(0, 2, 1))[1]
    gain[taken] = -np.inf
    return int(gain.argmax())


def _short_order(q: FloatArray, start: FloatArray) -> list[int]:
    """Return an order (count,) of positions: from `start`, always the nearest one."""
    left, order, here = list(range(len(q))), [], start
    while left:
        nearest = min(left, key=lambda i: float(np.abs(q[i] - here).max()))
        left.remove(nearest)
        order.append(nearest)
        here = q[nearest]
    return order
