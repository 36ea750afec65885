# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An excitation motion, which excites all parameters of an arm as well as possible.

The motion is a Fourier series (`fourier_series`) about a start pose, from rest to rest. Its
coefficients minimise the condition number of the base regressor with columns of unit length, which
bounds the amplification of measurement errors in the parameters (M. Gautier and
W. Khalil, "Exciting trajectories for the identification of base inertial parameters of robots",
Int. J. Robotics Research 11(4), 1992; J. Swevers et al., IEEE Trans. Robotics and Automation
13(5), 1997). For any coefficients, the amplitude of each joint is scaled to the limits of its
position, velocity and acceleration. If inverse dynamics requires more effort than is allowed, the
amplitudes of all joints are reduced. Collisions are not checked.

The search compares condition numbers and uses no gradient (`evolution_strategy`), so that the
same seed gives the same trajectory with every BLAS kernel and number of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.regressor import random_states, TorqueRegressor
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics_tools.base_parameters import find_base_parameters
from robot_dynamics_tools.excitation.evolution_strategy import minimize_by_rank
from robot_dynamics_tools.excitation.excitation_limits import effort_ratio, ExcitationLimits
from robot_dynamics_tools.excitation.fourier_series import Basis, free_coefficients, series_basis

MOST_HARMONICS = 50
RANDOM_MOTIONS = 20
"""Number of random motions for comparison; the search starts from the best one."""
GENERATIONS = 200
"""Generations of the evolution strategy."""
FIRST_STEP = 0.5
"""Standard deviation of the first generation, relative to that of the random motions."""
SEARCH_SAMPLES, CHECK_SAMPLES = 12, 200
"""Samples per period of the fastest harmonic, in the search and in the check of limits."""
EFFORT_WEIGHT = 10.0
"""Penalty in the search for twice the allowed effort, in decades of the condition number."""
WORST = 1e8
"""Condition number beyond which the normal equations are numerically singular."""
SMOOTHING_VELOCITY = 0.05
"""Width [rad/s] or [m/s] of the sigmoid that models Coulomb friction."""
KEPT = 1.0 - 2e-4
"""
Fraction of the limits that is used at the samples, so that the motion between them is within.

Between samples a series of degree N exceeds the values at the samples by at most
½ (π / CHECK_SAMPLES)² of its peak, because its second derivative is at most (N ω)² times the peak
(Bernstein's inequality).
"""
KEPT_EFFORT = 1.0 - 2e-3
"""Fraction of the effort limits that is used at the samples; efforts are no such series."""
_SHRINK = 0.97
_SMALLEST_SCALE = 1e-2


@dataclass(frozen=True, eq=False)
class Excitation:
    """
    An excitation motion: the coefficients (2 N − 2, n) of its series about `limits.start`.

    `condition` is its condition number; `random_conditions` are those of random series within the
    same limits. `parameter_count` is the number of base parameters of the regressor.
    """

    coefficients: FloatArray
    limits: ExcitationLimits
    harmonics: int
    duration: float
    parameter_count: int
    condition: float
    random_conditions: FloatArray

    def motion(self, times: FloatArray) -> Reference:
        """Return the motion (m, n) at `times` (m,) [s] from its start."""
        basis = series_basis(self.harmonics, self.duration, times)
        return _motion(basis, self.coefficients, self.limits.start)


class ConditionNumber:
    """Condition number of motions of one arm, for inertia, rotors, friction and offsets."""

    def __init__(self, arm: ArmModel) -> None:
        self._regressor = TorqueRegressor(arm)
        rows = self._rows(Reference(*random_states(arm, 40 * arm.joint_count)))
        names = [str(i) for i in range(rows.shape[1])]
        self._columns = np.array(find_base_parameters(rows, names).columns)
        self.parameter_count = len(self._columns)

    def __call__(self, motion: Reference) -> float:
        """Return the condition number of the base regressor with columns of unit length."""
        W = self._rows(motion)[:, self._columns]
        gram = W.T @ W
        size = np.sqrt(np.diag(gram))
        if not size.all():
            return WORST
        squares = np.linalg.eigvalsh(gram / np.outer(size, size))
        return float(min(np.sqrt(squares[-1] / max(squares[0], 1e-300)), WORST))

    def _rows(self, motion: Reference) -> FloatArray:
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
    """Maps unbounded vectors x, 2 N − 2 numbers per joint, to motions within the limits."""

    def __init__(
        self, dynamics: ArmDynamics, limits: ExcitationLimits, harmonics: int, duration: float,
    ) -> None:
        self._dynamics, self._limits = dynamics, limits
        self._shape = free_coefficients(harmonics), dynamics.arm.joint_count
        self.count = self._shape[0] * self._shape[1]
        self.condition = ConditionNumber(dynamics.arm)

        def basis(samples: int) -> Basis:
            count = samples * harmonics
            return series_basis(harmonics, duration, np.arange(0.0, count) * (duration / count))

        self._few, self._many = basis(SEARCH_SAMPLES), basis(CHECK_SAMPLES)

    def cost(self, x: FloatArray) -> float:
        """Return the decades of the condition number plus the penalty of excessive effort."""
        motion = _motion(self._few, self._swung(x, self._few), self._limits.start)
        excess = max(self._effort_ratio(motion) - 1.0, 0.0)
        return float(np.log10(self.condition(motion)) + EFFORT_WEIGHT * min(excess, 1e3)**2)

    def within_limits(self, x: FloatArray) -> FloatArray:
        """Return the coefficients (2 N − 2, n) of x within all limits; raise InvalidInputError."""
        coefficients = KEPT * self._swung(x, self._many)
        scale = 1.0
        while scale > _SMALLEST_SCALE:
            motion = _motion(self._many, scale * coefficients, self._limits.start)
            if self._effort_ratio(motion) <= KEPT_EFFORT:
                return scale * coefficients
            scale *= _SHRINK
        raise InvalidInputError(
            'even the smallest motion takes more than the allowed effort, expected a larger '
            'effort_scale, or another start')

    def condition_of(self, coefficients: FloatArray) -> float:
        return self.condition(_motion(self._few, coefficients, self._limits.start))

    def _swung(self, x: FloatArray, basis: Basis) -> FloatArray:
        """Return the coefficients of x scaled to the largest amplitude of each joint."""
        coefficients = x.reshape(self._shape)
        return coefficients * self._limits.largest_scale(*(part @ coefficients for part in basis))

    def _effort_ratio(self, motion: Reference) -> float:
        return effort_ratio(self._dynamics.inverse_dynamics_batch(*motion), self._limits.effort)


def find_excitation(
    dynamics: ArmDynamics, limits: ExcitationLimits, harmonics: int, duration: float,
    seed: int = 0,
    when_done: Callable[[float], None] = lambda _: None,
) -> Excitation:
    """
    Return the best motion of `duration` [s] that the search finds.

    The same `seed` gives the same motion. Position, velocity, acceleration and effort stay within
    `limits` at CHECK_SAMPLES times per period of the fastest harmonic. `when_done` is called with
    the completed fraction of the search. Raises InvalidInputError.
    """
    if harmonics > MOST_HARMONICS:
        raise InvalidInputError(f'harmonics is {harmonics}, expected at most {MOST_HARMONICS}')
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


def _motion(basis: Basis, coefficients: FloatArray, start: FloatArray) -> Reference:
    x, v, a = (part @ coefficients for part in basis)
    return Reference(start + x, v, a)

