# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Shell completion of `ros2 dynamics`: names of running nodes, and their joints and links.

These are completers of argcomplete, which calls them with the beginning of a word and the
arguments before it. A completer cannot report an error, and then offers no names.
"""

from argparse import Action, ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient

_TIMEOUT = 2.0
"""Longest time [s] for a completion."""


def _asking(ask: Callable[[DynamicsClient], list[str]], arguments: Namespace) -> list[str]:
    try:
        with DynamicsClient(getattr(arguments, 'node', '') or '', _TIMEOUT) as client:
            return ask(client)
    except (RobotDynamicsError, RuntimeError):
        return []


def complete_nothing(prefix: str, **_: object) -> list[str]:
    """Return nothing for a number, where argcomplete would offer files."""
    return []


def complete_checks(prefix: str, **_: object) -> list[str]:
    """Return the names of the checks of a model."""
    from robot_dynamics.model_check.finding import CHECKS
    return list(CHECKS)


def complete_commands(prefix: str, **_: object) -> list[str]:
    """Return the control laws, and `none`."""
    from robot_dynamics.control.laws.law_table import command_modes
    return list(command_modes())


def complete_nodes(prefix: str, **_: object) -> list[str]:
    """Return the `dynamics` nodes that run."""
    return _asking(DynamicsClient.nodes, Namespace())


def complete_joints(
    prefix: str, parsed_args: Namespace, action: Action | None = None, **_: object,
) -> list[str]:
    """Return NAME= for each joint that has no value yet."""
    texts = getattr(parsed_args, getattr(action, 'dest', 'position'), None) or []
    if any('=' not in text for text in texts):
        return []
    given = {text.partition('=')[0] for text in texts}
    names = _asking(lambda client: client.joint_names(), parsed_args)
    return [f'{name}=' for name in names if name not in given]


def complete_links(prefix: str, parsed_args: Namespace, **_: object) -> list[str]:
    """Return the links of the arm."""
    from robot_dynamics.urdf.parser import parse_urdf
    return _asking(lambda client: list(parse_urdf(client.description()).link_names), parsed_args)


def complete_topics(prefix: str, parsed_args: Namespace, **_: object) -> list[str]:
    """Return the topics that exist."""
    return _asking(lambda client: client.topics(), parsed_args)


COMPLETERS: dict[str, Callable[..., list[str]]] = {
    'acceleration': complete_joints, 'frame': complete_links, 'frame_id': complete_links,
    'ignore': complete_checks, 'link': complete_links, 'mode': complete_commands,
    'node': complete_nodes, 'position': complete_joints, 'topics': complete_topics,
    'velocity': complete_joints}
"""The completers by argument. Paths have that of argcomplete, others none."""


def add_completers(parser: ArgumentParser) -> None:
    """Set the completers of all arguments of a parser."""
    action: Any
    for action in parser._actions:
        if action.type is not Path:
            action.completer = COMPLETERS.get(action.dest, complete_nothing)
