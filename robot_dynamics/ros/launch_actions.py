# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Launch arguments and nodes of an arm, for the launch files of this package. Needs launch_ros."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from launch.actions import DeclareLaunchArgument
from launch.launch_context import LaunchContext
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from robot_dynamics.ros.launch_arguments import (
    ARGUMENTS,
    ArmArguments,
    check_arm_arguments,
    DYNAMICS,
    MUJOCO_ARM,
    SIMULATED_ARM,
    truth,
)

CLOSED_LOOP = (SIMULATED_ARM, DYNAMICS)
MUJOCO_LOOP = (MUJOCO_ARM, DYNAMICS)
TF = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
"""Remappings that move the transforms into the namespace of a node."""
_OF_BOTH = ('robot_description', 'robot_description_file', 'use_sim_time', 'gravity')


def declared(otherwise: str, **others: str | None) -> list[DeclareLaunchArgument]:
    """
    Return the launch arguments that the launch files share.

    `otherwise` is the source of the description if no argument and no file gives one. `others`
    are different descriptions of arguments, None for those that a launch file lacks.
    """
    texts = {
        name: others.get(name, description) for name, (_, description) in ARGUMENTS.items()}
    return [
        DeclareLaunchArgument(
            name, default_value=ARGUMENTS[name][0],
            description=text.format(otherwise=otherwise))
        for name, text in texts.items() if text is not None]


def arm_arguments(
    context: LaunchContext, nodes: tuple[str, ...], values: Mapping[str, str] | None = None,
) -> ArmArguments:
    """
    Return the checked arguments for an arm whose nodes have these names.

    `values` are the arguments as texts, by default the values of the context. Raises
    InvalidInputError or ModelError, as check_arm_arguments does.
    """
    configurations = context.launch_configurations
    return check_arm_arguments(
        values or configurations, nodes, configurations.get('ros_namespace') or '')


def is_true(context: LaunchContext, argument: str) -> bool:
    """Return a launch argument that is true or false; raise InvalidInputError for other texts."""
    return truth(argument, context.launch_configurations[argument])


def dynamics_node(arm: ArmArguments, remappings: Sequence[tuple[str, str]] = ()) -> Node:
    """Return the node `dynamics` of an arm."""
    files = arm.parameter_files(DYNAMICS, *_OF_BOTH, 'autostart')
    return _node(arm, 'dynamics_node', files, remappings)


def commands_to(controller: str) -> list[tuple[str, str]]:
    """Return the remapping of `~/commands` to an effort controller; none for an empty name."""
    return [('~/commands', f'{controller}/commands')] if controller else []


def closed_loop(arm: ArmArguments) -> list[Node]:
    """Return `simulated_arm` and `dynamics` of an arm."""
    files = arm.parameter_files(SIMULATED_ARM, *_OF_BOTH)
    return [_node(arm, 'simulated_arm', files), dynamics_node(arm)]


def mujoco_loop(arm: ArmArguments, mjcf: str) -> list[Node]:
    """Return `mujoco_arm` and `dynamics` of an arm; an empty `mjcf` is that of the file."""
    given = replace(arm, overrides={**arm.overrides, **({'mjcf': mjcf} if mjcf else {})})
    files = given.parameter_files(MUJOCO_ARM, 'mjcf', 'use_sim_time', 'gravity')
    return [_node(arm, 'mujoco_arm', files), dynamics_node(arm)]


def state_publisher(arm: ArmArguments) -> Node:
    """Return robot_state_publisher for an arm, with its transforms in the namespace of the arm."""
    # Marked as text: launch interprets other texts as YAML, in which ': ' and ' #' have a meaning.
    description = ParameterValue(arm.description, value_type=str)
    return Node(
        package='robot_state_publisher', executable='robot_state_publisher',
        namespace=arm.namespace, parameters=[{'robot_description': description}, *clock(arm)],
        remappings=TF, ros_arguments=['--log-level', arm.log_level])


def clock(arm: ArmArguments) -> list[dict[str, bool]]:
    """Return the parameter use_sim_time for a node of another package, if it is given."""
    given = 'use_sim_time' in arm.overrides
    return [{'use_sim_time': arm.overrides['use_sim_time']}] if given else []


def _node(
    arm: ArmArguments, executable: str, files: Sequence[str],
    remappings: Sequence[tuple[str, str]] = (),
) -> Node:
    """Return a node of this package with these parameter files."""
    return Node(
        package='robot_dynamics', executable=executable, namespace=arm.namespace,
        parameters=list(files), remappings=list(remappings),
        ros_arguments=['--log-level', arm.log_level])
