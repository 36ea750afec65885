# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Positions and velocities of three joints, for the tests of `MotionConsistency`."""

from collections.abc import Callable, Iterator
import itertools
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.monitoring.motion_consistency import MotionConsistency

N = 3
NAMES, KINDS = ('a', 'b', 'c'), ('revolute', 'continuous', 'revolute')
SECOND = 1_000_000_000
FINE = 1e-3
"""[s] between the samples of a true motion."""
RATES = (30, 100, 125, 250, 500, 1000)
class States(NamedTuple):
    """Stamps [ns] (m,), positions and velocities (m, n)."""

    stamps: IntArray
    q: FloatArray
    v: FloatArray


def consistency(kinds: tuple[str, ...] = KINDS) -> MotionConsistency:
    return MotionConsistency([f'joint{i + 1}' for i in range(len(kinds))], kinds)


def alarms(one: MotionConsistency, states: States, reference: FloatArray | None = None) -> (
        Iterator[tuple[int, str]]):
    """Yield the row of each state at which a joint is in doubt or frozen, with the reason."""
    for k, (stamp, q, v) in enumerate(zip(states.stamps.tolist(), states.q, states.v)):
        if not one.update(stamp, q, v, row_of(reference, k)):
            yield k, one.reason


def row_of(reference: FloatArray | None, k: int) -> Callable[[], FloatArray | None]:
    return lambda: None if reference is None else reference[k]


def no_alarm(states: States, reference: FloatArray | None = None, n: int = N) -> None:
    found = list(itertools.islice(alarms(consistency(KINDS[:1] * n if n != N else KINDS), states,
                                         reference), 1))
    assert not found


def smooth_motion(rng: np.random.Generator, seconds: float, speed: float) -> (
        tuple[FloatArray, FloatArray, FloatArray]):
    """Return times [s], positions and velocities of a rest followed by random sines."""
    t = np.arange(0.0, seconds, FINE)
    w = 2.0 * np.pi * rng.uniform(0.1, 1.5, (4, N))
    share = rng.dirichlet(np.ones(4), N).T * speed * rng.choice([-1.0, 1.0], (4, N))
    begin = 0.5
    x = np.maximum(t - begin, 0.0)[:, None, None]
    v = np.sum((1.0 - np.exp(-x / 0.2)) * share * np.sin(w * x), axis=1)
    q = rng.uniform(-3.0, 3.0, N) + np.concatenate((
        np.zeros((1, N)), np.cumsum(0.5 * FINE * (v[1:] + v[:-1]), axis=0)))
    return t, q, v


def sampled(t: FloatArray, q: FloatArray, v: FloatArray, times: FloatArray) -> States:
    """Return the states at these times [s]."""
    return States(
        SECOND + np.round(1e9 * times).astype(np.int64),
        *(np.stack([np.interp(times, t, x[:, j]) for j in range(x.shape[1])], axis=1)
          for x in (q, v)))


def regular(t: FloatArray, rate: int) -> FloatArray:
    return np.arange(0.0, t[-1], 1.0 / rate)


def at_rest(rng: np.random.Generator, rate: int) -> States:
    """Return states at rest for 3 s whose last digits change with every sample."""
    m = 3 * rate
    return States(
        SECOND + np.round(1e9 * np.arange(m) / rate).astype(np.int64),
        0.2 + rng.normal(0.0, 1e-5, (m, N)), rng.normal(0.0, 0.01, (m, N)))
