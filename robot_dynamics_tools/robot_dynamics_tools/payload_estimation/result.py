# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The result of an estimation: values, deviations, verdict, advice and remarks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model.payload_check import LEAST_DISTANCE, reach, REACH_MULTIPLE
from robot_dynamics.model.regressor import COUNT, LoadRegressor, NAMES, random_states
from robot_dynamics_tools.estimation.effort_fit import decomposed, inverse_of
from robot_dynamics_tools.payload_estimation.advice import advise, Knowledge
from robot_dynamics_tools.payload_estimation.information import Solution
from robot_dynamics_tools.payload_estimation.rows import LoadRows
from robot_dynamics_tools.payload_estimation.variance_groups import RestRow
from robot_dynamics_tools.pseudo_inertia import is_consistent

UNITS = ('kg', *('kg·m',) * 3, *('kg·m²',) * 6)
OBSERVABLE, UNOBSERVABLE = 'observable', 'not observable'
INSEPARABLE, NO_EFFECT = 'inseparable', 'no effect'
LARGEST_DEVIATIONS = np.array([0.1, *(0.005,) * 3, *(0.003,) * 6])
"""
Largest deviations of observable parameters per kilogram of mass [kg, kg·m, kg·m²].

With that of the first moments, the centre of mass is known to 1 cm in 95 % of the cases.
"""
LEAST_MASSES = np.array([1.0, *(0.2,) * 3, *(1.0,) * 6])
"""Masses [kg] that a smaller mass counts as."""
LEAST_PART_OF_DRIVES = 0.5
"""Part of the variance of a parameter from which on calibrating the drives comes first."""
CALIBRATE = (
    'scale and mass are confounded: calibrate_gravity with a known weight separates them, or hold '
    'more poses, in which the gravity torque of the arm without the load differs')
_STATES = 40
_NOTHING = 1e-9


@dataclass(frozen=True, eq=False)
class PayloadEstimate(Solution):
    """
    What is attached to `link`: π = (m, m c, I), each (10,), in the frame of the link.

    `values` [kg, kg·m, kg·m²] have the standard `deviations`, infinite without effect. `verdicts`
    has one of OBSERVABLE, UNOBSERVABLE, INSEPARABLE (every motion of this arm depends only on a
    sum with others) and NO_EFFECT. `duration` [s], `holds`, `pairs` and `singles` (rests of single
    joints) and `blocks` (of motion) count the data. `implausible` says why the estimate is
    physically impossible.
    """

    link: str
    verdicts: tuple[str, ...]
    duration: float
    holds: int
    pairs: int
    singles: int
    blocks: int
    friction: str
    advice: tuple[str, ...]
    implausible: tuple[str, ...]
    remarks: tuple[str, ...]
    joint_names: tuple[str, ...]

    @property
    def mass(self) -> float:
        return float(self.values[0])

    @property
    def com(self) -> FloatArray:
        """Centre of mass (3,) [m], NaN if the mass is not above 0."""
        return self.values[1:4] / self.mass if self.mass > 0.0 else np.full(3, np.nan)

    @property
    def com_deviations(self) -> FloatArray:
        """Standard deviations (3,) [m] of the centre of mass, NaN if the mass is not above 0."""
        if not self.mass > 0.0:
            return np.full(3, np.nan)
        slope = np.hstack([-self.com[:, None], np.eye(3)]) / self.mass
        known = np.isfinite(self.deviations[:4])
        widening = np.where(known, self.deviations[:4], 0.0) / np.sqrt(
            np.diag(self.covariance)[:4])
        covariance = self.covariance[:4, :4] * np.outer(widening, widening)
        deviations = np.sqrt(np.einsum('ij,jk,ik->i', slope, covariance, slope))
        return np.where(known[1:], deviations, np.inf)

    @property
    def is_observable(self) -> bool:
        """Return whether the mass and all first moments that have an effect are observable."""
        return self.verdicts[0] == OBSERVABLE and all(
            verdict in (OBSERVABLE, NO_EFFECT) for verdict in self.verdicts[1:4])

    @property
    def has_inertia(self) -> bool:
        """Return whether the whole inertia tensor is observable."""
        return all(verdict == OBSERVABLE for verdict in self.verdicts[4:])

    def payload(self) -> Payload:
        """
        Return the estimate as a payload, a point mass unless the whole inertia is observable.

        Raises InvalidInputError if it is not observable, or physically impossible.
        """
        if not self.is_observable:
            missing = [name for name, verdict in zip(NAMES[:4], self.verdicts)
                       if verdict not in (OBSERVABLE, NO_EFFECT)]
            raise InvalidInputError(
                f'the estimate has no observable {", ".join(missing)}, expected mass and first '
                'moments to be observable: ' + ('; '.join(self.advice) or 'move the arm'))
        if self.implausible:
            raise InvalidInputError('the estimate is implausible: ' + '; '.join(self.implausible))
        inertia = None
        if self.has_inertia and is_consistent(self.values):
            inertia = np.array(pin.Inertia.FromDynamicParameters(self.values).inertia)
        return make_payload(self.link, self.mass, self.com, inertia)


def make_result(
    arm: ArmModel, link: str, solution: Solution, rows: LoadRows, rests: Sequence[RestRow],
    band: FloatArray, block: float, position: FloatArray | None, with_advice: bool,
    scale_deviation: float,
) -> PayloadEstimate:
    """
    Return the result of a solution; `position` (n,) is the present one, None without data.

    `scale_deviation` is the assumed one of the effort scales, 0 if they are known.
    """
    certain_mass = abs(solution.values[0]) - 2.0 * solution.deviations[0]
    limit = LARGEST_DEVIATIONS * np.maximum(LEAST_MASSES, certain_mass)
    verdicts = _verdicts(LoadRegressor(arm, link), solution, limit)
    missing = [i for i, verdict in enumerate(verdicts) if verdict == UNOBSERVABLE]
    advice: tuple[str, ...] = ()
    if with_advice and position is not None and missing:
        advice = advise(arm, link, missing, Knowledge(
            solution.values, inverse_of(solution.covariance), limit, position, solution.expected,
            block))
    if scale_deviation and advice and (solution.of_drives[missing] > LEAST_PART_OF_DRIVES).any():
        advice = (CALIBRATE, *advice)
    remarks = _unknown_errors(arm, scale_deviation, float(solution.of_drives[0]))
    if all(verdict == OBSERVABLE for verdict in verdicts) and not is_consistent(solution.values):
        remarks += ('no mass distribution has the estimated inertia: its error is too large',)
    pairs = sum(one.is_paired for one in rests)
    deviations = np.where([one == NO_EFFECT for one in verdicts], np.inf, solution.deviations)
    return PayloadEstimate(
        **vars(replace(solution, deviations=deviations)), link=link, verdicts=verdicts,
        duration=rows.duration, holds=rows.holds, pairs=pairs,
        singles=len(rests) - pairs, blocks=int(rows.count.sum()),
        friction=_friction_text(pairs, len(rests) - pairs, band), advice=advice,
        implausible=_implausible(arm, solution, verdicts), remarks=remarks,
        joint_names=arm.joint_names)


def _unknown_errors(arm: ArmModel, scale_deviation: float, of_drives: float) -> tuple[str, ...]:
    """Return what is assumed about the drives, and which errors are not part of the deviations."""
    remarks: tuple[str, ...] = ()
    if scale_deviation:
        remarks = (
            'no calibrated drives: a wrong torque constant is assumed at each joint, with a '
            f'deviation of {100.0 * scale_deviation:g} % (--scale-deviation), which causes '
            f'{100.0 * of_drives:.0f} % of the variance of the mass',)
    elif arm.given_report.covariance is None:
        remarks = ('a wrong torque constant changes the estimate, and is not part of the '
                   'deviations: see the error per 1 % of the measured effort',)
    if arm.uncertainty is not None and arm.uncertainty.has_covariance:
        return remarks
    return (*remarks, 'a wrong mass of the arm in the URDF changes the estimate, and is not part '
            'of the deviations')


def _verdicts(regressor: LoadRegressor, solution: Solution, limit: FloatArray) -> tuple[str, ...]:
    """Return the verdict on each parameter, from random states and from the deviations."""
    Y = regressor(*random_states(regressor.arm, _STATES)).reshape(-1, COUNT)
    has_effect = np.abs(Y).max(axis=0) > _NOTHING * max(np.abs(Y).max(), 1e-300)
    return tuple(
        NO_EFFECT if not effect else INSEPARABLE if is_lost else
        OBSERVABLE if deviation <= largest else UNOBSERVABLE
        for effect, is_lost, deviation, largest in zip(
            has_effect, decomposed(Y * has_effect).is_lost, solution.deviations, limit))


def _friction_text(pairs: int, singles: int, band: FloatArray) -> str:
    """Return how dry friction at rest is treated."""
    if not pairs + singles:
        return 'no rest is used: dry friction at rest has no effect'
    known = 'within the dry friction of the model' if band.any() else (
        'estimated from the residuals, because the model has no dry friction')
    parts = []
    if pairs:
        parts.append(f'{pairs} pairs of rests of a joint, approached from both directions, are '
                     'averaged: dry friction cancels')
    if singles:
        parts.append(f'{singles} rests of a joint have no partner: their friction of unknown '
                     f'sign is part of the deviations, {known}')
    return '; '.join(parts)


def _implausible(arm: ArmModel, solution: Solution, verdicts: tuple[str, ...]) -> tuple[str, ...]:
    """Return what is physically impossible; values are reported as they are, not clipped."""
    if verdicts[0] != OBSERVABLE:
        return ()
    mass, deviation = float(solution.values[0]), float(solution.deviations[0])
    if mass <= 0.0:
        return (f'm is {mass:.4g} kg (deviation {deviation:.2g} kg), expected a mass > 0: nothing '
                'is attached, or the model is heavier than the arm, or efforts are too small',)
    limit = max(REACH_MULTIPLE * reach(arm), LEAST_DISTANCE)
    distance = float(np.linalg.norm(solution.values[1:4])) / mass
    if all(verdict in (OBSERVABLE, NO_EFFECT) for verdict in verdicts[1:4]) and distance > limit:
        return (f'the centre of mass is {distance:.3g} m from the origin of the link, '
                f'expected at most {limit:.3g} m',)
    return ()
