# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The arguments of the launch files: descriptions, defaults, and checks before any node starts.

This module does not import launch. `launch_actions` makes the arguments and the nodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.parameters.parameter_file import ParameterFile, write_parameter_file
from robot_dynamics.ros.parameters.robot_description import embedded_description
from robot_dynamics.urdf.description_file import description_path, read_description_file
from robot_dynamics.validation import check_vector

DYNAMICS = 'dynamics'
SIMULATED_ARM = 'simulated_arm'
MUJOCO_ARM = 'mujoco_arm'
"""Names of the nodes that the launch files start."""
LOG_LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')

ARGUMENTS = {
    'robot': (
        '', 'URDF or .xacro file of the arm: a path or package://PACKAGE/PATH. If robot and '
        'robot_description are empty: the description in the parameter file, or {otherwise} if '
        'it has none.'),
    'robot_description': ('', 'URDF of the arm as XML, instead of robot.'),
    'params': (
        '', 'Parameter file (YAML) of the nodes. It is an error if none of its sections applies '
        'to the nodes; the section /** applies in every namespace. The other arguments take '
        'precedence over the file.'),
    'namespace': ('', 'Namespace of the nodes, their topics, services and /tf. Empty: none.'),
    'use_sim_time': (
        '', 'true: the nodes take the time from /clock; false: from the computer. Empty: as in '
        'the parameter file, otherwise false.'),
    'autostart': (
        '', 'true: dynamics configures and activates itself at the start; false: it waits for '
        '`ros2 lifecycle set`. Empty: as in the parameter file, otherwise true.'),
    'gravity': (
        '', 'Acceleration of gravity in the base frame [m/s^2], three numbers such as '
        '"[0.0, 0.0, -9.81]". Empty: as in the parameter file, otherwise [0.0, 0.0, -9.81].'),
    'log_level': (
        'info', f'Least severity that the nodes log: {", ".join(LOG_LEVELS)}.'),
}
"""Default and description of each argument that the launch files share, by name."""


@dataclass(frozen=True)
class ArmArguments:
    """
    Checked arguments for the nodes of one arm.

    `namespace` is absolute. `description` is the URDF of the arguments, of the parameter file or,
    for a simulated arm, the embedded one; None if there is none. `overrides` are parameters that
    take precedence over the file.
    """

    namespace: str
    file: ParameterFile | None
    description: str | None
    log_level: str
    overrides: dict[str, Any]

    def parameter_files(self, node: str, *names: str) -> list[str]:
        """
        Return the parameter files of a node: the given one, and one with the overrides.

        Only the overrides with these `names` are used. rcl applies the sections of all files in
        the order in which their names appear first, so the overrides are in the last section of
        the given file that applies to the node.
        """
        files = [] if self.file is None else [str(self.file.path)]
        values = {name: self.overrides[name] for name in names if name in self.overrides}
        if values:
            section = '/**' if self.file is None else self.file.last_section(
                full_name(self.namespace, node))
            files.append(write_parameter_file(section, values))
        return files


def check_arm_arguments(
    values: Mapping[str, str], nodes: tuple[str, ...], outer_namespace: str = '',
) -> ArmArguments:
    """
    Return the checked arguments for an arm whose nodes have these names.

    `values` are the texts of ARGUMENTS, `outer_namespace` is the namespace of a
    group of launch actions.

    Raises InvalidInputError or ModelError for a value that is invalid, or a file that is missing,
    is damaged or has no section for the nodes.
    """
    namespace = absolute_namespace(values['namespace'], outer_namespace)
    full_names = [full_name(namespace, name) for name in nodes]
    file = parameter_file(values['params'], full_names)
    overrides: dict[str, Any] = {
        name: truth(name, values[name]) for name in ('use_sim_time', 'autostart') if values[name]}
    if values['gravity']:
        overrides['gravity'] = _gravity(values['gravity'])
    description = _given_description(values['robot'], values['robot_description'])
    if description is not None:
        overrides |= {'robot_description': description, 'robot_description_file': ''}
    elif file is not None:
        description = _description_in(file, full_names)
    if description is None and SIMULATED_ARM in nodes:
        description = overrides['robot_description'] = embedded_description()
    return ArmArguments(
        namespace, file, description, _log_level(values['log_level']), overrides)


def parameter_file(params: str, nodes: Sequence[str]) -> ParameterFile | None:
    """
    Return the parameter file of the launch argument params, None if it is empty.

    Raises InvalidInputError if the file is missing, is not a parameter file, or has sections that
    do not apply to the nodes with these full names.
    """
    if not params:
        return None
    path = Path(params).expanduser()
    _check_is_file('params', params, path, 'the path of a parameter file (YAML)')
    try:
        file = ParameterFile(path, 'launch argument params')
    except InvalidInputError as error:
        raise InvalidInputError(f'{error}. No node was started.') from None
    ignored = file.ignored_sections(nodes)
    if ignored:
        raise InvalidInputError(
            f'launch argument params is {str(path)!r}, whose {ignored}. No node was started.')
    return file


def description_in_file(robot: str) -> str:
    """
    Return the URDF in the file that the launch argument robot names.

    Raises InvalidInputError if there is no such file, ModelError if it cannot be read.
    """
    path = description_path(robot, 'launch argument robot')
    _check_is_file('robot', robot, path, 'a URDF or .xacro file: a path or package://PACKAGE/PATH')
    return read_description_file(robot, 'launch argument robot')


def full_name(namespace: str, node: str) -> str:
    """Return the full name of a node in an absolute namespace."""
    return f'{namespace.rstrip("/")}/{node}'


def absolute_namespace(namespace: str, outer: str = '', argument: str = 'namespace') -> str:
    """
    Return a namespace as an absolute one, inside `outer` unless it begins with a slash.

    Raises InvalidInputError, which names the launch argument, if it is not a valid namespace.
    """
    inside = namespace if namespace.startswith('/') else f'{outer}/{namespace}'
    absolute = f'/{inside.strip("/")}'
    try:
        validate_namespace(absolute)
    except InvalidNamespaceException as error:
        reason = ' '.join(str(error).splitlines()[0].split())
        raise InvalidInputError(
            f'launch argument {argument} is {namespace!r}, expected names separated by slashes '
            f'({reason}). No node was started.') from None
    return absolute


def truth(argument: str, value: str) -> bool:
    """Return a launch argument as a bool; raise InvalidInputError unless it is true or false."""
    words = {'true': True, '1': True, 'false': False, '0': False}
    if value.lower() not in words:
        raise InvalidInputError(
            f'launch argument {argument} is {value!r}, expected true or false. '
            'No node was started.')
    return words[value.lower()]


def values_by_arm(values: Mapping[str, str]) -> list[dict[str, str]]:
    """
    Return the arguments of each arm, from those of a launch file for several arms.

    `arms` contains their namespaces, separated by commas; `params` and `robot` contain one file
    for all arms or one per arm. Raises InvalidInputError for other numbers of files, and for
    names that are missing or not distinct.
    """
    arms = [name.strip() for name in values['arms'].split(',')]
    distinct = {absolute_namespace(name, argument='arms') for name in arms}
    if '/' in distinct or len(distinct) < len(arms):
        raise InvalidInputError(
            f'launch argument arms is {values["arms"]!r}, expected distinct names separated by '
            'commas. No node was started.')
    files = {name: _one_per_arm(name, values[name], len(arms)) for name in ('params', 'robot')}
    return [
        {**values, 'namespace': arm, 'params': params, 'robot': robot}
        for arm, params, robot in zip(arms, files['params'], files['robot'])]


def _one_per_arm(argument: str, value: str, count: int) -> list[str]:
    files = [file.strip() for file in value.split(',')]
    if len(files) not in (1, count):
        raise InvalidInputError(
            f'launch argument {argument} is {value!r}, expected one file for all arms, or {count} '
            'files separated by commas, in the order of arms. No node was started.')
    return files * count if len(files) == 1 else files


def _given_description(robot: str, xml: str) -> str | None:
    if robot and xml:
        raise InvalidInputError(
            f'launch argument robot is {robot!r} and robot_description is given too, expected '
            'one of them. No node was started.')
    return description_in_file(robot) if robot else xml or None


def _description_in(file: ParameterFile, nodes: list[str]) -> str | None:
    """Return the description in a parameter file for the first node that has one, else None."""
    for node in nodes:
        values = file.parameters(node)
        if values.get('robot_description_file'):
            path = str(values['robot_description_file'])
            return read_description_file(path, f'robot_description_file in {file.path}')
        if values.get('robot_description'):
            return str(values['robot_description'])
    return None


def _gravity(value: str) -> list[float]:
    try:
        numbers = [float(text) for text in re.split(r'[\s,]+', value.strip('[] '))]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise InvalidInputError(
            f'launch argument gravity is {value!r}, expected three numbers [m/s^2] such as '
            '"[0.0, 0.0, -9.81]". No node was started.')
    return [float(x) for x in check_vector('launch argument gravity', numbers, 3)]


def _log_level(value: str) -> str:
    if value not in LOG_LEVELS:
        raise InvalidInputError(
            f'launch argument log_level is {value!r}, expected one of {", ".join(LOG_LEVELS)}. '
            'No node was started.')
    return value


def _check_is_file(argument: str, value: str, path: Path, expected: str) -> None:
    if not path.is_file():
        kind = 'a directory' if path.is_dir() else 'no such file'
        raise InvalidInputError(
            f'launch argument {argument} is {value!r}, which is {kind} '
            f'({path.absolute()}); expected {expected}. No node was started.')
