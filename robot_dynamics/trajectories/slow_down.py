# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The smallest factor by which a trajectory has to be slower to be within the limits of an arm.

At c times the duration, velocities are divided by c, and accelerations and the effort of the rigid
bodies beyond gravity by c² (J. M. Hollerbach, J. Dynamic Systems, Measurement, and Control 106(1),
1984), so that one evaluation of the dynamics is sufficient for all factors.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.extrema import derivative, extrema
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.segments import TrajectorySegments
from robot_dynamics.trajectories.timing_limits import PathLimits

SLOWEST = 1e4
"""Largest factor."""
_TOLERANCE, _ROUNDS, _SAMPLES, _FEWEST = 1e-6, 8, 5_000, 4
_EXACT, _ROUNDING, _TARGET, _STEP = 1e-7, 1e-4, 1.0 - 3e-6, 2e-5


def slower(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    """
    Return a trajectory with `factor` times the durations, which begins at 0 s.

    Times are whole nanoseconds. Positions and velocities are those at the rounded times, because
    accelerations between points 1 ms apart would otherwise have errors of 1e-3 rad/s².
    """
    moving = TrajectorySegments(trajectory)
    rows = np.arange(moving.count)
    a_0, a_1 = (moving.sample(rows, np.full(moving.count, p)).acceleration for p in (0.0, 1.0))
    rates = np.concatenate((a_0[:1], 0.5 * (a_0[1:] + a_1[:-1]), a_1[-1:]))
    times = factor * (moving.times - moving.times[0])
    rounded = 1e-9 * np.rint(1e9 * times)
    late, v = (rounded - times)[:, np.newaxis], moving.points.velocity / factor
    q = moving.points.position + v * late
    v = np.where(v != 0.0, v + rates * late / factor**2, 0.0)
    return JointTrajectory(trajectory.joint_names, tuple(
        TrajectoryPoint(
            time, p.position if p.velocity is None else position,
            None if p.velocity is None else velocity,
            None if p.acceleration is None else p.acceleration / factor**2)
        for p, time, position, velocity in zip(trajectory.points, rounded.tolist(), q, v)))


def within_limits(limits: PathLimits, trajectory: JointTrajectory) -> JointTrajectory:
    """
    Return the trajectory, slower by the smallest factor, to about 1e-6, of at least 1.

    Raises TrajectoryError, naming joint, time and ratio, if no factor up to SLOWEST suffices.
    """
    segments = TrajectorySegments(trajectory)
    least = _kinematic_slowness(limits, segments)
    samples = _Samples(limits, segments)
    for _ in range(_ROUNDS):
        factor = samples.slowness(least)
        result = slower(trajectory, factor)
        worst = efforts_along(limits.dynamics, result)
        ratio = worst.worst_ratio / limits.share
        if ratio <= 1.0 + _TOLERANCE:
            break
        if factor >= SLOWEST:
            raise TrajectoryError(
                f'the {worst.worst_limit} of {worst.worst_joint!r} is {ratio:.3g} times its limit '
                f'at {worst.worst_time / factor:.3g} s at any speed, expected at most 1')
        # The maximum is between the samples, or the rest is the rounding of times.
        least = factor * (2.0 * ratio - 1.0) if ratio < 1.0 + _ROUNDING else least
        samples.add(worst.worst_time / factor + segments.times[0])
    return result


def largest_ratios(
    limits: PathLimits, trajectory: JointTrajectory,
) -> tuple[FloatArray, IntArray, list[str]]:
    """Return the largest ratio to a limit just before or after each point, joint and quantity."""
    segments = TrajectorySegments(trajectory)
    k = segments.count
    rows = np.arange(k)
    sides = [segments.sample(rows, np.full(k, phase)) for phase in (0.0, 1.0)]
    motion = Reference(*(np.concatenate(pair) for pair in zip(*sides)))
    load = limits.dynamics.unchecked.rigid_body.inverse_dynamics_batch(*motion)
    by_name = limits.ratios(motion.velocity, motion.acceleration, load)
    ratios = np.array(list(by_name.values()))
    both = np.zeros((len(ratios), k + 1, ratios.shape[2]))
    both[:, :-1] = ratios[:, :k]
    both[:, 1:] = np.maximum(both[:, 1:], ratios[:, k:])
    flat = both.transpose(1, 0, 2).reshape(k + 1, -1)
    worst = np.argmax(flat, axis=1)
    quantity, joint = np.divmod(worst, ratios.shape[2])
    names = list(by_name)
    return flat[np.arange(k + 1), worst], joint, [names[i] for i in quantity]


def _kinematic_slowness(limits: PathLimits, segments: TrajectorySegments) -> float:
    v = segments.velocity_coefficients
    T = np.diff(segments.times)[:, np.newaxis, np.newaxis]
    a = derivative(v) / T
    of_v, of_a = (float((np.abs(extrema(c).values) / limit).max()) for c, limit in (
        (v, limits.velocity), (a, limits.acceleration)))
    least = max(of_v, float(np.sqrt(of_a)))
    return least * (1.0 + _TOLERANCE) if least > 1.0 else 1.0


class _Samples:
    """Samples of a motion, with their efforts by gravity, and by motion."""

    def __init__(self, limits: PathLimits, segments: TrajectorySegments) -> None:
        self._limits, self._segments = limits, segments
        k = segments.count
        count = int(np.clip(_SAMPLES // k, _FEWEST, 200)) + 1
        phase = np.tile(np.linspace(0.0, 1.0, count), k)
        self._parts = self._evaluated(np.repeat(np.arange(k), count), phase)

    def add(self, time: float) -> None:
        """Add the sample at a time [s]."""
        times = self._segments.times
        i = np.clip(np.searchsorted(times, [time], side='right') - 1, 0, len(times) - 2)
        phase = np.clip((time - times[i]) / (times[i + 1] - times[i]), 0.0, 1.0)
        self._parts = [np.concatenate(pair) for pair in zip(
            self._parts, self._evaluated(i, phase))]

    def slowness(self, least: float) -> float:
        """Return the smallest factor, at least `least`, with which no sample exceeds a limit."""
        low = high = least
        while self._exceed(high):
            low, high = high, 1.0 + 4.0 * (high - 1.0) + _STEP
            if high > SLOWEST:
                return SLOWEST
        while high - low > _EXACT * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._exceed(middle) else (low, middle)
        return high

    def _evaluated(self, segment: IntArray, phase: FloatArray) -> list[FloatArray]:
        motion = self._segments.sample(segment, phase)
        body = self._limits.dynamics.unchecked.rigid_body
        gravity = body.gravity_batch(motion.position)
        return [motion.velocity, motion.acceleration, gravity,
                body.inverse_dynamics_batch(*motion) - gravity]

    def _exceed(self, factor: float) -> bool:
        """Return whether any sample exceeds a limit of effort, current or voltage."""
        v, a, gravity, moving = self._parts
        ratios = self._limits.ratios(
            v / factor, a / factor**2, gravity + moving / factor**2)
        return any(float(ratios[name].max()) > _TARGET for name in ('effort', 'current', 'voltage')
                   if name in ratios)
