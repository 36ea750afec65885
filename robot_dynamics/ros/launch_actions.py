# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Launch arguments and nodes of an arm, for the launch files of this package. Needs launch_ros."""

from collections.abc import Mapping, Sequence
from typing import Any

from launch.actions import DeclareLaunchArgument
from launch.launch_context import LaunchContext
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from robot_dynamics.ros.launch_arguments import ARGUMENTS, arm_arguments, ArmArguments

TF = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
"""Remappings that move the transforms into the namespace of a node."""


def declared(otherwise: str, **others: str | None) -> list[DeclareLaunchArgument]:
    """
    Return the launch arguments that the launch files share.

    `otherwise` is the source of the description if no argument and no file gives one. `others`
    are different descriptions of arguments, None for those that a launch file lacks.
    """
    return [
        DeclareLaunchArgument(
            name, default_value=default, description=text.format(otherwise=otherwise))
        for name, (default, description) in ARGUMENTS.items()
        if (text := others.get(name, description)) is not None]


def switch(name: str, description: str) -> DeclareLaunchArgument:
    """Return a launch argument that is true by default."""
    return DeclareLaunchArgument(
        name, default_value='true', choices=['true', 'false'], description=description)


def is_true(context: LaunchContext, name: str) -> bool:
    """Return whether a switch is true."""
    return bool(context.launch_configurations[name] == 'true')


def arm_of(
    context: LaunchContext, *nodes: str, values: Mapping[str, str] | None = None,
) -> ArmArguments:
    """
    Return the arguments for an arm whose nodes have these names.

    `values` are the arguments as texts, by default the values of the context. Raises
    InvalidInputError or ModelError, as arm_arguments does.
    """
    configurations = context.launch_configurations
    return arm_arguments(
        values or configurations, nodes, configurations.get('ros_namespace') or '')


def node(
    arm: ArmArguments, name: str, remappings: Sequence[tuple[str, str]] = (),
    package: str = 'robot_dynamics', **parameters: Any,
) -> Node:
    """Return the node `dynamics` or `simulated_arm` of an arm, or one of another package."""
    return Node(
        package=package, executable='dynamics_node' if name == 'dynamics' else name,
        namespace=arm.namespace, parameters=arm.parameter_files(name, **parameters),
        remappings=list(remappings), ros_arguments=['--log-level', arm.log_level])


def commands_to(controller: str) -> list[tuple[str, str]]:
    """Return the remapping of `~/commands` to an effort controller; none for an empty name."""
    return [('~/commands', f'{controller}/commands')] if controller else []


def state_publisher(arm: ArmArguments) -> Node:
    """Return robot_state_publisher for an arm, with its transforms in the namespace of the arm."""
    # Marked as text: launch interprets other texts as YAML, in which ': ' and ' #' have a meaning.
    description = ParameterValue(arm.description, value_type=str)
    return Node(
        package='robot_state_publisher', executable='robot_state_publisher',
        namespace=arm.namespace, parameters=[{'robot_description': description, **clock(arm)}],
        remappings=TF, ros_arguments=['--log-level', arm.log_level])


def clock(arm: ArmArguments) -> dict[str, Any]:
    """Return the parameter use_sim_time for a node of another package, if it is given."""
    return {name: value for name, value in arm.overrides.items() if name == 'use_sim_time'}
