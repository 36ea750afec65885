# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""Cost of each rigid-body quantity over the number of joints of an arm, with the library."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.chains import chain_urdf, spatial_chain
from benchmarks.timing import medians
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody

JOINTS = (2, 3, 4, 5, 7, 10, 14, 20, 30, 40, 50, 60)
LONG = 10
"""Joints from which the exponents are fitted: below, the cost of a call itself dominates."""
STATES = 5
ROUNDS = 9
INVERSE_DYNAMICS = 'inverse dynamics'

Times = Mapping[str, FloatArray]
"""Time per call [s] by quantity, one value per number in JOINTS."""


class LinearFit(NamedTuple):
    """A straight line a + b n, and the share R² of the variance that the line explains."""

    a: float
    b: float
    r_squared: float


def linear_fit(times: FloatArray) -> LinearFit:
    """Return the least-squares line through the times at JOINTS."""
    n = np.array(JOINTS, dtype=np.float64)
    b, a = np.polyfit(n, times, 1)
    residual = times - (a + b * n)
    return LinearFit(float(a), float(b), float(1.0 - residual.var() / times.var()))


def exponent(times: FloatArray) -> float:
    """Return p of times ~ n^p for LONG or more joints: the slope of a line through logarithms."""
    n = np.array(JOINTS, dtype=np.float64)
    long = n >= LONG
    return float(np.polyfit(np.log(n[long]), np.log(times[long]), 1)[0])


def _calls(n: int) -> dict[str, tuple[Callable[..., object], Sequence[tuple[Any, ...]]]]:
    """Return the calls for each quantity of a chain of n joints, and states as arguments."""
    body = UncheckedRigidBody(load_arm(chain_urdf(spatial_chain(n))))
    states = [tuple(state) for state in np.random.default_rng(n).uniform(-1, 1, (STATES, 3, n))]
    positions = [state[:1] for state in states]
    motions = [state[:2] for state in states]
    return {
        INVERSE_DYNAMICS: (body.inverse_dynamics, states),
        'gravity': (body.gravity, positions),
        'mass matrix': (body.mass_matrix, positions),
        'Coriolis matrix': (body.coriolis_matrix, motions),
        'all terms': (body.terms, states),
        'forward dynamics': (body.forward_dynamics, states),
    }


def measure() -> Times:
    """Return the medians of interleaved rounds over the quantities of each chain."""
    rows = [medians(_calls(n), ROUNDS) for n in JOINTS]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def main() -> None:
    """Print µs per call and the fits."""
    report(measure())


def report(times: Times) -> None:
    """Print the measured times and fits; docs/pictures/growth.py reads the printed table."""
    print(f'{"µs per call":18}' + ''.join(f'{joints:9}' for joints in JOINTS) + ' joints')
    for name, values in times.items():
        print(f'{name:18}' + ''.join(f'{1e6 * value:9.1f}' for value in values))
    line = linear_fit(times[INVERSE_DYNAMICS])
    print(f'{INVERSE_DYNAMICS}: {1e6 * line.a:.1f} µs + {1e6 * line.b:.3f} µs per joint, '
          f'R² = {line.r_squared:.4f}')
    powers = ', '.join(f'{name} {exponent(values):.2f}' for name, values in times.items())
    print(f'exponents from {LONG} to {JOINTS[-1]} joints: {powers}')
