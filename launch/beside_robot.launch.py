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
`dynamics_node` beside a robot that runs already.

It reads the robot's /joint_states and /robot_description. With `controller:=NAME` its commands go
to that effort_controllers/JointGroupEffortController, whose joints must be those of the parameter
`joints`, in the same order; the node checks this before it publishes a command there.

ros2 launch robot_dynamics beside_robot.launch.py params:=ur10.yaml [controller:=effort_controller]
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from robot_dynamics.ros.launch_arguments import parameter_files

from launch import LaunchDescription


def _node(context, *_):
    params = parameter_files(LaunchConfiguration('params').perform(context))
    controller = LaunchConfiguration('controller').perform(context)
    remappings = [('joint_states', LaunchConfiguration('joint_states').perform(context))]
    if controller:
        remappings.append(('~/commands', f'/{controller}/commands'))
    return [Node(
        package='robot_dynamics', executable='dynamics_node',
        parameters=params, remappings=remappings)]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument(
            'params', default_value='',
            description='The parameter file, e.g. a copy of config/ur10.yaml.'),
        DeclareLaunchArgument(
            'joint_states', default_value='/joint_states',
            description='The topic of the measured joint states.'),
        DeclareLaunchArgument(
            'controller', default_value='',
            description='The effort controller to command; empty: publish, command nothing.'),
        OpaqueFunction(function=_node),
    ])
