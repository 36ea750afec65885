# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of measured states while the arm runs: plausibility, external effort."""

from robot_dynamics.monitoring.contact_levels import ContactLevels
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.monitoring.state_plausibility import StatePlausibility

__all__ = ['ContactLevels', 'ExternalEffort', 'StatePlausibility']
