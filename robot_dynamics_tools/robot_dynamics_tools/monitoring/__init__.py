# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Estimates from measured states for displays: contacts, external wrench and residual."""

from robot_dynamics_tools.monitoring.contact_detector import ContactDetector
from robot_dynamics_tools.monitoring.external_wrench import ExternalWrenchEstimator
from robot_dynamics_tools.monitoring.live_residual import LiveResidual

__all__ = ['ContactDetector', 'ExternalWrenchEstimator', 'LiveResidual']
