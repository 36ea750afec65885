# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`ros2 dynamics`: the command for ros2cli, which finds it by its entry point.

Nothing else imports this module, as ros2cli is not everywhere.
"""

from argparse import ArgumentParser, Namespace
import sys

from robot_dynamics_tools.ros2_dynamics.tools import is_tool, run_tool_verb
from robot_dynamics_tools.ros2_dynamics.verbs import add_verbs, run
from ros2cli.command import CommandExtension


class DynamicsCommand(CommandExtension):
    """Ask a running dynamics node, move the arm, and run the tools."""

    def add_arguments(self, parser: ArgumentParser, cli_name: str) -> None:
        """Add the verbs."""
        self._parser = parser
        add_verbs(parser, sys.argv)

    def main(self, *, parser: ArgumentParser, args: Namespace) -> int:
        """Answer the verb, and return the exit status; without one, print the help."""
        if args.verb is None:
            self._parser.print_help()
            return 0
        if is_tool(args.verb, sys.argv):
            return run_tool_verb(args.verb, args.words)
        return run(args.verb, args)
