# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The cases of `safe_motion`: arms, motions, and conditions of the loop.

Every arm starts at rest in the middle of its position limits, at 0 if it has none. All joints move
at once, in alternating directions; the step of a joint is shortened so that its goal keeps
`GOAL_MARGIN` from the limits. Gravity takes at most 0.8 of an effort limit on the way.
"""

from collections.abc import Sequence
from functools import cache
import itertools
import math
from typing import Any, NamedTuple
import zlib

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.urdf.sample_robots import sample_robot_path, SAMPLE_ROBOTS

DEFAULT = 'default'
JOINTS = {
    'panda': [f'panda_joint{i + 1}' for i in range(7)],
    'talos_left_arm': [f'arm_left_{i + 1}_joint' for i in range(1, 7)]}
"""Actuated joints, if not all: fingers are locked and keep their mass."""
ARMS = (DEFAULT, *SAMPLE_ROBOTS)
DEFAULT_ARMS = (DEFAULT, 'ur5', 'ur10', 'panda', 'xarm7', 'kinova', 'z1')
"""Those that are run by default, for the sake of time."""
FIRST_JOINT = {'talos_left_arm': 0.8}
"""Start of the first joint [rad] of arms that cannot bear their weight in the middle."""

SET_POINT, STREAM, TRAJECTORY, PUSH = 'set-point', 'stream', 'trajectory', 'push'
MOTIONS = (SET_POINT, STREAM, TRAJECTORY, PUSH)
SIZES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0)
"""[rad]"""
PERIODS = {500: 2, 250: 4, 100: 10, 30: 33}
"""Period of the joint states in ms, by their rate [Hz]."""
DELAYS = (0, 4, 8)
"""[ms] from the time of a state until its effort acts."""
NOISE = 0.2
"""Standard deviation of the measured velocity [rad/s], in the cases with noise."""
POSITION_NOISE = 1e-4
"""Standard deviation of the measured position [rad], in the cases with noise and no velocity."""
GOAL_MARGIN = 0.1
"""[rad]"""

FEED_FORWARD = 'feed_forward'
"""The arm is moved by drives with their own position loop, with the feed-forward of the loop."""

BEGIN = 0.1
"""When the reference is sent [s]."""
LONGEST = 60.0
"""[s] that a run lasts at most."""
STREAM_PERIOD = 0.02
SPEED = 0.7
"""Largest share of the velocity that a joint can have, in streams and trajectories."""
RAMP_TIME = 1.0
"""[s] that a stream ramps at least."""
PATH_TIMES, PATH_FRACTIONS = (0.25, 0.5, 0.75, 1.0), (0.3, 0.5, 0.8, 1.0)
"""Points of a trajectory: shares of its duration, and of the way."""
PATH_DURATION = 2.0
"""[s] that a trajectory lasts at least."""
PUSH_BEGIN, PUSH_END = 1.0, 1.2
"""[s]"""
PUSH_EFFORT, PUSH_FRACTION = 80.0, 0.5
"""Largest push [N·m], and share of the effort limit of its joint."""
PUSH_TIMES = {500: 0.05, 250: 0.05, 100: 0.05, 30: 0.2}
"""
By rate: time [s] in which a push brings a free joint to half its velocity limit at most.

At 30 Hz the gains are so low that the joint moves almost freely during the push.
"""


class Case(NamedTuple):
    """One run: `size` [rad] of the step, `rate` [Hz] of the states, `delay` [ms] of efforts."""

    arm: str
    motion: str
    size: float
    rate: int
    delay: int
    noisy: bool
    has_velocity: bool = True
    disturbance: str = ''
    """A key of `safe_motion_disturbances.DISTURBANCES`, empty for none."""
    command: str = 'computed_torque'
    """The law of the loop, or FEED_FORWARD."""

    @property
    def seed(self) -> int:
        """Return the seed of the noise, the same in any order of execution."""
        return zlib.crc32(repr(tuple(self[:6])).encode())


class Message(NamedTuple):
    """A trajectory, and the time [s] at which it is sent."""

    time: float
    trajectory: JointTrajectory


class Push(NamedTuple):
    """An effort (n,) [N·m] of the environment between two times [s]."""

    begin: float
    end: float
    effort: FloatArray


class Motion(NamedTuple):
    """
    The requested motion of an arm in a case.

    `start` and `goal` (n,) [rad]; `end` [s] is the time at which the motion by the last message
    ends, or the push ends.
    """

    start: FloatArray
    goal: FloatArray
    messages: Sequence[Message]
    push: Push | None
    end: float


def all_cases(arms: Sequence[str] = ARMS, disturbances: Sequence[str] = ('',)) -> list[Case]:
    """
    Return all combinations for these arms, in a random order that is always the same.

    Each case has one of the disturbances. Each of them occurs as often as the others, or once more
    or less, for each combination of arm, rate, delay and noise.
    """
    cases = [Case(*values) for values in itertools.product(
        arms, MOTIONS, SIZES, PERIODS, DELAYS, (False, True))]
    rng, decks = np.random.default_rng(1), dict[tuple[Any, ...], list[str]]()
    for i, case in enumerate(cases):
        deck = decks.setdefault((case.arm, case.rate, case.delay, case.noisy), [])
        if not deck:
            deck += rng.permutation(disturbances).tolist()
        cases[i] = case._replace(disturbance=deck.pop())
    order = np.random.default_rng(0).permutation(len(cases))
    return [cases[i] for i in order]


@cache
def arm_named(name: str) -> ArmModel:
    """Return an arm; raise MissingDependencyError if its description is not installed."""
    return load_arm(description_of(name), JOINTS.get(name, ()))


def description_of(name: str) -> str:
    """Return the URDF of an arm; raise MissingDependencyError if it is not installed."""
    return default_arm_urdf() if name == DEFAULT else (
        sample_robot_path(name).read_text(encoding='utf-8'))


def motion_of(case: Case) -> Motion:
    """Return the motion of a case."""
    arm = arm_named(case.arm)
    start = _start(case.arm)
    direction = np.where(np.arange(arm.joint_count) % 2 == 0, -1.0, 1.0)
    free = np.where(direction > 0.0, arm.limits.upper - start, start - arm.limits.lower)
    goal = start + direction * np.minimum(case.size, free - GOAL_MARGIN)
    if case.motion == SET_POINT:
        return Motion(start, goal, [Message(BEGIN, set_point(arm, goal))], None, BEGIN)
    if case.motion == STREAM:
        return _stream(arm, start, goal)
    if case.motion == TRAJECTORY:
        duration, trajectory = trajectory_to(arm, start, goal)
        return Motion(start, goal, [Message(BEGIN, trajectory)], None, BEGIN + duration)
    hold = Message(BEGIN, set_point(arm, start))
    push = push_of(arm, start, SIZES.index(case.size), case.rate)
    return Motion(start, start, [hold], push, PUSH_END)


def _start(name: str) -> FloatArray:
    arm = arm_named(name)
    lower, upper = arm.limits.lower, arm.limits.upper
    start = np.zeros(arm.joint_count)
    is_bounded = np.isfinite(upper - lower)
    start[is_bounded] = 0.5 * (lower[is_bounded] + upper[is_bounded])
    start[0] = FIRST_JOINT.get(name, start[0])
    return start


def set_point(
    arm: ArmModel, q: FloatArray, v: FloatArray | None = None,
) -> JointTrajectory:
    """Return a set-point with a velocity, or without."""
    return make_trajectory(
        arm.joint_names, [0.0], [q], () if v is None else [v], (), arm.joint_names)


def duration_of(
    arm: ArmModel, start: FloatArray, goal: FloatArray, peak: float, least: float,
    share: float = SPEED,
) -> float:
    """
    Return the duration [s] of a path; `peak` is its largest speed divided by its mean speed.

    The speed is at most `share` of the velocity limits, and SPEED of what the efforts permit.
    """
    body, friction = ArmDynamics(arm).rigid_body, arm.friction
    gravity = np.max([
        np.abs(body.gravity(start + s * (goal - start))) for s in np.linspace(0.0, 1.0)], axis=0)
    effort = np.maximum(arm.limits.effort - gravity - friction.coulomb, 0.0)
    with np.errstate(divide='ignore'):
        speed = np.minimum(share * arm.limits.velocity, SPEED * effort / friction.viscous)
    return max(least, float((peak * np.abs(goal - start) / speed).max()))


def _stream(arm: ArmModel, start: FloatArray, goal: FloatArray) -> Motion:
    """Return set-points along a linear ramp; the last one is repeated."""
    duration = duration_of(arm, start, goal, 1.0, RAMP_TIME)
    count, total = (math.ceil(time / STREAM_PERIOD) for time in (duration, LONGEST - BEGIN))
    points = [set_point(arm, start + i / count * (goal - start)) for i in range(count + 1)]
    messages = [
        Message(BEGIN + i * STREAM_PERIOD, points[min(i, count)]) for i in range(1, total)]
    return Motion(start, goal, messages, None, BEGIN + count * STREAM_PERIOD)


def trajectory_to(
    arm: ArmModel, start: FloatArray, goal: FloatArray,
) -> tuple[float, JointTrajectory]:
    """Return duration [s] and points of a path of positions."""
    peak = max(np.diff([0.0, *PATH_FRACTIONS]) / np.diff([0.0, *PATH_TIMES]))
    duration = duration_of(arm, start, goal, peak, PATH_DURATION)
    return duration, make_trajectory(
        arm.joint_names, [fraction * duration for fraction in PATH_TIMES],
        [start + fraction * (goal - start) for fraction in PATH_FRACTIONS], (), (),
        arm.joint_names)


def push_of(arm: ArmModel, q: FloatArray, index: int, rate: int) -> Push:
    """Return the push of this index: joint by joint, then again with half the effort."""
    j, n = index % arm.joint_count, arm.joint_count
    inertia = 1.0 / np.linalg.inv(ArmDynamics(arm).rigid_body.mass_matrix(q))[j, j]
    v, friction = 0.5 * arm.limits.velocity[j], arm.friction
    largest = inertia * v / PUSH_TIMES[rate] + friction.viscous[j] * v + friction.coulomb[j]
    effort = np.zeros(n)
    effort[j] = 0.5**(index // n) * min(
        PUSH_EFFORT, PUSH_FRACTION * arm.limits.effort[j], largest)
    return Push(PUSH_BEGIN, PUSH_END, effort)
