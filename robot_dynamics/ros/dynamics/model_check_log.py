# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The model check of a node: findings are logged, and an error rejects the model."""

from typing import Any

from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.worst_gravity import BRIEF, QUICK
from robot_dynamics.model_check.finding import CHECKS, refuse_errors
from robot_dynamics.model_check.report import check_description
from robot_dynamics.ros.declared_parameters import ParameterSpec, Type, Values

LARGEST_ARM = 12
"""Largest number of joints for the quick search at the start; above it, the brief search runs."""
IGNORE_CHECKS_SPEC = ParameterSpec(
    'ignore_checks', Type.STRING_ARRAY, [],
        'Names of model checks whose errors are logged as warnings instead of rejecting the '
        'model.',
    read_only=True, choices=tuple(CHECKS))


def check_or_refuse(xml: str, arm: ArmModel, values: Values, logger: Any) -> None:
    """
    Log findings and scope of the model check; raise ModelError with the first error not ignored.

    `arm` is the model of the URDF `xml` with the parameters `values`. Meshes are not read, and the
    search for the worst gravity is quick; the tool check_model reads them and searches fully.
    """
    ignored = values['ignore_checks']
    search = QUICK if arm.joint_count <= LARGEST_ARM else BRIEF
    checked = check_description(xml, arm=arm, search=search)
    refuse_errors(checked.findings, ignored)
    for finding in checked.findings:
        logger.warning(f'Model check: {finding}')
    if checked.findings or checked.unread:
        logger.info(f'Model check: {checked.counts}. Scope: {checked.scope}')
