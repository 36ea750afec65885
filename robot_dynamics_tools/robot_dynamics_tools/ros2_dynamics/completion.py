# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Shell completion of `ros2 dynamics`: names of running nodes, and their joints and links.

These are completers of argcomplete, which calls them with the beginning of a word and the
arguments before it. A completer cannot report an error, and then offers no names.
"""

from argparse import Action, ArgumentParser, Namespace
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient

_TIMEOUT = 2.0
"""Longest time [s] for a completion."""
Completer = Callable[..., Iterable[str]]


def _of_node(ask: Callable[[DynamicsClient], Iterable[str]]) -> Completer:
    """Return the completer that asks the node of the arguments before."""
    def complete(parsed_args: Namespace, **_: object) -> Iterable[str]:
        try:
            with DynamicsClient(getattr(parsed_args, 'node', '') or '', _TIMEOUT) as client:
                return ask(client)
        except (RobotDynamicsError, RuntimeError):
            return []

    return complete


def _checks(**_: object) -> Iterable[str]:
    from robot_dynamics.model_check.finding import CHECKS
    return CHECKS


def _commands(**_: object) -> Iterable[str]:
    from robot_dynamics.control.laws.law_table import command_modes
    return command_modes()


def _joints(parsed_args: Namespace, action: Action, **_: object) -> Iterable[str]:
    """Return NAME= for each joint that has no value yet."""
    texts = getattr(parsed_args, action.dest, None) or []
    if any('=' not in text for text in texts):
        return []
    given = {text.partition('=')[0] for text in texts}
    names = _of_node(lambda client: client.joint_names())(parsed_args)
    return [f'{name}=' for name in names if name not in given]


def _links(client: DynamicsClient) -> Iterable[str]:
    from robot_dynamics.urdf.parser import parse_urdf
    return parse_urdf(client.description()).link_names


COMPLETERS: dict[str, Completer] = {
    **dict.fromkeys(('acceleration', 'position', 'velocity'), _joints),
    **dict.fromkeys(('frame', 'frame_id', 'link'), _of_node(_links)),
    'ignore': _checks, 'mode': _commands, 'node': _of_node(lambda client: client.nodes()),
    'topics': _of_node(lambda client: client.topics())}
"""The completers by argument. Paths have that of argcomplete, others none."""


def add_completers(parser: ArgumentParser) -> None:
    """Set the completers of all arguments of a parser; argcomplete offers no files for numbers."""
    action: Any
    for action in parser._actions:
        if action.type is not Path:
            action.completer = COMPLETERS.get(action.dest, lambda **_: [])
