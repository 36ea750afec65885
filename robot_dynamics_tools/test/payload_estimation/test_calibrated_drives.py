# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Deviations of a payload that contain the errors of calibrated drives."""

from dataclasses import replace

import numpy as np
from payload_bench import Case, errors_in_deviations, estimated, hidden_load, measured, samples_of
import pytest
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics_tools.payload_estimation import PayloadEstimate


def estimate_with_uncertain_drives(
    name: str, seed: int, kind: str,
) -> tuple[Case, PayloadEstimate, PayloadEstimate]:
    """Return the case, the estimate of calibrated drives, and that of drives taken as exact."""
    exact = hidden_load(name, seed)
    samples, n, limit = samples_of(exact, kind), exact.arm.joint_count, exact.arm.limits.effort
    common = np.outer(np.ones(n), np.ones(n))  # a part of the error is that of the weight
    C = np.zeros((2 * n, 2 * n))
    C[:n, :n] = 0.003**2 * (0.5 * common + 0.5 * np.eye(n))
    C[n:, n:] = np.diag((0.0005 * limit)**2)
    drive = make_effort_calibration(exact.arm.joint_names, [1.0], [0.0], limit, C)
    error = np.random.default_rng(seed + 40_000).multivariate_normal(np.zeros(2 * n), C)
    case = exact._replace(arm=replace(exact.arm, report=drive))
    effort = measured(exact, samples) * (1.0 + error[:n]) - error[n:]
    return case, estimated(case, samples, effort), estimated(exact, samples, effort)


@pytest.mark.parametrize(('kind', 'name'), [('pairs', 'ur10'), ('motion', 'panda')])
def test_the_deviations_contain_the_errors_of_a_calibration(kind, name):
    known, ignored = list[float](), list[float]()
    for seed in range(5):
        case, calibrated, exact = estimate_with_uncertain_drives(name, seed, kind)
        known += [error**2 for i, error in errors_in_deviations(case, calibrated).items() if i < 4]
        ignored += [error**2 for i, error in errors_in_deviations(case, exact).items() if i < 4]
        assert not any('torque constant' in remark for remark in calibrated.remarks)
    assert 0.4 < np.mean(known) < 2.0
    assert np.mean(ignored) > 2.0
