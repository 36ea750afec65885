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

"""The `--help` text of the node `dynamics`."""

from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.node_arguments import NodeUsage

USAGE = NodeUsage(
    'dynamics_node',
    'Gravity compensation, computed torque and dynamics services for the arm of a URDF. The node '
    'publishes a command for each joint state.',
    SPECS,
    ('robot_description_file', 'joints', 'gravity', 'command', 'gains.natural_frequency',
     'gains.damping_ratio', 'effort_scale', 'measured_effort', 'robot_compensates',
     'fault_action', 'state_timeout', 'state_max_age', 'autostart'),
    (('joint_states', 'Subscribed: the measured state of the arm.'),
     ('robot_description', 'Subscribed: the URDF, unless a parameter has it.'),
     ('~/joint_trajectory', 'Subscribed: the reference.'),
     ('effort_command, ~/commands', 'Published: the command, as JointState and as '
      'Float64MultiArray.'),
     ('~/gravity_compensation, ~/computed_torque', 'Published: the results of both control '
      'laws, also with `command: none`.'),
     ('/diagnostics', 'Published: joint states, command, faults, reference, model.'),
     ('~/stop, ~/reset_fault, ~/set_payload', 'Services: stop the arm and hold it, reset a '
      'latched fault, set the payload.')))
