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

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.path_grid import PathEnd, PathGrid
from robot_dynamics.trajectories.reachability import Rows

_STEP, _SLOWEST, _FLOOR, _LEAST_ROOM, _MOST_AT_REST = 1e-3, 1e-9, 1e-6, 0.02, 1.0 - 1e-6


class Bound(NamedTuple):
    """
    A bound (m, n) of the effort of the rigid bodies in one direction.

    `rotor` (m, n) times rotor inertia and acceleration adds to the bounded effort: it is power
    that does not pass the gearbox. `scale` (n,) is the bound without friction at rest.
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

    def free_speed(self, grid: PathGrid) -> FloatArray:
        """Return x (m + 1,) at which a joint has the velocity whose bound of the effort is 0."""
        n = self.dynamics.arm.joint_count
        low, high = np.full(n, 1e-6), np.full(n, 1e6)
        for _ in range(40):
            v = np.sqrt(low * high)
            free = np.ones(n, dtype=np.bool_)
            for direction in (1.0, -1.0):
                for bound in self.bounds(direction * v, direction):
                    free &= direction * bound.effort > 0.0
            low, high = np.where(free, v, low), np.where(free, high, v)
        with np.errstate(divide='ignore'):
            x = [np.square(np.min(low / np.abs(end.tangent), axis=1))
                 for end in (grid.left, grid.right)]
        return np.asarray(np.minimum(np.append(x[0], np.inf), np.append(np.inf, x[1])))

    def depend_on_speed(self) -> bool:
        """Return whether the bounds of the effort depend on the speed."""
        n = self.dynamics.arm.joint_count
        slow, fast = (list(self.bounds(np.full(n, v), 1.0)) for v in (_SLOWEST, 1.0))
        return any(not np.array_equal(a.effort, b.effort) for a, b in zip(slow, fast))

    def ratios(
        self, v: FloatArray, a: FloatArray, load: FloatArray,
    ) -> dict[str, FloatArray]:
        """Return |value| / limit (..., n) of each limited quantity of a motion, by its name."""
        arm = self.dynamics.arm
        tau = load + arm.friction.effort(v, load)
        by_name = {'velocity': np.abs(v) / arm.limits.velocity,
                   'acceleration': np.abs(a) / self.acceleration,
                   'effort': np.abs(tau) / (self.share * arm.limits.effort)}
        if arm.actuators is not None:
            of_motor = arm.actuators.load(tau, v, a)
            by_name.update(current=of_motor.current_ratio / self.share,
                           voltage=of_motor.voltage_ratio / self.share)
        return by_name

    def bounds(
        self, v: FloatArray, direction: float,
    ) -> Iterator[Bound]:
        """Yield the bounds at velocities (m, n) in the direction +1 or -1."""
        arm = self.dynamics.arm
        limit = self.share * arm.limits.effort
        if np.isfinite(limit).any():
            yield Bound(arm.friction.load_behind(v, direction * limit + 0.0 * v),
                        np.zeros_like(v), limit)
        motors = arm.actuators
        if motors is None:
            return
        ratio = np.abs(motors.gear_ratio) * motors.torque_constant
        back_emf = motors.back_emf_constant * np.abs(motors.gear_ratio)
        kinds = []
        if np.isfinite(motors.current_limit).any():
            most = self.share * motors.current_limit
            kinds.append((direction * most + 0.0 * v, most))
        if np.isfinite(motors.voltage_limit).any():
            with np.errstate(divide='ignore', invalid='ignore'):
                most = self.share * motors.voltage_limit / motors.resistance
                current = direction * most - back_emf * v / motors.resistance
            kinds.append((np.where(np.isfinite(most), current, direction * np.inf), most))
        for current, most in kinds:
            torque = ratio * current
            gain = np.where(torque * v < 0.0, 1.0 / motors.efficiency, motors.efficiency)
            bound = torque * gain
            left = arm.friction.load_behind(v, np.where(np.isfinite(bound), bound, 0.0))
            yield Bound(np.where(np.isfinite(bound), left, direction * np.inf), gain - 1.0,
                        ratio * most)


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


def velocity_caps(limits: PathLimits, grid: PathGrid, margins: FloatArray) -> FloatArray:
    """Return the largest x (m + 1,) within the velocity limits; margins (m,) are shares of it."""
    with np.errstate(divide='ignore'):
        by_end = [np.min(limits.velocity / np.abs(end.tangent), axis=1) * (1.0 - margins)
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
    a, b, c = [], [], []
    turns: BoolArray = grid.left.tangent * grid.right.tangent < 0.0
    for left, terms, at in ((True, ends[0], x[:-1]), (False, ends[1], x[1:])):
        offset = (-0.5 if left else 0.5) * rise[:, np.newaxis]
        for of_u, of_x, bound in _end_rows(limits, grid.sign, turns, terms, at, margins):
            keep = np.isfinite(bound).any(axis=0)
            by_u = of_u[:, keep] / (2.0 * grid.length[:, np.newaxis])
            a.append(of_x[:, keep] * left - by_u)
            b.append(of_x[:, keep] * (not left) + by_u)
            c.append(bound[:, keep] - of_u[:, keep] * offset)
    # One row without effect, because there may be no others.
    nothing = np.zeros((len(grid.length), 1))
    return Rows(np.concatenate((*a, nothing), axis=1), np.concatenate((*b, nothing), axis=1),
                np.concatenate((*c, nothing), axis=1))


def _end_rows(
    limits: PathLimits, ways: FloatArray, turns: BoolArray, terms: PathTerms, x: FloatArray,
    margins: FloatArray,
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield factors of u and x, and their bounds, (m, n) each."""
    tangent, curvature = terms.end.tangent, terms.end.curvature
    if np.isfinite(limits.acceleration).any():
        bound = limits.acceleration * (1.0 - margins)
        yield tangent, curvature, bound
        yield -tangent, -curvature, bound
    motors = limits.dynamics.arm.actuators
    rotor = 0.0 if motors is None else motors.reflected_inertia
    x_0 = np.maximum(x, max(_FLOOR * float(x.max()), _SLOWEST**2))
    v, v_0, v_1 = (_velocity(tangent, ways, state) for state in (x, x_0, (1.0 + _STEP) * x_0))
    # A joint that turns back within the interval has dry friction of both signs.
    rows = np.flatnonzero(turns.any(axis=1))
    turning = [np.where(turns[rows], sign * _SLOWEST, v[rows]) for sign in (1.0, -1.0)]
    for direction in (1.0, -1.0):
        bounds = (limits.bounds(speed, direction) for speed in (v, v_0, v_1, *turning))
        for here, one, other, *slow in zip(*bounds):
            effort = direction * here.effort
            for bound in slow:
                effort[rows] = np.minimum(effort[rows], direction * bound.effort)
            with np.errstate(invalid='ignore'):
                slope = direction * np.nan_to_num(other.effort - one.effort, nan=0.0) / (
                    _STEP * x_0[:, np.newaxis])
                # Friction that decreases with the speed has the value at x.
                resists = direction * v > 0.0
                slope = np.where(resists, np.minimum(slope, 0.0), np.maximum(slope, 0.0))
                room = effort - direction * terms.gravity - slope * x[:, np.newaxis]
                room = np.maximum(room - margins * here.scale, _LEAST_ROOM * room)
            by_u = direction * (terms.inertia + here.rotor * rotor * tangent)
            by_x = direction * (terms.centrifugal + here.rotor * rotor * curvature)
            yield by_u, by_x - slope, np.where(np.isfinite(here.effort), room, np.inf)


def _velocity(tangent: FloatArray, sign: FloatArray, x: FloatArray) -> FloatArray:
    """Return the velocities (m, n); a joint at rest has a tiny one in its direction of motion."""
    speed = np.sqrt(x)[:, np.newaxis]
    v = tangent * speed
    return np.where(np.abs(v) > _SLOWEST, v, _SLOWEST * sign)


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
