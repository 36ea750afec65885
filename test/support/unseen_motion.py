# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Hours of the external effort that an observer finds on an arm without contact, fast.

The effort of the arm differs from that of the model by masses, friction with presliding, and
noise. The observer passes this difference through its filter of first order
(`test_external_effort.py`); the difference of the rigid bodies, which is smooth, is interpolated.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import SMOOTHING_VELOCITY
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model import ArmModel, RigidBody
from robot_dynamics.monitoring.contact_levels import BLOCK, ContactLevels
from scipy.signal import lfilter

RATE = 100.0
BANDWIDTH = 10.0
COARSE = 4
"""Samples between two at which the rigid bodies are computed."""
PRESLIDING = 0.002
"""[rad]"""


class Motion(NamedTuple):
    """Minimum-jerk moves with pauses, each (m, n), and the measured effort."""

    q: FloatArray
    v: FloatArray
    a: FloatArray


def random_moves(arm: ArmModel, seconds: float, rng: np.random.Generator) -> Motion:
    """Return moves between random positions, at up to the velocity limits, with pauses."""
    n = arm.joint_count
    lower, upper = (np.clip(each, -2.5, 2.5) for each in (arm.limits.lower, arm.limits.upper))
    speed = np.where(
        np.isfinite(arm.limits.velocity) & (arm.limits.velocity > 0.0), arm.limits.velocity, 2.0)
    pieces, count, at = [], 0, 0.5 * (lower + upper)
    while count < seconds * RATE:
        goal = rng.uniform(0.75 * lower + 0.25 * upper, 0.25 * lower + 0.75 * upper, n)
        moves = rng.uniform(size=n) < 0.7
        d = np.where(moves, goal - at, 0.0)
        T = max(0.5, float((1.875 * np.abs(d) / speed).max()) / rng.uniform(0.2, 0.9))
        s = np.arange(0.0, 1.0, 1.0 / (T * RATE))[:, None]
        piece = [at + d * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
                 d / T * 30.0 * s**2 * (1.0 - s)**2,
                 d / T**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)]
        at = at + d
        rest = np.zeros((int(rng.uniform(0.0, 1.0) * RATE), n))
        pieces.append([np.concatenate(each) for each in zip(piece, (rest + at, rest, rest))])
        count += len(pieces[-1][0])
    return Motion(*(np.concatenate(each)[:round(seconds * RATE)] for each in zip(*pieces)))


def difference(
    model: ArmModel, true: ArmModel, motion: Motion, rng: np.random.Generator,
) -> FloatArray:
    """Return measured effort − effort of the model (m, n), with noise."""
    coarse = [each[::COARSE] for each in motion]
    bodies = [RigidBody(arm).inverse_dynamics_batch(*coarse) for arm in (true, model)]
    k, places = np.arange(len(motion.q)), np.arange(0, len(motion.q), COARSE)
    rigid = np.stack([np.interp(k, places, each) for each in (bodies[0] - bodies[1]).T], axis=1)
    z = presliding_state(motion.q, motion.v, np.full(model.joint_count, PRESLIDING))
    smooth = smooth_sign(motion.v, SMOOTHING_VELOCITY)
    friction = true.friction.viscous * motion.v + true.friction.coulomb * z - (
        model.friction.viscous * motion.v + model.friction.coulomb * smooth)
    noise = model.uncertainty.noise(0.5 * RATE, 1.0 / RATE) * rng.normal(size=rigid.shape)
    return np.asarray(rigid + friction + noise)


def filtered(effort: FloatArray) -> FloatArray:
    """Return the estimate of the observer (m, n) of an external effort of −`effort`."""
    fraction = -np.expm1(-2.0 * np.pi * BANDWIDTH / RATE)
    return np.asarray(lfilter([fraction], [1.0, fraction - 1.0], -effort, axis=0))


def alarms(levels: ContactLevels, v: FloatArray, r: FloatArray) -> int:
    """Return the number of contacts that `ContactDetector` finds, fast."""
    rows = np.flatnonzero((np.abs(r) > levels.at(v)).any(axis=1))
    return int(np.sum(np.diff(rows) >= BLOCK * RATE - 0.5)) + bool(len(rows))
