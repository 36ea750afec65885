# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Static holds in a recording, and the side from which each joint arrived at them.

Dry friction at rest has the sign of the last motion. The mean of two holds of one pose, one
approached in the positive and one in the negative direction, therefore contains no dry friction.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.joint_series import JointSeries

LEAST_DURATION = 1.0
"""Shortest duration [s] of a hold."""
SETTLING = 0.3
"""First part [s] of a hold that the mean effort excludes."""
BLOCK = 0.2
"""
Samples are averaged over this time [s] to find the holds.

The mean effort excludes the last one, in which the next motion may begin.
"""
LONGEST_GAP = 0.5
"""A gap between samples [s] that ends a hold."""
REST_SPEED = 0.01, 0.002
"""Largest speed at rest [rad/s], [m/s]."""
LARGEST_DRIFT = 0.01, 0.002
"""Largest change of position during a hold [rad], [m]."""
APPROACH = 0.005, 0.001
"""A joint approaches a hold if it comes from at least this distance [rad], [m]."""
LARGEST_OVERSHOOT = 0.002, 0.0004
"""An approach with a larger overshoot [rad], [m] has no side, because the last motion reverses."""
POSE_TOLERANCE = 0.05, 0.01
"""Holds belong to one pose if no position differs by more [rad], [m]."""


class Hold(NamedTuple):
    """
    An arm at rest from `start` to `end` [s] of the recording.

    `position`, `effort` and `approach` are (n,): mean position [rad] or [m], mean effort of the
    driver on the joint side [N·m] or [N], and the direction of the motion to the hold, +1 or −1;
    0 if the joint did not move, or overshot.
    """

    start: float
    end: float
    position: FloatArray
    effort: FloatArray
    approach: IntArray


class PairedHolds(NamedTuple):
    """
    Holds, of which P poses were approached from both sides by at least one joint.

    `weights` (P, n, H) are those of the H holds in the mean at each pose and joint, half for each
    side, and 0 for joints that did not approach the pose from both sides. `times` (P,) [s] are
    those of the first hold of each pose.
    """

    holds: tuple[Hold, ...]
    weights: FloatArray
    times: FloatArray

    @property
    def is_paired(self) -> BoolArray:
        """Marks the joints that approached a pose from both sides, (P, n)."""
        return np.asarray(self.weights.any(axis=2))

    @property
    def positions(self) -> FloatArray:
        """Positions (H, n) of the holds [rad] or [m]."""
        return np.array([hold.position for hold in self.holds])

    @property
    def effort(self) -> FloatArray:
        """Mean effort (P, n) of both sides [N·m] or [N]; 0 if not paired."""
        return self.mean(np.array([hold.effort for hold in self.holds]))

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the means (P, n, …) of both sides, of values (H, n, …) at the holds."""
        return np.asarray(np.einsum('pjh,hj...->pj...', self.weights, values))


def per_joint(values: tuple[float, float], joint_kinds: Sequence[str]) -> FloatArray:
    """Return the value of each joint, (n,), of those for revolute and prismatic joints."""
    return np.array([values[kind == 'prismatic'] for kind in joint_kinds])


def find_holds(series: JointSeries, joint_kinds: Sequence[str]) -> list[Hold]:
    """
    Return the holds in joint states with effort.

    Raises RecordingError if position or effort is missing.
    """
    if series.position is None or series.effort is None:
        missing = 'effort' if series.position is not None else 'position'
        raise RecordingError(f'the recording has no {missing}, expected joint states with it')
    found: list[Hold] = []
    gaps = np.flatnonzero(np.diff(series.times) > LONGEST_GAP) + 1
    for rows in np.split(np.arange(len(series.times)), gaps):
        found += _of_part(
            series.times[rows], series.position[rows], series.effort[rows], joint_kinds)
    return found


def _of_part(
    times: FloatArray, position: FloatArray, effort: FloatArray, joint_kinds: Sequence[str],
) -> list[Hold]:
    """Return the holds in samples without a gap."""
    found: list[Hold] = []
    drift = per_joint(LARGEST_DRIFT, joint_kinds)
    after = 0
    for rows in _rests(times, position, per_joint(REST_SPEED, joint_kinds)):
        used = rows[(times[rows] >= times[rows[0]] + SETTLING)
                    & (times[rows] <= times[rows[-1]] - BLOCK)]
        if times[rows[-1]] - times[rows[0]] < LEAST_DURATION:
            continue
        means = [position[used[block]].mean(axis=0) for block in _blocks(times[used])]
        if (np.ptp(means, axis=0) > drift).any():
            continue
        q = position[used].mean(axis=0)
        found.append(Hold(
            float(times[rows[0]]), float(times[rows[-1]]), q, effort[used].mean(axis=0),
            _approach(position[after:used[0]] - q, joint_kinds)))
        after = rows[-1]
    return found


def _blocks(times: FloatArray) -> list[IntArray]:
    """Return the rows of each block of BLOCK seconds."""
    number = np.floor((times - times[0]) / BLOCK + 1e-9).astype(np.int64)
    return np.split(np.arange(len(times)), np.flatnonzero(np.diff(number)) + 1)


def _rests(times: FloatArray, position: FloatArray, speed: FloatArray) -> list[IntArray]:
    """Return the rows of each interval in which no joint is faster than `speed` (n,)."""
    blocks = _blocks(times)
    if len(blocks) < 2:
        return []
    middle = np.array([times[rows].mean() for rows in blocks])
    mean = np.array([position[rows].mean(axis=0) for rows in blocks])
    is_slow = np.abs(np.diff(mean, axis=0)) <= speed * np.diff(middle)[:, None]
    rests = np.asarray(is_slow.all(axis=1))
    runs = np.split(np.arange(len(rests)), np.flatnonzero(np.diff(rests)) + 1)
    return [np.concatenate(blocks[run[0]:run[-1] + 2]) for run in runs if rests[run[0]]]


def _approach(distance: FloatArray, joint_kinds: Sequence[str]) -> IntArray:
    """
    Return the direction (n,) in which each joint moved to a hold.

    `distance` (m, n) is the position relative to the hold, from the previous hold on.
    """
    least = per_joint(APPROACH, joint_kinds)
    overshoot = per_joint(LARGEST_OVERSHOOT, joint_kinds)
    found = np.zeros(len(least), dtype=np.int64)
    for j, way in enumerate(distance.T):
        far = np.flatnonzero(np.abs(way) > least[j])
        if not far.size:
            continue
        direction = -int(np.sign(way[far[-1]]))
        if (direction * way[far[-1]:]).max() <= overshoot[j]:
            found[j] = direction
    return found


def by_pose(holds: Sequence[Hold], tolerance: FloatArray) -> list[list[int]]:
    """Return the indices of the holds of each pose, which differ by at most `tolerance` (n,)."""
    poses: list[list[int]] = []
    for h, hold in enumerate(holds):
        near = [pose for pose in poses
                if (np.abs(holds[pose[0]].position - hold.position) <= tolerance).all()]
        if near:
            near[0].append(h)
        else:
            poses.append([h])
    return poses


def pair_holds(holds: Sequence[Hold], joint_kinds: Sequence[str]) -> PairedHolds:
    """Return the holds with their poses, of those that a joint approached from both sides."""
    tolerance = per_joint(POSE_TOLERANCE, joint_kinds)
    found, times = [], []
    for pose in by_pose(holds, tolerance):
        sides = np.array([holds[h].approach for h in pose])
        ups, downs = (sides == 1).sum(axis=0), (sides == -1).sum(axis=0)
        weights = np.zeros((len(tolerance), len(holds)))
        for j in np.flatnonzero(ups * downs):
            weights[j, pose] = 0.5 * ((sides[:, j] == 1) / ups[j] + (sides[:, j] == -1) / downs[j])
        if weights.any():
            found.append(weights)
            times.append(holds[pose[0]].start)
    return PairedHolds(
        tuple(holds), np.array(found).reshape(-1, len(tolerance), len(holds)), np.array(times))
