# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of measured states while the arm runs: plausibility, timing, external effort."""

from robot_dynamics.monitoring.contact_levels import (
    ContactDetector,
    ContactLevels,
    learn_contact_levels,
)
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.monitoring.gravity_check import GravityCheck
from robot_dynamics.monitoring.state_plausibility import StatePlausibility

__all__ = [
    'ContactDetector',
    'ContactLevels',
    'ExternalEffort',
    'GravityCheck',
    'learn_contact_levels',
    'StatePlausibility',
]
