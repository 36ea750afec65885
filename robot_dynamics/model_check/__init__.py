# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of the validity and consistency of a model, and their findings."""

from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.finding import errors_of, Finding

__all__ = [
    'check_model',
    'errors_of',
    'Finding',
]
