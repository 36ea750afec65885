# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The uncertainty of an identified model, as parameters of the node (`model.effort_deviation`).

The true parameters are assumed to be those of the regularized least squares (`regularized_fit`)
with their covariance, without bounds and with κ of at most 1, which corresponds to a URDF that is
wrong by about 100 %. The consistent set differs from them by d, because its κ is larger and it has
bounds: the mean square of its error is this covariance plus d dᵀ. Parameters that the recordings
determine have the deviations of the noise; the others have those of such a URDF.

The bodies and rotors are represented by their base parameters for any direction of gravity, so
that the covariance is also valid for an arm with another mounting.
"""

from typing import Any

import numpy as np
from robot_dynamics.analysis.motion_filter import noise_bandwidth
from robot_dynamics.arrays import column_scale, FloatArray
from robot_dynamics.dependencies import optional
from robot_dynamics.identification.friction_regressor import FRICTION_COLUMNS
from robot_dynamics.identification.identified_arm import fitted_friction
from robot_dynamics.identification.pipeline import base_parameters_of, Identification, prior_of
from robot_dynamics.identification.regression import bare_arm
from robot_dynamics.identification.regularized_fit import bounded_problem, own_variables
from robot_dynamics.identification.steps import ModelTest, SPEEDS
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import EffortDeviation, make_uncertainty
from robot_dynamics.model.regressor import random_states
from robot_dynamics.model.uncertainty import friction_share
from robot_dynamics.validation import lower_triangle

LARGEST_REGULARIZATION = 1.0
POSES = 200
LEAST_NOISE = 0.5
"""Least noise away from rest, by the RMS of all residuals: other motions have other errors."""
LEAST_FRICTION = 0.3
"""Least deviation at rest, by the dry friction: other motions may reverse faster."""
GRAVITIES = ((0.0, 0.0, 0.0), (9.81, 0.0, 0.0), (0.0, 9.81, 0.0), (0.0, 0.0, 9.81))
"""The efforts are affine in gravity: these vectors have the parameters of any direction."""


def uncertainty_values(identification: Identification) -> dict[str, Any]:
    """Return the parameters `uncertainty.…` of `dynamics_node`, by name."""
    names, covariance = parameter_covariance(identification)
    noise, friction, velocity = deviations_by_speed(identification.tests['consistent'])
    dry = fitted_friction(identification.arm, identification.models.consistent).at_rest.static
    return {
        'uncertainty.parameters': list(names),
        'uncertainty.covariance': lower_triangle(covariance),
        'uncertainty.noise_deviation': noise.tolist(),
        'uncertainty.friction_deviation': np.maximum(friction, LEAST_FRICTION * dry).tolist(),
        'uncertainty.friction_velocity': velocity.tolist(),
        'uncertainty.noise_bandwidth': min(
            noise_bandwidth(recording.facts.cutoff_hz, recording.facts.rate_hz)
            for recording in identification.recordings),
    }


def holding_deviation(identification: Identification) -> FloatArray:
    """
    Return the deviation (n,) of the effort at rest by the covariance, RMS over random poses.

    The poses are within the position limits, also where nothing was recorded.
    """
    arm = bare_arm(identification.arm)
    names, covariance = parameter_covariance(identification)
    uncertainty = make_uncertainty(arm, names, lower_triangle(covariance))
    if uncertainty is None:
        return np.zeros(arm.joint_count)
    q = random_states(arm, POSES)[0]
    errors = EffortDeviation(ArmDynamics(arm), uncertainty).errors(
        q, np.zeros_like(q), np.zeros_like(q))
    return np.asarray(np.sqrt((errors**2).sum(axis=2).mean(axis=0)))


def deviations_by_speed(test: ModelTest) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return a, b and v_f (n,) of a model from its residuals at single states.

    The node knows no motion before a state. Without classes of speed, b is 0.
    """
    n = len(test.test)
    noise, friction = test.rms('test_by_sample'), np.zeros(n)
    velocity = np.full(n, float(SPEEDS[1]))
    speed = np.append(SPEEDS * np.append(0.5, np.sqrt(SPEEDS[:-1] / SPEEDS[1:])), 2.0 * SPEEDS[-1])
    for j, (squares, counts) in enumerate(zip(*test.by_speed)):
        used = counts > 0.0
        if not squares.any():
            continue
        mean = squares[used] / counts[used]
        found = [_by_likelihood(counts[used], mean, friction_share(speed[used] / v)**2)
                 for v in SPEEDS[1:]]
        best = min(range(len(found)), key=lambda i: found[i][0])
        noise[j] = max(found[best][1], LEAST_NOISE * noise[j])
        friction[j], velocity[j] = found[best][2], SPEEDS[1 + best]
    return noise, friction, velocity


def _by_likelihood(
    counts: FloatArray, mean: FloatArray, share: FloatArray,
) -> tuple[float, float, float]:
    """Return −2 ln of the likelihood, a and b, from mean squares with variances a² + b² share."""
    nnls = optional('scipy.optimize', 'identification').nnls
    variance = np.full_like(mean, float(counts @ mean / counts.sum()))
    least = 1e-6 * variance
    for _ in range(20):
        weight = np.sqrt(counts) / variance
        x = nnls(weight[:, np.newaxis] * np.stack([np.ones_like(share), share], axis=1),
                 weight * mean)[0]
        variance = np.maximum(x[0] + x[1] * share, least)
    cost = float(counts @ (np.log(variance) + mean / variance))
    return cost, float(np.sqrt(x[0])), float(np.sqrt(x[1]))


def parameter_covariance(identification: Identification) -> tuple[tuple[str, ...], FloatArray]:
    """Return the names of k parameters of the consistent set, and their mean squares (k, k)."""
    arm, information = bare_arm(identification.arm), identification.information
    choice = identification.models.choice
    prior = prior_of(arm).for_effort(information)
    A, b, _, _ = bounded_problem(
        information.together(), choice.structures, choice.weights, prior,
        min(choice.regularization, LARGEST_REGULARIZATION))
    base = base_parameters_of(arm, GRAVITIES)
    p, r, size = prior.count, base.rank, A.shape[1]
    names = [base.names[column] for column in base.columns]
    T = np.zeros((r + size - p - arm.joint_count, size))
    T[:r, :p] = base.matrix[:, :p]
    own = own_variables(choice.structures, p)
    for j, (columns, part) in enumerate(own):
        T[:r, part.start] = base.matrix[:, p + j]  # the reflected inertia comes first
        for place, column in enumerate(columns[1:].tolist(), start=part.start + 1):
            T[len(names), place] = 1.0
            parameter = FRICTION_COLUMNS[column - p - 1].parameter
            names.append(f'{parameter.name}({arm.joint_names[j]})')
    # the friction of a joint without effort has no information, and its written values are 0
    scale = column_scale(A)
    inverse = scale[:, np.newaxis] * np.linalg.pinv(A * scale, rcond=1e-12)
    fit = identification.models.consistent
    written = np.concatenate([fit.parameters, *(
        values[columns - p] for values, (columns, _) in zip(fit.joint_values, own))])
    root = T @ np.column_stack([inverse, written - inverse @ b])
    return tuple(names), np.asarray(root @ root.T)
