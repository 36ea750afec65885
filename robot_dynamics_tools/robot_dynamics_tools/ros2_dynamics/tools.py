# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs of `ros2 dynamics` that are tools: they need no node, and start without ROS."""

import argparse
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import NamedTuple


class Tool(NamedTuple):
    """A tool: its help in a line, its module (by default `commands.VERB`), and its function."""

    help: str
    module: str = ''
    function: str = 'main'


TOOLS: Mapping[str, Tool] = {
    'analyze': Tool('Compare recorded efforts with those of the model'),
    'animate': Tool('Animate a planar arm, or a recording of one'),
    'calibrate_gravity': Tool('Calibrate effort scale and offset from static holds'),
    'connect': Tool('Check a robot, and write a parameter file for dynamics_node'),
    'demo': Tool('Close the loop with simulated_arm, record it, and report', 'demo.cli'),
    'estimate_payload': Tool('Estimate what is attached to a link from recordings'),
    'excite': Tool('Find a motion that excites all parameters'),
    'export_mjcf': Tool('Write the arm as MJCF of MuJoCo'),
    'identify': Tool('Identify the parameters of an arm from recordings'),
    'learn_contact_levels': Tool('Learn the levels of ~/contacts from recordings without contact'),
    'torque_map': Tool('Draw the gravity torque over two joints, or over the workspace'),
    'viewer': Tool('Watch and move the arm in a browser', 'viewer.cli', 'execute'),
}
"""The tools by verb; `estimate_payload` is also a verb of the node."""


def is_tool(verb: str, words: Sequence[str]) -> bool:
    """
    Return whether a verb with these words is a tool.

    `estimate_payload` reads recordings if the words contain --urdf, and otherwise asks the node.
    """
    return verb in TOOLS and (verb != 'estimate_payload' or any(
        word.partition('=')[0] == '--urdf' for word in words))


def run_tool_verb(verb: str, words: Sequence[str]) -> int:
    """Run a tool with its own arguments; return its exit status."""
    tool = TOOLS[verb]
    module = import_module(f'robot_dynamics_tools.{tool.module or f"commands.{verb}"}')
    return int(getattr(module, tool.function)(list(words)))


def take_all(parser: argparse.ArgumentParser) -> None:
    """Take all words behind the verb, also --help, as the arguments of the tool."""
    parser.prefix_chars = '\0'  # no word is an option of this parser
    parser.add_argument('words', nargs=argparse.REMAINDER)
