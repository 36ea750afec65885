# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The limits of an arm along a path, as linear constraints of σ̇² = x and σ̈ = u.

The effort of the rigid bodies is A u + B x + g with A = M q', B = M q'' + C(q, q') q' (K. Shin,
N. McKay, IEEE Trans. Automatic Control 30(6), 1985; q' = dq/dσ). It is within bounds that depend
on the velocity: an effort limit minus friction, which is exact for every kind of friction, and
the efforts at the limits of current and voltage. The bounds are replaced with their tangents at a
given x, so that they are exact after some passes; viscous friction is concave in x, so that its
tangent is conservative.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.joints.actuator import Actuators
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.efforts import limit_ratios
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.path_grid import PathEnd, PathGrid
from robot_dynamics.trajectories.reachability import Rows

_STEP, _SLOWEST, _FLOOR, _LEAST_ROOM, _MOST_AT_REST = 1e-3, 1e-9, 1e-6, 0.02, 1.0 - 1e-6


class RigidBodyBounds(NamedTuple):
    """
    Lower and upper effort (2, k, ..., n) of the rigid bodies, k in the directions +1 and -1 each.

    `rotor` (2, k, ..., n) times rotor inertia and acceleration adds to the bounded effort: it is
    power that does not pass the gearbox. `scale` (k, n) are the bounds without friction at rest.
    """

    effort: FloatArray
    rotor: FloatArray
    scale: FloatArray


class PathLimits(NamedTuple):
    """
    What limits the motion along a path; joints (n,), infinite for no limit.

    `effort`, `current` and `voltage` are shares of the limits of the arm.
    """

    dynamics: ArmDynamics
    acceleration: FloatArray
    share: float = 1.0

    @property
    def velocity(self) -> FloatArray:
        """The velocity limits (n,) [rad/s] or [m/s]."""
        return self.dynamics.arm.limits.velocity

    def free_velocity(self) -> FloatArray:
        """Return the velocities (n,) at which a bound of the effort is 0."""
        n = self.dynamics.arm.joint_count
        low, high = np.full(n, 1e-6), np.full(n, 1e6)
        for _ in range(40):
            v = np.sqrt(low * high)
            forward, backward = self.bounds(np.stack((v, -v))).effort
            free = (forward[:, 0] > 0.0).all(axis=0) & (backward[:, 1] < 0.0).all(axis=0)
            low, high = np.where(free, v, low), np.where(free, high, v)
        return low

    def depend_on_speed(self) -> bool:
        """Return whether the bounds of the effort depend on the speed."""
        n = self.dynamics.arm.joint_count
        effort = self.bounds(np.array([[_SLOWEST] * n, [1.0] * n])).effort
        return not np.array_equal(effort[0, :, 0], effort[0, :, 1])

    def ratios(
        self, v: FloatArray, a: FloatArray, load: FloatArray,
    ) -> dict[str, FloatArray]:
        """Return |value| / limit (..., n) of each limited quantity of a motion, by its name."""
        arm = self.dynamics.arm
        tau = load + arm.friction.effort(v, load)
        return {'velocity': np.abs(v) / arm.limits.velocity,
                'acceleration': np.abs(a) / self.acceleration,
                **{name: ratio / self.share
                   for name, ratio in limit_ratios(arm, tau, v, a).items()}}

    def bounds(self, v: FloatArray) -> RigidBodyBounds:
        """Return the bounds at velocities (..., n)."""
        arm = self.dynamics.arm
        direction = np.array([1.0, -1.0]).reshape(2, *np.ones(v.ndim, dtype=np.intp))
        limit = self.share * arm.limits.effort
        found = [(direction * limit + 0.0 * v, 0.0 * v, limit)]
        if arm.actuators is not None:
            found += self._of_motors(arm.actuators, direction, v)
        efforts, rotors, scales = zip(*found)
        effort = np.stack(efforts, axis=1)
        left = arm.friction.load_behind(v, np.where(np.isfinite(effort), effort, 0.0))
        return RigidBodyBounds(
            np.where(np.isfinite(effort), left, effort),
            np.stack([np.broadcast_to(one, efforts[0].shape) for one in rotors], axis=1),
            np.array(scales))

    def _of_motors(
        self, motors: Actuators, direction: FloatArray, v: FloatArray,
    ) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return efforts with friction and `rotor`, (2, ..., n), and `scale` of each bound."""
        kinds = []
        if np.isfinite(motors.current_limit).any():
            most = self.share * motors.current_limit
            kinds.append((direction * most, most))
        if np.isfinite(motors.voltage_limit).any():
            with np.errstate(divide='ignore', invalid='ignore'):
                most = self.share * motors.voltage_limit / motors.resistance
                back_emf = motors.back_emf_constant * np.abs(motors.gear_ratio) * v
                current = direction * most - back_emf / motors.resistance
            kinds.append((np.where(np.isfinite(most), current, direction * np.inf), most))
        ratio, found = np.abs(motors.gear_ratio) * motors.torque_constant, []
        for current, most in kinds:
            with np.errstate(invalid='ignore'):
                absorbs = current * v < 0.0
            gain = np.where(absorbs, 1.0 / motors.efficiency, motors.efficiency)
            found.append((ratio * current * gain, gain - 1.0, ratio * most))
        return found


class PathTerms(NamedTuple):
    """The terms of the rigid bodies at one end of each interval, (m, n) each, and the end."""

    end: PathEnd
    inertia: FloatArray
    centrifugal: FloatArray
    gravity: FloatArray

    def rows(self, rows: IntArray) -> 'PathTerms':
        """Return the terms of these intervals."""
        return PathTerms(self.end.rows(rows), *(values[rows] for values in self[1:]))


def path_terms(dynamics: ArmDynamics, end: PathEnd) -> PathTerms:
    """Return A, B and g of A u + B x + g."""
    body, zero = dynamics.unchecked.rigid_body, np.zeros_like(end.q)
    gravity = body.gravity_batch(end.q)
    return PathTerms(
        end, body.inverse_dynamics_batch(end.q, zero, end.tangent) - gravity,
        body.inverse_dynamics_batch(end.q, end.tangent, end.curvature) - gravity, gravity)


def velocity_caps(grid: PathGrid, velocity: FloatArray, margins: FloatArray) -> FloatArray:
    """Return the largest x (m + 1,) within velocities (n,); margins (m,) are unused shares."""
    with np.errstate(divide='ignore'):
        by_end = [np.min(velocity / np.abs(end.tangent), axis=1) * (1.0 - margins)
                  for end in (grid.left, grid.right)]
    caps: FloatArray = np.full(len(grid.rests), np.inf)
    caps[:-1] = by_end[0]
    caps[1:] = np.minimum(caps[1:], by_end[1])
    caps = np.square(caps)
    caps[grid.rests] = 0.0
    return caps


def constraints(
    limits: PathLimits, grid: PathGrid, ends: tuple[PathTerms, PathTerms], x: FloatArray,
    rise: FloatArray, margins: FloatArray,
) -> Rows:
    """
    Return the constraints at both ends of each interval, linear at the states x (m + 1,).

    The control u of an interval is the mean of its values at both ends, which differ by `rise`
    (m,). `margins` (m, n) are shares of the limits that are left unused.
    """
    rows = []
    turns: BoolArray = grid.left.tangent * grid.right.tangent < 0.0
    for left, terms, nodes in ((True, ends[0], slice(0, -1)), (False, ends[1], slice(1, None))):
        of_u, of_x, bound = _end_rows(
            limits, grid.sign, turns, grid.rests[nodes], terms, x[nodes], margins)
        by_u = of_u / (2.0 * grid.length[:, np.newaxis])
        offset = (-0.5 if left else 0.5) * rise[:, np.newaxis]
        of_end = np.stack((
            of_x * left - by_u, of_x * (not left) + by_u, bound - of_u * offset))
        of_end = np.moveaxis(of_end, 1, 2).reshape(3, len(x) - 1, -1)
        rows.append(of_end[:, :, np.isfinite(of_end[2]).any(axis=0)])
    # One row without effect, because there may be no others.
    return Rows(*np.concatenate((*rows, np.zeros((3, len(x) - 1, 1))), axis=2))


def _end_rows(
    limits: PathLimits, ways: FloatArray, turns: BoolArray, rests: BoolArray, terms: PathTerms,
    x: FloatArray, margins: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return factors of u and x, and their bounds, (rows, m, n) each.

    Where joints turn back within the interval (`turns`, (m, n)), and at rest (`rests`, (m,)),
    friction and power have several signs, and each has to be within the limits.
    """
    tangent, curvature = terms.end.tangent, terms.end.curvature
    motors = limits.dynamics.arm.actuators
    rotor = 0.0 if motors is None else motors.reflected_inertia
    x_1 = (1.0 + _STEP) * np.maximum(x, max(_FLOOR * float(x.max()), _SLOWEST**2))
    v = tangent * np.sqrt(np.stack((x, x_1)))[:, :, np.newaxis]
    # A joint at rest has a tiny velocity in its direction of motion.
    v = np.where(np.abs(v) > _SLOWEST, v, _SLOWEST * ways)
    effort, gain, scale = limits.bounds(v)
    direction = np.array([1.0, -1.0]).reshape(2, 1, 1, 1)
    with np.errstate(invalid='ignore'):
        rise = np.nan_to_num(effort[:, :, 1] - effort[:, :, 0], nan=0.0)
    slope = direction * rise / (x_1 - x)[:, np.newaxis]
    # Friction that decreases with the speed has the value at x.
    slope = np.where(direction * v[0] > 0.0, np.minimum(slope, 0.0), np.maximum(slope, 0.0))
    effort, gain = direction * effort[:, :, 0], gain[:, :, 0]
    rows = np.flatnonzero(turns.any(axis=1) | rests)
    if len(rows):
        here = v[0, rows]
        bounds = limits.bounds(np.stack((
            here, *(np.where(turns[rows], sign * _SLOWEST, here) for sign in (1.0, -1.0)),
            np.where(rests[rows, np.newaxis], 0.0, here))))
        signed = direction[..., np.newaxis] * bounds.effort
        least = np.argmin(signed, axis=2, keepdims=True)
        effort[:, :, rows], gain[:, :, rows] = (
            np.take_along_axis(values, least, axis=2)[:, :, 0] for values in (
                signed, bounds.rotor))
    room = effort - direction * terms.gravity - slope * x[:, np.newaxis]
    with np.errstate(invalid='ignore'):
        room = np.maximum(room - margins * scale[:, np.newaxis], _LEAST_ROOM * room)
    of_acceleration = np.broadcast_to(limits.acceleration * (1.0 - margins), (2, *margins.shape))
    return (_rows(direction * tangent, direction * (terms.inertia + gain * rotor * tangent)),
            _rows(direction * curvature,
                  direction * (terms.centrifugal + gain * rotor * curvature) - slope),
            _rows(of_acceleration, np.where(np.isfinite(effort), room, np.inf)))


def _rows(of_acceleration: FloatArray, of_effort: FloatArray) -> FloatArray:
    m, n = of_effort.shape[-2:]
    return np.concatenate((of_acceleration.reshape(2, m, n), of_effort.reshape(-1, m, n)))


def check_slow_motion(
    limits: PathLimits, trajectory: JointTrajectory, q: FloatArray, gravity: FloatArray,
    direction: FloatArray | None = None,
) -> None:
    """
    Raise TrajectoryError for a position (m, n) at which the arm cannot be held, or move slowly.

    With a `direction` (m, n) of the joints the effort contains dry friction. The message names
    joint, the nearest point of the trajectory, quantity and ratio.
    """
    friction = limits.dynamics.arm.friction
    what, v = 'at rest', np.zeros_like(q)
    load = gravity
    if direction is not None:
        what, v = 'in slow motion, with friction', _SLOWEST * direction
        most = direction * (friction.at_rest.static + friction.load_coefficient * np.abs(gravity))
        # The friction at this velocity is part of the ratios.
        load = gravity + most + friction.effort(0.0 * q, gravity) - friction.effort(v, gravity)
    by_name = limits.ratios(v, np.zeros_like(q), load)
    for name in ('effort', 'current', 'voltage'):
        if name in by_name and by_name[name].max() > _MOST_AT_REST:
            i, j = np.unravel_index(int(np.argmax(by_name[name])), q.shape)
            points = np.array([point.position for point in trajectory.points])
            near = int(np.argmin(np.abs(points - q[i]).max(axis=1)))
            where = 'at' if np.array_equal(points[near], q[i]) else 'near'
            raise TrajectoryError(
                f'the {name} of {trajectory.joint_names[j]!r} due to gravity is '
                f'{by_name[name][i, j]:.4g} times its limit {what} {where} points[{near}] '
                f'(position {np.round(q[i], 4).tolist()}), expected at most 1 at every pose')
