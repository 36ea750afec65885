# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The reference of a controller: a trajectory, a stop, or none."""

from collections.abc import Callable
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.path_conditioning import feasible_trajectory
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.goal_limits import (
    check_points,
    with_clipped_positions,
    with_clipped_velocity,
)
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.validation import LARGEST_VALUE

Brake = Callable[[MotionLimits, FloatArray, FloatArray], MotionLimits]
"""Returns the limits with the braking that is possible from a position and velocity (n,)."""
LastState = tuple[int, FloatArray, FloatArray]
"""A stamp [ns], and the position and velocity (n,) in use."""
Prepared = tuple[JointTrajectory, float]
"""A trajectory that the arm can follow, and the factor by which it was slowed down."""
FASTEST_STOP = 2.0
"""Largest velocity from which a stop begins, by the velocity limit."""


class FollowedReference:
    """
    The reference of one arm.

    Times are the stamps of the joint states [ns]. `Controller` calls `feasible` without its lock,
    and all other methods with it.
    """

    def __init__(self, arm: ArmModel) -> None:
        self._arm = arm
        self.generator = ReferenceGenerator(arm.joint_names, [
            name for name, kind in zip(arm.joint_names, arm.joint_kinds) if kind == 'continuous'])
        self.limits: MotionLimits | None = None
        """The limits of new references, None for none."""
        self.brake: Brake = lambda limits, q, v: limits
        self.first_stop: ActiveTrajectory | None = None
        """The stop at a first state, which the second state replaces."""
        self.stops_next = False
        """Whether a stop from the next measured state is wanted."""
        self.slowness = 1.0
        """Factor by which the last trajectory was slowed down."""

    @property
    def active(self) -> ActiveTrajectory | None:
        """The trajectory or stop that is followed, or None."""
        return self.generator.active

    def feasible(
        self, trajectory: JointTrajectory, planning: ArmDynamics, options: ControllerOptions,
    ) -> Prepared:
        """
        Return a trajectory that the arm can follow, and the factor by which it was slowed down.

        Raises TrajectoryError if the arm cannot follow the trajectory, or for other joints.
        """
        self.generator.check_joints(trajectory)
        limits = self.limits
        if options.checks_goals:
            if options.clips_positions:
                trajectory = with_clipped_positions(self._arm, trajectory)
            if options.slows_down and trajectory.is_set_point:
                trajectory = with_clipped_velocity(self._arm, trajectory)
            check_points(
                self._arm, trajectory,
                has_velocities=limits is None or not options.slows_down)
        if limits is None or trajectory.is_set_point:
            return trajectory, 1.0
        return feasible_trajectory(
            planning, trajectory, limits.lowered, options.effort_limit_fraction,
            options.slows_down)

    def start(
        self, trajectory: JointTrajectory, slowness: float,
        state: LastState, stamp_ns: int, latest: float = math.inf,
    ) -> None:
        """
        Follow a trajectory from the last state (stamp, q, v) on.

        Raises TrajectoryError, also if the trajectory would end more than `latest` [s] late.
        """
        before = self.generator.active
        # A planned motion may be faster than the limits of references.
        self._limit_braking(
            *state[1:], before is not None and not before.trajectory.is_set_point)
        active = self.generator.start(trajectory, *state, stamp_ns=stamp_ns)
        late_ns = active.end_ns - (stamp_ns or state[0]) - trajectory.times_ns[-1]
        if late_ns > 1e9 * latest:
            self.generator.active = before
            raise TrajectoryError(
                f'the trajectory would end {1e-9 * late_ns:.3g} s late, expected at most '
                f'{latest:g} s: the arm has to move to its first point before')
        self.stops_next = False
        self.slowness = slowness

    def _limit_braking(self, q: FloatArray, v: FloatArray, is_local: bool) -> None:
        """Brake with the limits of the workspace, or with those of the poses of a stop."""
        limits = self.limits
        self.generator.limits = limits if limits is None or not is_local else (
            self.brake(limits, q, v))

    def end(self, holds: bool = False) -> None:
        """End the reference; if `holds`, a stop from the next measured state is wanted."""
        self.generator.clear()
        self.stops_next = holds

    def stop_from(
        self, is_first: bool, stamp_ns: int, q: FloatArray, v: FloatArray,
    ) -> ActiveTrajectory | None:
        """
        Return a stop from q and v (n,), or from the position limit that q is beyond.

        A first state is a stop at rest until a state with another stamp.
        """
        self.end()
        inside = np.clip(q, self._arm.limits.lower, self._arm.limits.upper)
        self.stop(stamp_ns, inside, np.where(inside == q, v, 0.0))
        self.first_stop = self.active if is_first else None
        return self.active

    def stop(self, stamp_ns: int, q: FloatArray, v: FloatArray) -> None:
        """
        Stop from the reference, or without one from this state, and hold.

        Velocities far beyond their limits are wrong; they do not prevent the stop.
        """
        self.stops_next = False
        fastest = np.minimum(FASTEST_STOP * self._arm.limits.velocity, LARGEST_VALUE)
        q, v = np.clip(q, -LARGEST_VALUE, LARGEST_VALUE), np.clip(v, -fastest, fastest)
        self._limit_braking(q, v, True)
        self.generator.stop(stamp_ns, q, v)
