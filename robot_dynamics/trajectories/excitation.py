# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
An exciting motion: one that tells as much as it can about the parameters of an arm.

The motion is a Fourier series (`fourier_series`) about a start pose, from rest to rest. Its
coefficients minimise the condition number of the base regressor with columns of unit length, by
which errors of the measurement at most grow on their way into the parameters (M. Gautier and
W. Khalil, "Exciting trajectories for the identification of base inertial parameters of robots",
Int. J. Robotics Research 11(4), 1992; J. Swevers et al., IEEE Trans. Robotics and Automation
13(5), 1997). Whatever the coefficients, each joint swings as far as its limits of position,
velocity and acceleration let it; where inverse dynamics asks for more effort than is allowed, all
joints swing less. Collisions are not checked.

The search compares condition numbers and uses no gradient (`evolution_strategy`), so that the
same seed gives the same trajectory with every BLAS kernel and number of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction import smooth_sign
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.base_parameters import find_base_parameters
from robot_dynamics.model.regressor import random_states, TorqueRegressor
from robot_dynamics.trajectories.evolution_strategy import minimize_by_rank
from robot_dynamics.trajectories.excitation_limits import MotionLimits
from robot_dynamics.trajectories.fourier_series import free_coefficients, series_basis, SeriesBasis

MOST_HARMONICS = 50
RANDOM_MOTIONS = 20
"""Random motions to compare with; the search starts from the best."""
GENERATIONS = 200
"""Generations of the evolution strategy."""
FIRST_STEP = 0.5
"""Standard deviation of its first generation, relative to that of the random motions."""
SEARCH_SAMPLES, CHECK_SAMPLES = 12, 200
"""A period of the fastest harmonic: of the search, and of the check of limits."""
EFFORT_WEIGHT = 10.0
"""Decades of condition number that twice the allowed effort costs in the search."""
WORST = 1e8
"""A condition number beyond which squares tell nothing."""
SMOOTHING_VELOCITY = 0.05
"""[rad/s] or [m/s] of the sigmoid that stands for Coulomb friction."""
KEPT = 1.0 - 2e-4
"""
Share of the limits that is used at the samples, so that nothing passes them in between.

Between samples a series of degree N exceeds them by at most ½ (π / CHECK_SAMPLES)² of its peak, as
its second derivative is at most (N ω)² times that (Bernstein's inequality).
"""
KEPT_EFFORT = 1.0 - 2e-3
"""Likewise for efforts, which are no such series."""
_SHRINK = 0.97
_SMALLEST_SCALE = 1e-2


class Motion(NamedTuple):
    """Position, velocity and acceleration at m times, (m, n) each."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, eq=False)
class Excitation:
    """
    An exciting motion: the coefficients (2 N − 2, n) of its series about `limits.start`.

    `condition` is its condition number, beside those of random series within the same limits;
    `parameter_count` is the number of base parameters that it is of.
    """

    coefficients: FloatArray
    limits: MotionLimits
    harmonics: int
    duration: float
    parameter_count: int
    condition: float
    random_conditions: FloatArray

    def motion(self, times: FloatArray) -> Motion:
        """Return the motion at `times` (m,) [s] from its start."""
        basis = series_basis(self.harmonics, self.duration, times)
        return _motion(basis, self.coefficients, self.limits.start)


class ConditionNumber:
    """The condition number of motions of one arm: of inertia, rotors, friction and offsets."""

    def __init__(self, arm: ArmModel) -> None:
        self._regressor = TorqueRegressor(arm)
        rows = self._rows(Motion(*random_states(arm, 40 * arm.joint_count)))
        names = [str(i) for i in range(rows.shape[1])]
        self._columns = np.array(find_base_parameters(rows, names).columns)

    @property
    def parameter_count(self) -> int:
        return len(self._columns)

    def __call__(self, motion: Motion) -> float:
        """Return the condition number of the base regressor with columns of unit length."""
        W = self._rows(motion)[:, self._columns]
        gram = W.T @ W
        size = np.sqrt(np.diag(gram))
        if not size.all():
            return WORST
        squares = np.linalg.eigvalsh(gram / np.outer(size, size))
        return float(min(np.sqrt(squares[-1] / max(squares[0], 1e-300)), WORST))

    def _rows(self, motion: Motion) -> FloatArray:
        """Return the whole regressor, one row for each effort of each sample."""
        q, v, a = motion
        m, n = q.shape
        joints = np.zeros((m, n, 4, n))
        j = np.arange(n)
        for kind, column in enumerate((a, v, smooth_sign(v, SMOOTHING_VELOCITY), np.ones_like(v))):
            joints[:, j, kind, j] = column
        bodies = self._regressor(q, v, a)
        return np.concatenate((bodies, joints.reshape(m, n, 4 * n)), axis=2).reshape(m * n, -1)


class _Search:
    """Motions of one arm within its limits, by numbers x of any size: 2 N − 2 for each joint."""

    def __init__(
        self, dynamics: ArmDynamics, limits: MotionLimits, harmonics: int, duration: float,
    ) -> None:
        self._dynamics, self._limits = dynamics, limits
        self._shape = free_coefficients(harmonics), dynamics.arm.joint_count
        self.count = self._shape[0] * self._shape[1]
        self.condition = ConditionNumber(dynamics.arm)

        def basis(samples: int) -> SeriesBasis:
            count = samples * harmonics
            return series_basis(harmonics, duration, np.arange(0.0, count) * (duration / count))

        self._few, self._many = basis(SEARCH_SAMPLES), basis(CHECK_SAMPLES)

    def cost(self, x: FloatArray) -> float:
        """Return the decades of the condition number, and what too much effort costs."""
        motion = _motion(self._few, self._swung(x, self._few), self._limits.start)
        excess = max(self._effort_ratio(motion) - 1.0, 0.0)
        return float(np.log10(self.condition(motion)) + EFFORT_WEIGHT * min(excess, 1e3)**2)

    def within_limits(self, x: FloatArray) -> FloatArray:
        """Return the coefficients (2 N − 2, n) of x, within all limits; raise as below."""
        coefficients = KEPT * self._swung(x, self._many)
        scale = 1.0
        while scale > _SMALLEST_SCALE:
            motion = _motion(self._many, scale * coefficients, self._limits.start)
            if self._effort_ratio(motion) <= KEPT_EFFORT:
                return scale * coefficients
            scale *= _SHRINK
        raise InvalidInputError(
            'even the slightest motion takes more than the allowed effort, expected a larger '
            'effort_scale, or another start')

    def condition_of(self, coefficients: FloatArray) -> float:
        return self.condition(_motion(self._few, coefficients, self._limits.start))

    def _swung(self, x: FloatArray, basis: SeriesBasis) -> FloatArray:
        """Return the coefficients of x with which each joint swings as far as it may."""
        coefficients = x.reshape(self._shape)
        return coefficients * self._limits.largest_scale(*basis.motion(coefficients))

    def _effort_ratio(self, motion: Motion) -> float:
        return self._limits.effort_ratio(self._dynamics.inverse_dynamics_batch(*motion))


def find_excitation(
    dynamics: ArmDynamics, limits: MotionLimits, harmonics: int, duration: float, seed: int = 0,
    when_done: Callable[[float], None] = lambda _: None,
) -> Excitation:
    """
    Return the best motion of `duration` [s] that the search finds.

    The same `seed` gives the same motion. Position, velocity, acceleration and effort stay within
    `limits` at CHECK_SAMPLES times per period of the fastest harmonic. `when_done` is called with
    the completed fraction of the search. Raises InvalidInputError.
    """
    if harmonics > MOST_HARMONICS:
        raise InvalidInputError(
            f'harmonics is {harmonics}, expected at most {MOST_HARMONICS}')
    search = _Search(dynamics, limits, harmonics, duration)
    random = np.random.default_rng(seed)
    guesses = [random.normal(size=search.count) for _ in range(RANDOM_MOTIONS)]
    others = np.array([search.condition_of(search.within_limits(x)) for x in guesses])
    best = minimize_by_rank(
        search.cost, min(guesses, key=search.cost), FIRST_STEP, GENERATIONS, random,
        lambda generation: when_done(generation / GENERATIONS))
    coefficients = search.within_limits(best)
    return Excitation(
        coefficients, limits, harmonics, duration, search.condition.parameter_count,
        search.condition_of(coefficients), others)


def _motion(basis: SeriesBasis, coefficients: FloatArray, start: FloatArray) -> Motion:
    x, v, a = basis.motion(coefficients)
    return Motion(start + x, v, a)

