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

"""
`dynamics_node` next to a robot that is already running.

It subscribes to the robot's joint_states and robot_description. With `controller:=NAME` it sends
its commands to that effort_controllers/JointGroupEffortController, whose joints must be those of
the parameter `joints`, in the same order; the node checks this before it publishes a command.

ros2 launch robot_dynamics beside_robot.launch.py params:=ur10.yaml [controller:=effort_controller]
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from robot_dynamics.ros.launch_actions import arm_arguments, commands_to, declared, dynamics_node
from robot_dynamics.ros.launch_arguments import DYNAMICS

from launch import LaunchDescription


def _node(context, *_):
    states = ('joint_states', LaunchConfiguration('joint_states').perform(context))
    commands = commands_to(LaunchConfiguration('controller').perform(context))
    return [dynamics_node(arm_arguments(context, (DYNAMICS,)), [states, *commands])]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the topic robot_description'),
        DeclareLaunchArgument(
            'joint_states', default_value='joint_states',
            description='Topic of the measured joint states, relative to the namespace unless it '
                        'begins with a slash.'),
        DeclareLaunchArgument(
            'controller', default_value='',
            description='Effort controller that receives the commands, relative to the namespace '
                        'unless it begins with a slash. Empty: no controller.'),
        OpaqueFunction(function=_node),
    ])
