# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A reference generator of two joints, set-points for it, and samples of its references."""

from collections.abc import Callable
from typing import Any, NamedTuple

from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import (
    JointTrajectory,
    make_trajectory,
    nanoseconds,
)

NAMES = ('a', 'b')
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
ZERO = np.zeros(2)
TOLERANCE = 1.05

laws = settings(max_examples=25)
angles = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2).map(np.array)
Motion = Callable[[float], tuple[FloatArray, FloatArray]]


def limits_of(v: float = 1.0, a: float = 5.0, j: float = 90.0, box: float = 10.0) -> MotionLimits:
    return MotionLimits(*np.full((2, 5), (-box, box, v, a, j)).T)


def generator(limits: MotionLimits | None = None) -> ReferenceGenerator:
    return ReferenceGenerator(NAMES, (), limits or limits_of())


def set_point(q: Any, v: Any = None, a: Any = None, wait: float = 0.0) -> JointTrajectory:
    velocities, accelerations = (() if x is None else [x] for x in (v, a))
    return make_trajectory(NAMES, [wait], [q], velocities, accelerations)


def ns(t: float) -> int:
    return NOW + nanoseconds(t)


def at(one: ReferenceGenerator, t: float) -> Reference:
    reference = one.sample(ns(t))
    assert reference is not None
    return reference


class Samples(NamedTuple):
    """Times (m,) [s] after NOW, and the references at these times, (m, n) each."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray

    @property
    def jerk(self) -> float:
        return float(np.abs(np.diff(self.a, axis=0) / np.diff(self.t)[:, np.newaxis]).max())

    def after(self, t: float) -> 'Samples':
        return Samples(*(x[self.t >= t] for x in self))


def samples(one: ReferenceGenerator, start: float, end: float, count: int = 200) -> Samples:
    ts = np.linspace(start, end, count)
    return Samples(ts, *(np.array(x) for x in zip(*(at(one, t) for t in ts.tolist()))))


def stream(one: ReferenceGenerator, motion: Motion, h: float, end: float, with_v: bool) -> Samples:
    """Send a set-point every h [s]; sample at least 4 times per period, and every 5 ms."""
    parts, count = [], max(4, round(h / 0.005))
    for i in range(round(end / h)):
        q, v = motion(i * h)
        one.start(set_point(q, v if with_v else None), ns(i * h), ZERO, ZERO)
        parts.append(samples(one, i * h, (i + 1) * h - 1e-9, count))
    return Samples(*(np.concatenate(x) for x in zip(*parts)))


def sine(t: float) -> tuple[FloatArray, FloatArray]:
    phase = OMEGA * t + np.array((0.0, 1.0))
    return AMPLITUDE * np.sin(phase), AMPLITUDE * OMEGA * np.cos(phase)


def ramp(t: float) -> tuple[FloatArray, FloatArray]:
    v = np.array((0.2, -0.1))
    return v * t, v


OMEGA, AMPLITUDE = 4.0, 0.1
