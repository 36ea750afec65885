# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The command line of a node: `--help`, and errors of arguments outside `--ros-args`."""

from collections.abc import Sequence
import textwrap
from typing import NamedTuple

from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec

WIDTH = 88
OPTIONS = (
    ('--help, -h', 'Print this text.'),
    ('--ros-args', 'The options of ROS follow: `-p NAME:=VALUE` sets a parameter, '
     '`--params-file FILE` reads parameters from a YAML file, `-r FROM:=TO` renames a topic or a '
     'service, and `-r __ns:=/NAMESPACE` sets the namespace.'))
EXIT_STATUS = (
    'Exit status: 0 ended by Ctrl-C, SIGTERM or SIGHUP, 1 cannot start, 2 unknown arguments.')


class NodeUsage(NamedTuple):
    """The `--help` text of a node."""

    program: str
    node: str
    """The name of the node, for which `~` stands."""
    summary: str
    examples: Sequence[tuple[str, str]]
    """Arguments, each with their effect."""
    specs: Sequence[ParameterSpec]
    main_parameters: Sequence[str]
    """Names of the listed parameters, from `specs`."""
    topics: Sequence[tuple[str, str]]
    """Topics and services, each with direction, type and meaning."""

    def help(self) -> str:
        """Return the text."""
        by_name = {spec.name: spec for spec in self.specs}
        parameters = [
            (name, f'{by_name[name].description} Default: {_in_words(by_name[name].default)}.')
            for name in self.main_parameters]
        return '\n'.join([
            f'usage: {self.program} [--help] [--ros-args [-p NAME:=VALUE] [--params-file FILE] '
            '[-r FROM:=TO] ...]', '', textwrap.fill(self.summary, WIDTH), '',
            'Options:', *_entries(OPTIONS), '',
            'Examples:', *_entries([
                (f'{self.program} {arguments}'.rstrip(), effect)
                for arguments, effect in self.examples]), '',
            f'Main parameters, of {len(self.specs)} (all of them: docs/reference/parameters.md):',
            *_entries(parameters), '',
            f'Main topics and services (all of them: docs/reference/topics.md); ~ stands for '
            f'{self.node}:', *_entries(self.topics), '', EXIT_STATUS, ''])

    def refusal(self, unknown: Sequence[str]) -> str:
        """Return the error line for these arguments."""
        return (f'{self.program}: unknown arguments {list(unknown)}; set a parameter with '
                f'`--ros-args -p NAME:=VALUE` (`{self.program} --help` lists the main ones)')


def outside_of_ros_args(arguments: Sequence[str]) -> list[str]:
    """
    Return the arguments that are not between `--ros-args` and `--` or the end.

    They include `NAME:=VALUE`: the user means a parameter, but `rclpy.utilities.remove_ros_args`
    interprets it as a renamed topic.
    """
    others, is_of_ros = [], False
    for argument in arguments:
        if argument == '--ros-args':
            is_of_ros = True
        elif is_of_ros:
            is_of_ros = argument != '--'
        else:
            others.append(argument)
    return others


def _entries(entries: Sequence[tuple[str, str]]) -> list[str]:
    lines = []
    for name, text in entries:
        lines += [f'  {name}', *textwrap.wrap(
            text, WIDTH, initial_indent=' ' * 6, subsequent_indent=' ' * 6)]
    return lines


def _in_words(default: object) -> str:
    if default in ('', []):
        return 'empty'
    return str(default).lower() if isinstance(default, bool) else str(default)
