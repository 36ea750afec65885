# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm and its equation of motion: M(q), C(q, q̇), g(q), friction, motors and loads."""

from robot_dynamics.model.arm import ArmModel, JointLimits, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, EffortTerms, RigidBody
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.model.derivatives import ArmDerivatives
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model.regressor import TorqueRegressor

__all__ = [
    'arm_from_parameters',
    'ArmDerivatives',
    'ArmDynamics',
    'ArmModel',
    'EffortTerms',
    'ExternalWrench',
    'JointLimits',
    'JointOrder',
    'load_arm',
    'make_payload',
    'Payload',
    'read_parameter_file',
    'RigidBody',
    'TorqueRegressor',
]
