# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The sections of a ROS parameter file, and the nodes to which they apply."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
import re
from tempfile import NamedTemporaryFile
from typing import Any

from rclpy.node import Node
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.urdf.yaml_text import load_yaml


class ParameterFile:
    """
    A parameter file: parameters by section.

    A section names a node by its full name. Its name may contain `*` for one part of the name,
    and `**` for any number of parts.
    """

    def __init__(self, path: Path, field: str) -> None:
        """
        Read a file; `field` names it in messages.

        Raises InvalidInputError for a file that is not YAML, or that has no section.
        """
        self.path = path
        self._sections: dict[str, dict[str, Any]] = {}
        for section, parameters in _sections(self._tree(field)):
            self._sections.setdefault(section, {}).update(parameters)
        if not self._sections:
            raise InvalidInputError(
                f'{field} is {str(path)!r}, which has no parameters; expected a section such as '
                '/** that contains ros__parameters')

    def _tree(self, field: str) -> Any:
        try:
            return load_yaml(self.path.read_text(encoding='utf-8'), 'a parameter file')
        except Exception as error:  # also yaml.YAMLError, of a library that is loaded late
            raise InvalidInputError(
                f'{field} is {str(self.path)!r}, which cannot be read: '
                f'{" ".join(str(error).split())}; expected a parameter file (YAML)') from None

    def parameters(self, node: str) -> dict[str, Any]:
        """Return the parameters of the node with a full name; nested names are not flattened."""
        values: dict[str, Any] = {}
        for section, parameters in self._sections.items():
            if _applies(section, node):
                values.update(parameters)
        return values

    def last_section(self, node: str) -> str:
        """Return the last section that applies to the node with a full name, /** if none does."""
        applying = [section for section in self._sections if _applies(section, node)]
        return applying[-1] if applying else '/**'

    def ignored_sections(self, node: str) -> list[str]:
        """
        Return the sections that the node with a full name ignores by mistake.

        These are sections that name it in other namespaces, if none of them applies to it, or all
        sections, if none applies.
        """
        base = node.rpartition('/')[2]
        named = [section for section in self._sections if section.rpartition('/')[2] == base]
        sections = named or list(self._sections)
        return [] if any(_applies(section, node) for section in sections) else sections


def write_parameter_file(section: str, values: Mapping[str, object]) -> str:
    """Write parameters into a temporary parameter file with one section; return its path."""
    yaml = optional('yaml', 'a parameter file')
    with NamedTemporaryFile(
            'w', encoding='utf-8', prefix='launch_arguments_', suffix='.yaml',
            delete=False) as file:
        yaml.safe_dump({section: {'ros__parameters': dict(values)}}, file)
    return file.name


def _sections(tree: Any, prefix: str = '') -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and parameters of each section below a prefix, in the order of the file."""
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if key == 'ros__parameters':
            yield prefix, value if isinstance(value, dict) else {}
        else:
            yield from _sections(value, f'{prefix}/{str(key).strip("/")}')


def _applies(section: str, node: str) -> bool:
    """Return whether a section applies to the node with a full name, as rcl compares them."""
    pattern = re.escape(section).replace(r'/\*\*', r'(/\w+)*').replace(r'\*', r'\w+')
    return re.fullmatch(pattern, node) is not None


def check_sections(node: Node, arguments: Sequence[str]) -> None:
    """
    Warn of each parameter file on the command line none of whose sections applies to the node.

    ROS ignores such sections without a message: a node that is started in a namespace loses the
    parameters of a section `/dynamics`. Raises InvalidInputError for a node with the parameter
    `command`, which would move an arm with other parameters. Files that cannot be read here are
    skipped: rcl has accepted them.
    """
    name = node.get_fully_qualified_name()
    for option, path in zip(arguments, arguments[1:]):
        ignored: list[str] = []
        if option == '--params-file':
            with suppress(RobotDynamicsError):
                ignored = ParameterFile(Path(path), option).ignored_sections(name)
        if ignored:
            message = (
                f'Parameter file {path!r}: sections {ignored} do not apply to {name}; expected '
                'the section /**, for every node in every namespace, or the name of a node.')
            if node.has_parameter('command'):
                raise InvalidInputError(message)
            node.get_logger().warning(message)
