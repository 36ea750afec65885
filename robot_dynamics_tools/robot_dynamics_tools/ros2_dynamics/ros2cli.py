# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`ros2 dynamics`: the verbs for ros2cli, which finds them by entry points.

Nothing else imports this module, as ros2cli is not everywhere.
"""

from argparse import ArgumentParser, Namespace
import sys

from robot_dynamics_tools.ros2_dynamics.tools import is_tool, run_tool_verb, take_all, TOOLS
from robot_dynamics_tools.ros2_dynamics.verbs import add_arguments, run, VERBS
from ros2cli.command import add_subparsers_on_demand, CommandExtension
from ros2cli.plugin_system import PLUGIN_SYSTEM_VERSION, satisfies_version


class DynamicsCommand(CommandExtension):
    """Ask a running dynamics node, move the arm, and run the tools."""

    def add_arguments(self, parser: ArgumentParser, cli_name: str) -> None:
        """Add the verbs that are installed."""
        self._parser = parser
        add_subparsers_on_demand(
            parser, cli_name, '_verb', 'robot_dynamics_tools.verb', required=False)

    def main(self, *, parser: ArgumentParser, args: Namespace) -> int:
        """Answer the verb; without one, print the help."""
        verb: VerbExtension | None = getattr(args, '_verb', None)
        if verb is None:
            self._parser.print_help()
            return 0
        return verb.main(args=args)


class VerbExtension:
    """The extension point for verbs of `ros2 dynamics`; `NAME` is that of the entry point."""

    NAME = ''
    EXTENSION_POINT_VERSION = '0.1'

    def __init__(self) -> None:
        satisfies_version(PLUGIN_SYSTEM_VERSION, '^0.1')

    def add_arguments(self, parser: ArgumentParser, cli_name: str) -> None:
        """Add the arguments of the verb, or take all words for a tool."""
        if is_tool(self.NAME, sys.argv):
            take_all(parser)
        else:
            add_arguments(self.NAME, parser)

    def main(self, *, args: Namespace) -> int:
        """Answer, and return the exit status."""
        if is_tool(self.NAME, sys.argv):
            return run_tool_verb(self.NAME, args.words)
        return run(self.NAME, args)


def __getattr__(name: str) -> type[VerbExtension]:
    """Return the class of the entry point `VERB_verb`; its docstring is the help of ros2cli."""
    verb = name.removesuffix('_verb')
    found = VERBS.get(verb) or TOOLS.get(verb)
    if found is None:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return type(name, (VerbExtension,), {'__doc__': f'{found.help}.'})
