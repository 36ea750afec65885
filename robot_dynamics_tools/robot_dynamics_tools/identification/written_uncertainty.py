# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The uncertainty of an identified model, as parameters of the node (`model.effort_deviation`).

The true parameters are assumed to be those of the regularized least squares (`regularized_fit`)
with their covariance, without bounds and with κ of at most 1, which corresponds to a URDF that is
wrong by about 100 %. The consistent set differs from them by d, because its κ is larger and it has
bounds: the mean square of its error is this covariance plus d dᵀ. Parameters that the recordings
determine have the deviations of the noise; the others have those of such a URDF.

The noise is calibrated so that the interval ± 2 σ of covariance, friction and noise contains
COVERAGE of the slowest and of the fastest third of the recorded samples of each joint, because
friction that sticks has any value (split conformal prediction: J. Lei et al., J. American
Statistical Association 113(523), 2018). It is not an assumed distribution: the errors of friction
are not normal. Samples for training count without the covariance, because the fit to them has not
its error.

The bodies and rotors are represented by their base parameters for any direction of gravity, so
that the covariance is also valid for an arm with another mounting.
"""

from typing import Any

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation, make_uncertainty
from robot_dynamics.model.regressor import random_states
from robot_dynamics.validation import lower_triangle
from robot_dynamics_tools.analysis.motion_filter import noise_bandwidth
from robot_dynamics_tools.estimation.effort_fit import decomposed
from robot_dynamics_tools.identification.friction_regressor import FRICTION_COLUMNS
from robot_dynamics_tools.identification.identified_arm import fitted_friction
from robot_dynamics_tools.identification.pipeline import base_parameters_of, Identification
from robot_dynamics_tools.identification.regularized_fit import bounded_problem
from robot_dynamics_tools.identification.uncertainty import base_variables

LARGEST_REGULARIZATION = 1.0
POSES = 200
COVERAGE = 0.9545
"""Share of the recorded samples within 2 σ: that of a normal distribution."""
SHARP_PART = 0.6
"""Weight of the effort before the filter in the friction at rest, which has sharper peaks."""
THIRDS = 1.0 / 3.0, 2.0 / 3.0
"""Shares of the recorded samples that are slow, and that are not fast."""
GRAVITIES = ((0.0, 0.0, 0.0), (9.81, 0.0, 0.0), (0.0, 9.81, 0.0), (0.0, 0.0, 9.81))
"""The efforts are affine in gravity: these vectors have the parameters of any direction."""


def uncertainty_values(identification: Identification) -> dict[str, Any]:
    """Return the parameters `uncertainty.…` of `dynamics_node`, by name."""
    names, covariance = parameter_covariance(identification)
    return {
        'uncertainty.parameters': list(names),
        'uncertainty.covariance': lower_triangle(covariance),
        **{f'uncertainty.{name}': values.tolist()
           for name, values in recorded_deviations(identification).items()}}


def holding_deviation(identification: Identification) -> FloatArray:
    """
    Return the deviation (n,) of the effort at rest by the covariance, RMS over random poses.

    The poses are within the position limits, also where nothing was recorded.
    """
    q = random_states(identification.arm.with_payloads(()), POSES)[0]
    rest = np.zeros_like(q)
    errors = _model_deviation(identification).errors(q, rest, rest)
    return np.asarray(np.sqrt((errors**2).sum(axis=2).mean(axis=0)))


def recorded_deviations(identification: Identification) -> dict[str, FloatArray]:
    """
    Return the deviations of noise and of friction at rest, its velocity, and the largest, (n,).

    The residuals are those at single states, because the node knows no motion before a state. The
    noise of the effort before the filter has the bandwidth of the samples: that of the noise is
    such that it counts as white up to there.
    """
    deviation = _model_deviation(identification)
    shown = identification.recordings
    motions = [each.motion for each in shown]
    known = [  # the covariance, which samples for training lack
        (motion.times >= each.test_from)[:, np.newaxis] * (
            deviation.errors(*motion.state())**2).sum(axis=2)
        for each, motion in zip(shown, motions)]
    speed = np.abs(np.concatenate([motion.velocity for motion in motions]))
    slow, fast = np.quantile(speed, THIRDS, axis=0)
    left = np.maximum(1.0 - speed / np.maximum(fast, 1e-12), 1e-3)

    measured = [motion.measured_effort for motion in motions]
    raw = [effort if motion.recorded_effort is None else motion.recorded_effort
           for effort, motion in zip(measured, motions)]

    def covered(values: FloatArray, is_part: BoolArray) -> FloatArray:
        return np.maximum([np.quantile(own[rows], COVERAGE)
                           for own, rows in zip(values.T, is_part.T)], 0.0)

    behind, before = (np.concatenate([
        0.25 * (effort - each.single)**2 - of_model
        for each, effort, of_model in zip(shown, efforts, known)]) for efforts in (measured, raw))
    noise = covered(behind, speed >= fast)
    friction, sharp = (
        covered((variance - covered(variance, speed >= fast)) / left**2, speed <= slow)
        for variance in (behind, before))
    friction = (1.0 - SHARP_PART) * friction + SHARP_PART * sharp
    wide = covered(before - friction * left**2, speed >= 0.0)
    band = min(noise_bandwidth(each.cutoff_hz, each.sample_rate_hz) for each in motions)
    ratio = np.divide(noise, wide, out=np.ones_like(noise), where=wide > 0.0)
    return {
        'noise_deviation': np.sqrt(noise),
        'noise_bandwidth': np.maximum(
            0.5 * motions[0].sample_rate_hz * min(float(np.median(ratio)), 1.0), band),
        'friction_deviation': np.sqrt(friction), 'friction_velocity': fast,
        'largest_velocity': speed.max(axis=0)}


def _model_deviation(identification: Identification) -> EffortDeviation:
    """Return the deviation by the covariance of the parameters."""
    arm = identification.arm.with_payloads(())
    names, covariance = parameter_covariance(identification)
    uncertainty = make_uncertainty(arm, names, lower_triangle(covariance))
    assert uncertainty is not None  # there are names: those of the rotors
    return EffortDeviation(ArmDynamics(arm.with_friction(
        fitted_friction(arm, identification.models.consistent))), uncertainty)


def parameter_covariance(identification: Identification) -> tuple[tuple[str, ...], FloatArray]:
    """Return the names of k parameters of the consistent set, and their mean squares (k, k)."""
    arm, information = identification.arm.with_payloads(()), identification.information
    problem = identification.models.problem
    A, b, _, _ = bounded_problem(information.together(), problem._replace(
        regularization=min(problem.regularization, LARGEST_REGULARIZATION)))
    base, p = base_parameters_of(arm, GRAVITIES), problem.prior.count
    T, _, own = base_variables(base, problem)
    names = [base.names[column] for column in base.columns] + [
        f'{FRICTION_COLUMNS[column - 1].parameter.name}({arm.joint_names[j]})'
        for j, column in own]
    # the friction of a joint without effort has no information, and its written values are 0
    inverse = decomposed(A, 1e-12).inverse
    fit = identification.models.consistent
    written = np.concatenate([fit.parameters, *(
        values[columns - p] for values, (columns, _) in zip(fit.joint_values, problem.own))])
    root = T @ np.column_stack([inverse, written - inverse @ b])
    return tuple(names), np.asarray(root @ root.T)
