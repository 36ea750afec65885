# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control loop of `dynamics` in lock-step with an arm without friction, in simulated time."""

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.control_law import ControlLaw
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robots import arm_without_gripper

MS = 1_000_000
FIRST_STAMP = 1_790_000_000_000 * MS
STEP = 1e-3
"""[s]"""
WATCH = 20
"""[ms] between two ticks of the watchdog."""
ACTION = 2
"""[ms] between two efforts without a state."""
DIVERGED = 1e3
"""[rad/s] at which a run ends."""

Sensor = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Returns the measured position and velocity from the true ones, each (n,)."""


def smooth_arm(name: str) -> ArmModel:
    """Return an arm without friction; skip the test if its description is not installed."""
    arm = arm_without_gripper(name)
    return arm.with_friction(make_friction(arm.joint_names))


def middle(arm: ArmModel, free: float = 0.0) -> FloatArray:
    """Return the middle of the position limits, `free` without limits."""
    lower, upper = arm.limits.lower, arm.limits.upper
    return np.array([
        0.5 * (low + high) if np.isfinite([low, high]).all() else free
        for low, high in zip(lower, upper)])


def directions(n: int) -> FloatArray:
    """Return −1 and 1 in turns, (n,)."""
    return np.where(np.arange(n) % 2, 1.0, -1.0)


def frozen(j: int) -> Sensor:
    """Return a sensor that repeats its first sample of one joint."""
    kept: list[float] = []

    def sensor(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        kept.extend(() if kept else (q[j], v[j]))
        q, v = q.copy(), v.copy()
        q[j], v[j] = kept
        return q, v
    return sensor


class Trace(NamedTuple):
    """
    The motion of an arm, one row per ms.

    Times (m,) [s]; true position and velocity, and effort, (m, n) each, the effort NaN without
    one; the mode of the supervisor (m,).
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    effort: FloatArray
    mode: list[Mode]

    @property
    def speed(self) -> FloatArray:
        """The largest speed of all joints, (m,) [rad/s]."""
        return np.asarray(np.abs(self.v).max(axis=1))

    def last(self, seconds: float) -> 'Trace':
        """Return the last part."""
        rows = round(seconds / STEP)
        return Trace(*(column[-rows:] for column in self))  # type: ignore[arg-type]


class LockStep:
    """
    A loop and a plant; the brakes hold the plant until the first effort.

    `dropped` is the number of states that could not follow the ones before them.

    `sensor` may be replaced at any time; without one no states arrive. `push` (n,) [N·m] is an
    effort of the environment at a time [s].
    """

    def __init__(
        self, arm: ArmModel, law: ControlLaw | None = None, *, true_arm: ArmModel | None = None,
        q: FloatArray | None = None, v: FloatArray | None = None, rate: float = 500.0,
        delay: int = 0, loop: ControlLoop | None = None, **options: Any,
    ) -> None:
        """`delay` [ms] passes from a state until its effort acts; `rate` is in Hz."""
        self.arm, self.period, self.delay = arm, round(1.0 / (rate * STEP)), delay
        self.loop = loop or ControlLoop.of_arm(arm, law, **options)
        self._body = UncheckedArmDynamics(true_arm or arm).rigid_body
        self.q = middle(arm) if q is None else np.array(q, dtype=float)
        self.v = np.zeros_like(self.q) if v is None else np.array(v, dtype=float)
        self.k = self.dropped = 0
        self.sensor: Sensor | None = lambda q, v: (q, v)
        self.push: Callable[[float], FloatArray | float] = lambda t: 0.0
        self._effort: FloatArray | None = None
        self._pending: deque[tuple[int, FloatArray]] = deque()

    @property
    def now(self) -> float:
        """The time [s] of the steady clock."""
        return 1e-9 * (FIRST_STAMP + self.k * MS)

    def _answer(self) -> FloatArray | None:
        """Return the effort that the loop publishes now, or None."""
        if self.sensor is not None and self.k % self.period == 0:
            q, v = self.sensor(self.q, self.v)
            try:
                return self.loop.answer(FIRST_STAMP + self.k * MS, q, v).effort
            except ImplausibleStateError:
                self.dropped += 1
        every = ACTION if self.loop.supervisor.acts_alone else WATCH
        return self.loop.tick(self.now) if self.k % every == 1 else None

    def run(self, seconds: float) -> Trace:
        """Continue by this time."""
        rows: list[Any] = []
        limit = self.arm.limits.effort
        for _ in range(round(seconds / STEP)):
            effort = self._answer()
            if effort is not None:
                self._pending.append((self.k + self.delay, np.clip(effort, -limit, limit)))
            while self._pending and self._pending[0][0] <= self.k:
                self._effort = self._pending.popleft()[1]
            if self._effort is not None:
                self._move(self._effort + self.push(self.k * STEP))
            sent = np.full_like(self.q, np.nan) if effort is None else effort
            rows.append((self.k * STEP, self.q, self.v, sent, self.loop.supervisor.mode))
            self.k += 1
            if not np.abs(self.v).max() < DIVERGED:
                break
        *columns, modes = zip(*rows)
        return Trace(*(np.array(column) for column in columns), list(modes))

    def _move(self, tau: FloatArray) -> None:
        q = self.q + 0.5 * STEP * self.v
        v = self.v + STEP * self._body.forward_dynamics(q, self.v, tau)
        self.q, self.v = self.q + 0.5 * STEP * (self.v + v), v

    def follow(self, q: FloatArray, seconds: float = 0.0) -> None:
        """Send a set-point to a position (n,), or a trajectory at rest to rest in this time."""
        self.loop.follow(self.way(q, seconds))

    def way(self, q: FloatArray, seconds: float) -> JointTrajectory:
        """Return the trajectory of `follow`."""
        names, zero = self.arm.joint_names, [[0.0] * len(q)]
        if not seconds:
            return make_trajectory(names, [0.0], [q])
        return make_trajectory(names, [seconds], [q], zero, zero)
