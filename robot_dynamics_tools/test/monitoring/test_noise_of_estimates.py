# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The noise of the estimates."""

from dataclasses import replace

import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.effort_deviation import make_uncertainty
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.monitoring.live_residual import LiveResidual

ARM = load_arm(default_arm_urdf())


@pytest.mark.parametrize('estimator', [ExternalEffort, LiveResidual])
def test_the_noise_of_an_estimate_is_that_of_its_bandwidth(estimator):
    # effort noise of 2 N·m in each sample at 200 Hz, which is 100 Hz of bandwidth
    rate, band = 200.0, 20.0
    uncertainty = make_uncertainty(
        ARM, noise_deviation=[2.0 * np.sqrt(band / (0.5 * rate))], noise_bandwidth=band)
    dynamics = ArmDynamics(replace(ARM, uncertainty=uncertainty))
    estimate = estimator(dynamics, 25.0)
    q, rest = np.array([0.4, 0.3]), np.zeros(2)
    gravity = dynamics.rigid_body.gravity(q)
    rng = np.random.default_rng(0)
    found = [estimate.update(1.0 / rate, q, rest, gravity + 2.0 * noise)
             for noise in rng.normal(size=(1000, 2))]
    measured = np.std([each for each in found[50:] if each is not None])
    expected = uncertainty.noise(estimate.noise_bandwidth, 1.0 / rate)
    assert measured == pytest.approx(expected[0], rel=0.1)
    # noise of a narrower band has all its power, that of a wider one ends at the sampling rate
    assert uncertainty.noise(1.0, 1.0 / rate) == pytest.approx(uncertainty.noise_deviation)
    assert uncertainty.noise(1e6, 1.0 / rate) == pytest.approx([2.0, 2.0])
