# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The arm and its equation of motion: M(q), C(q, q̇), g(q), friction, motors and loads."""

from robot_dynamics.model.arm import ArmModel, JointLimits, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, EffortTerms
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.joint_order import JointOrder
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model.regressor import TorqueRegressor
from robot_dynamics.model.rigid_body import RigidBody

__all__ = [
    'arm_from_parameters',
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
