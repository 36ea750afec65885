# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
RViz with the arm and the markers of `dynamics_monitor`, `robot_state_publisher`, and the loop.

ros2 launch robot_dynamics_tools rviz.launch.py [robot:=FILE.urdf] [params:=FILE.yaml]
If nodes are already running: nodes:=false, monitor:=false, tf:=false (robot_state_publisher).
"""

from launch.actions import OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare
from robot_dynamics.ros.launch_actions import (
    arm_of,
    clock,
    declared,
    is_true,
    node,
    state_publisher,
    switch,
    TF,
)
from robot_dynamics.urdf.parser import parse_urdf

from launch import LaunchDescription

TOPICS = [(f'/{topic}', topic) for topic in ('dynamics_monitor/markers', 'robot_description')]
"""Remappings that move the topics of the displays into the namespace of the node."""


def _nodes(context, *_):
    arm = arm_of(context, 'simulated_arm', 'dynamics')
    loop = [node(arm, 'simulated_arm'), node(arm, 'dynamics')]
    nodes = loop if is_true(context, 'nodes') else []
    estimates = [node(arm, 'dynamics_monitor', package='robot_dynamics_tools')]
    monitor = estimates if is_true(context, 'monitor') else []
    transforms = [state_publisher(arm)] if is_true(context, 'tf') else []
    display = PathJoinSubstitution([FindPackageShare('robot_dynamics'), 'rviz', 'dynamics.rviz'])
    rviz = Node(
        package='rviz2', executable='rviz2', namespace=arm.namespace,
        parameters=[clock(arm)], remappings=[*TF, *TOPICS],
        arguments=['-d', display, '-f', parse_urdf(arm.description).root_link])
    # as in closed_loop.launch.py, the nodes of other packages first
    return [rviz, *transforms, *nodes, *monitor]


def generate_launch_description():
    return LaunchDescription([
        *declared(otherwise='the planar two-link arm'),
        switch('nodes', 'Whether simulated_arm and dynamics_node are started as well.'),
        switch('monitor', 'Whether dynamics_monitor is started as well, for markers.'),
        switch('tf', 'Whether robot_state_publisher is started as well.'),
        OpaqueFunction(function=_nodes),
    ])
