# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Estimation of what is attached to a link, from measured efforts."""

from robot_dynamics_tools.payload_estimation.estimator import PayloadEstimator
from robot_dynamics_tools.payload_estimation.result import PayloadEstimate

__all__ = ['PayloadEstimate', 'PayloadEstimator']
