# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The arguments of the launch files as parameters of the nodes, which check them.

This module does not import launch. `launch_actions` makes the arguments and the nodes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.graph_watch import full_name
from robot_dynamics.ros.parameters.parameter_file import ParameterFile, write_parameter_file
from robot_dynamics.ros.parameters.robot_description import description_from_parameters
from robot_dynamics.urdf.description_file import read_description_file
from robot_dynamics.urdf.yaml_text import load_yaml

ARGUMENTS = {
    'robot': (
        '', 'URDF or .xacro file of the arm: a path or package://PACKAGE/PATH. If robot and '
        'robot_description are empty: the description in the parameter file, or {otherwise} if '
        'it has none.'),
    'robot_description': ('', 'URDF of the arm as XML, used if robot is empty.'),
    'params': (
        '', 'Parameter file (YAML) of the nodes. The section /** applies in every namespace; a '
        'node warns of sections that it ignores. The other arguments take precedence over the '
        'file.'),
    'namespace': ('', 'Namespace of the nodes, their topics, services and /tf. Empty: none.'),
    'use_sim_time': (
        '', 'true: the nodes take the time from /clock; false: from the computer. Empty: as in '
        'the parameter file, otherwise false.'),
    'autostart': (
        '', 'true: dynamics configures and activates itself at the start; false: it waits for '
        '`ros2 lifecycle set`. Empty: as in the parameter file, otherwise true.'),
    'gravity': (
        '', 'Acceleration of gravity in the base frame [m/s²], three numbers such as '
        '"[0.0, 0.0, -9.81]". Empty: as in the parameter file, otherwise [0.0, 0.0, -9.81].'),
    'log_level': (
        'info', 'Least severity that the nodes log: debug, info, warn, error or fatal.'),
}
"""Default and description of each argument that the launch files share, by name."""


@dataclass(frozen=True)
class ArmArguments:
    """
    The arguments for the nodes of one arm.

    `namespace` is absolute. `description` is the URDF of the arguments, of the parameter file or,
    for a simulated arm, the embedded one; None if there is none. `overrides` are parameters that
    take precedence over the file.
    """

    namespace: str
    file: ParameterFile | None
    description: str | None
    log_level: str
    overrides: dict[str, Any]

    def parameter_files(self, node: str, **more: Any) -> list[str]:
        """
        Return the parameter files of a node: the given one, and one with the overrides and `more`.

        rcl applies the sections of all files in the order in which their names appear first, so
        the overrides are in the last section of the given file that applies to the node.
        """
        files = [] if self.file is None else [str(self.file.path)]
        if values := {**self.overrides, **more}:
            name = full_name(node, self.namespace)
            section = '/**' if self.file is None else self.file.last_section(name)
            files.append(write_parameter_file(section, values))
        return files


def arm_arguments(
    values: Mapping[str, str], nodes: tuple[str, ...], outer_namespace: str = '',
) -> ArmArguments:
    """
    Return the arguments for an arm whose nodes have these names.

    `values` are the texts of ARGUMENTS, `outer_namespace` is the namespace of a
    group of launch actions.
    Raises InvalidInputError or ModelError for a file that cannot be read.
    """
    inside = values['namespace']
    namespace = '/' + (
        inside if inside.startswith('/') else f'{outer_namespace}/{inside}').strip('/')
    params = values['params']
    file = ParameterFile(Path(params).expanduser(), 'launch argument params') if params else None
    overrides = {
        name: _value(values[name]) for name in ('use_sim_time', 'autostart', 'gravity')
        if values[name]}
    description = values['robot_description'] or None
    if values['robot']:
        description = read_description_file(values['robot'], 'launch argument robot')
    if description is not None:
        overrides |= {'robot_description': description, 'robot_description_file': ''}
    elif file is not None:
        empty = {'robot_description': '', 'robot_description_file': ''}
        found = (description_from_parameters(
            {**empty, **file.parameters(full_name(name, namespace))}) for name in nodes)
        description = next(filter(None, found), None)  # of the first node that has one
    if description is None and 'simulated_arm' in nodes:
        description = overrides['robot_description'] = default_arm_urdf()
    return ArmArguments(namespace, file, description, values['log_level'], overrides)


def values_by_arm(values: Mapping[str, str]) -> list[dict[str, str]]:
    """
    Return the arguments of each arm, from those of a launch file for several arms.

    `arms` contains their namespaces, separated by commas; `params` and `robot` contain one file
    for all arms or one per arm. Raises InvalidInputError for other numbers of files.
    """
    arms = [name.strip() for name in values['arms'].split(',')]
    by_arm = [{**values, 'namespace': arm} for arm in arms]
    for argument in ('params', 'robot'):
        files = [file.strip() for file in values[argument].split(',')]
        if len(files) not in (1, len(arms)):
            raise InvalidInputError(
                f'launch argument {argument} is {values[argument]!r}, expected one file for all '
                f'arms, or {len(arms)} files separated by commas, in the order of arms')
        for arm, file in zip(by_arm, files if len(files) > 1 else files * len(arms)):
            arm[argument] = file
    return by_arm


def _value(text: str) -> Any:
    """Return the value of an argument as YAML; numbers without a decimal point in lists, too."""
    value = load_yaml(text, 'a launch argument')
    return [float(x) for x in value] if isinstance(value, list) else value
