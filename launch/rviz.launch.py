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
RViz with the arm and its `~/markers`, `robot_state_publisher`, and the closed loop to look at.

ros2 launch robot_dynamics rviz.launch.py [robot:=FILE.urdf] [params:=FILE.yaml]
Beside nodes that run already: nodes:=false, and tf:=false beside a robot_state_publisher.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare
from robot_dynamics.ros.launch_arguments import launched_description, parameter_files
from robot_dynamics.urdf.parser import parse_urdf

from launch import LaunchDescription


def _nodes(context, *_):
    params = parameter_files(LaunchConfiguration('params').perform(context))
    xml = launched_description(LaunchConfiguration('robot').perform(context))
    # Said to be text, or launch takes it for YAML, to which ': ' and ' #' mean something.
    description = {'robot_description': ParameterValue(xml, value_type=str)}
    parameters = [*params, description]
    loop = IfCondition(LaunchConfiguration('nodes'))
    display = PathJoinSubstitution([FindPackageShare('robot_dynamics'), 'rviz', 'dynamics.rviz'])
    return [
        Node(package='robot_dynamics', executable='simulated_arm', parameters=parameters,
             condition=loop),
        Node(package='robot_dynamics', executable='dynamics_node', parameters=parameters,
             condition=loop),
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[description], condition=IfCondition(LaunchConfiguration('tf'))),
        Node(package='rviz2', executable='rviz2',
             arguments=['-d', display, '-f', parse_urdf(xml).root_link]),
    ]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument(
            'robot', default_value='',
            description='The URDF: a path or package://PACKAGE/PATH; empty for the two-link arm.'),
        DeclareLaunchArgument(
            'params', default_value='', description='A parameter file for both nodes.'),
        DeclareLaunchArgument(
            'nodes', default_value='true',
            description='Whether simulated_arm and dynamics_node are started too.'),
        DeclareLaunchArgument(
            'tf', default_value='true', description='Whether robot_state_publisher runs too.'),
        OpaqueFunction(function=_nodes),
    ])
