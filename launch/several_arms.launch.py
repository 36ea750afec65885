# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Several arms, each in its own namespace: `dynamics_node` and `simulated_arm` for each.

ros2 launch robot_dynamics several_arms.launch.py arms:=left,right params:=left.yaml,right.yaml
For robots that are already running: simulated:=false [controller:=effort_controller]
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from robot_dynamics.ros.launch_actions import (
    arm_of,
    commands_to,
    declared,
    is_true,
    node,
    state_publisher,
    switch,
)
from robot_dynamics.ros.launch_arguments import ARGUMENTS, values_by_arm

from launch import LaunchDescription

PER_ARM = 'One file for all arms, or one per arm, separated by commas in the order of arms. '


def _nodes(context, *_):
    by_arm = values_by_arm(context.launch_configurations)
    if is_true(context, 'simulated'):
        names = ('simulated_arm', 'dynamics')
        arms = [arm_of(context, *names, values=values) for values in by_arm]
        transforms = map(state_publisher, arms) if is_true(context, 'tf') else []
        # as in closed_loop.launch.py, the nodes of another package first
        return [*transforms, *(node(arm, name) for arm in arms for name in names)]
    remappings = commands_to(LaunchConfiguration('controller').perform(context))
    arms = [arm_of(context, 'dynamics', values=values) for values in by_arm]
    return [node(arm, 'dynamics', remappings) for arm in arms]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument(
            'arms', default_value='left,right',
            description='Names of the arms, which are their namespaces, separated by commas.'),
        *declared(
            otherwise='the planar two-link arm (simulated) or the topic robot_description (not '
                      'simulated)',
            namespace=None, params=f'{PER_ARM}{ARGUMENTS["params"][1]}',
            robot=f'{PER_ARM}{ARGUMENTS["robot"][1]}'),
        switch(
            'simulated', 'true: simulated_arm is started for each arm; false: the robots are '
            'running, and only dynamics_node is started for each.'),
        switch(
            'tf', 'Whether robot_state_publisher is started as well for each simulated arm; it '
            'publishes on tf in the namespace of the arm.'),
        DeclareLaunchArgument(
            'controller', default_value='',
            description='Effort controller in each namespace that receives the commands if '
                        'simulated is false. Empty: no controller.'),
        OpaqueFunction(function=_nodes),
    ])
