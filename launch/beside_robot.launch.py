# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`dynamics_node` next to a robot that is already running.

It subscribes to the robot's joint_states and robot_description. With `controller:=NAME` it sends
its commands to that effort_controllers/JointGroupEffortController, whose joints must be those of
the parameter `joints`, in the same order; the node checks this before it publishes a command.

ros2 launch robot_dynamics beside_robot.launch.py params:=ur10.yaml [controller:=effort_controller]
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from robot_dynamics.ros.launch_actions import arm_of, commands_to, declared, node

from launch import LaunchDescription


def _node(context, *_):
    states = ('joint_states', LaunchConfiguration('joint_states').perform(context))
    commands = commands_to(LaunchConfiguration('controller').perform(context))
    # The controller keeps the last command: it must be zero at the end.
    more = {'end_action': 'ramp_to_zero'} if commands else {}
    return [node(arm_of(context, 'dynamics'), 'dynamics', [states, *commands], **more)]


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
