# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The efforts along a trajectory, and their comparison with the limits of the arm."""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.segments import TrajectorySegments

INTERVALS = 32
"""Intervals per segment, unless the joints move far or there are many segments."""
LEAST_INTERVALS = 4
"""Intervals per segment in a trajectory of very many segments."""
STEP = 0.1
"""Mean motion [rad] or [m] of all joints together in one interval of a segment."""
MOST_INTERVALS = 8_000
"""Limit of the intervals of all segments together, unless LEAST_INTERVALS require more."""
PEAKS = 64
"""Number of local maxima of the samples around which the largest ratio is refined."""
_ROUNDS, _REFINED = 4, 9
_CHUNK = 1024


class TrajectoryEfforts(NamedTuple):
    """
    Efforts (points, n) at the points, and the point in time closest to a limit of the arm.

    `worst_ratio` is |value| / limit of `worst_joint` at `worst_time` [s] from the start, the
    largest at and between the points, and `worst_limit` names the limited value: 'effort', or with
    motors 'current' or 'voltage', which are steady-state values (`Actuators.load`). Without any
    limit the ratio is 0.
    """

    efforts: FloatArray
    feasible: bool
    worst_joint: str
    worst_ratio: float
    worst_time: float
    worst_limit: str


def efforts_along(dynamics: ArmDynamics, trajectory: JointTrajectory) -> TrajectoryEfforts:
    """
    Return inverse dynamics along a trajectory, whose joints are in the arm's order.

    At a point, its own velocity and acceleration are used; fields that the point omits are those
    of the interpolation at that time. The limits are compared with the efforts at the points, on
    the interpolated motion from the first to the last point, and at rest after the last of several
    points. The largest ratio between the points is sampled and refined, to about 1e-5 if the
    efforts are continuous.
    """
    segments = TrajectorySegments(trajectory)
    efforts = dynamics.unchecked.inverse_dynamics_batch(*segments.points)
    search = _Search(dynamics)
    search.compare(segments.times, segments.points, efforts)
    if segments.count:
        last = segments.points.position[-1:]
        search.compare(
            segments.times[-1:], Reference(last, np.zeros_like(last), np.zeros_like(last)))
        _search_segments(search, segments)
    return TrajectoryEfforts(
        efforts, search.ratio <= 1.0, dynamics.arm.joint_names[search.joint], search.ratio,
        search.time, search.limit)


class _Search:
    """The largest ratio of a value to its limit that was found so far."""

    def __init__(self, dynamics: ArmDynamics) -> None:
        self._dynamics = dynamics.unchecked
        self.ratio, self.joint, self.time, self.limit = -1.0, 0, 0.0, ''

    def compare(
        self, times: FloatArray, motion: Reference, efforts: FloatArray | None = None,
    ) -> FloatArray:
        """Compare samples (m, n) at times (m,) with the limits; return their largest ratios."""
        if efforts is None:
            efforts = self._dynamics.inverse_dynamics_batch(*motion)
        by_limit = limit_ratios(
            self._dynamics.arm, efforts, motion.velocity, motion.acceleration)
        ratios = np.array(list(by_limit.values()))
        limit, i, joint = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
        if ratios[limit, i, joint] > self.ratio:
            self.ratio, self.joint = float(ratios[limit, i, joint]), int(joint)
            self.time, self.limit = float(times[i]), list(by_limit)[limit]
        return np.asarray(ratios.max(axis=(0, 2)))


def limit_ratios(
    arm: ArmModel, efforts: FloatArray, v: FloatArray, a: FloatArray,
) -> dict[str, FloatArray]:
    """Return |value| / limit, (..., n), of efforts and, with motors, currents and voltages."""
    by_limit: dict[str, FloatArray] = {'effort': np.abs(efforts) / arm.limits.effort}
    if arm.actuators is not None:
        load = arm.actuators.load(efforts, v, a)
        by_limit.update(current=load.current_ratio, voltage=load.voltage_ratio)
    return by_limit


def _search_segments(search: _Search, segments: TrajectorySegments) -> None:
    """Sample all segments, then refine around the largest of the local maxima."""
    intervals = _intervals(segments)
    segment = np.repeat(np.arange(segments.count), intervals + 1)
    first = np.cumsum(intervals + 1) - (intervals + 1)
    width = 1.0 / intervals[segment]
    phase = (np.arange(len(segment)) - first[segment]) * width

    def sampled(segment: IntArray, phase: FloatArray) -> FloatArray:
        chunks = (slice(i, i + _CHUNK) for i in range(0, len(segment), _CHUNK))
        return np.concatenate([search.compare(
            segments.time(segment[chunk], phase[chunk]),
            segments.sample(segment[chunk], phase[chunk])) for chunk in chunks])

    phase = np.minimum(phase, 1.0)
    peaks = _largest_peaks(sampled(segment, phase))
    segment, phase, width = segment[peaks], phase[peaks], width[peaks]
    grid = np.linspace(-1.0, 1.0, _REFINED)
    for _ in range(_ROUNDS if len(peaks) else 0):
        near = np.clip(phase[:, np.newaxis] + grid * width[:, np.newaxis], 0.0, 1.0)
        ratios = sampled(np.repeat(segment, _REFINED), near.ravel()).reshape(near.shape)
        phase = near[np.arange(len(near)), np.argmax(ratios, axis=1)]
        width = width * (grid[1] - grid[0])


def _intervals(segments: TrajectorySegments) -> IntArray:
    """Return the number of intervals of each segment, (k,)."""
    k, quarters = segments.count, np.linspace(0.0, 1.0, 5)
    q = segments.sample(np.repeat(np.arange(k), 5), np.tile(quarters, k)).position
    moved = np.abs(np.diff(q.reshape(k, 5, -1), axis=1)).sum(axis=(1, 2))
    wanted = np.clip(moved / STEP, INTERVALS, MOST_INTERVALS)
    wanted *= min(1.0, MOST_INTERVALS / float(wanted.sum()))
    return np.asarray(np.maximum(wanted, LEAST_INTERVALS), dtype=np.intp)


def _largest_peaks(ratios: FloatArray) -> IntArray:
    """Return the rows of the largest local maxima; a constant series has none."""
    before = np.concatenate((ratios[:1], ratios[:-1]))
    after = np.concatenate((ratios[1:], ratios[-1:]))
    is_peak = (ratios >= before) & (ratios >= after) & (
        ratios > (1.0 + 1e-9) * np.minimum(before, after))
    rows = np.flatnonzero(is_peak)
    largest = np.argsort(-ratios[rows], kind='stable')[:PEAKS]
    return np.asarray(rows[largest])
