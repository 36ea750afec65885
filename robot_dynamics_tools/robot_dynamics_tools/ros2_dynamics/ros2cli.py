# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
`ros2 dynamics`: the verbs for ros2cli, which finds them by entry points.

Nothing else imports this module, as ros2cli is not everywhere.
"""

from argparse import ArgumentParser, Namespace
import sys

from robot_dynamics_tools.ros2_dynamics.tool_verbs import is_tool, run_tool_verb, take_all
from robot_dynamics_tools.ros2_dynamics.verbs import add_arguments, run
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


class InverseVerb(VerbExtension):
    """Which efforts a motion takes, split by term."""


class EquationVerb(VerbExtension):
    """M(q), C(q, v), g(q), friction and energies at a state."""


class TaskSpaceVerb(VerbExtension):
    """Pose, Jacobian, inertia and forces at a point of a link."""


class PoseVerb(VerbExtension):
    """Move a link to a pose, and report the position that the joints reached."""


class CheckVerb(VerbExtension):
    """Whether the model of the node is fit to compute with."""


class PayloadVerb(VerbExtension):
    """Show the active loads, put one on a link, or remove them."""


class EstimatePayloadVerb(VerbExtension):
    """Estimate what is attached to a link from measured efforts."""


class StatusVerb(VerbExtension):
    """How the node is: lifecycle, command, payload, diagnostics."""


class MoveVerb(VerbExtension):
    """Move the arm to a position, and report the position that it reached."""


class StopVerb(VerbExtension):
    """Stop the arm within its limits, and hold it."""


class CommandVerb(VerbExtension):
    """Show the control law whose efforts are commanded, or change it."""


class ResetVerb(VerbExtension):
    """Reset a latched fault."""


class RetimeVerb(VerbExtension):
    """The fastest timing of a trajectory file within the limits of the arm."""


class LearnContactLevelsVerb(VerbExtension):
    """Learn the levels of ~/contacts from recordings without contact."""


class WatchVerb(VerbExtension):
    """Print a table of the joints again and again."""


class RecordVerb(VerbExtension):
    """Record the topics of the node to a rosbag2 directory."""


class AnalyzeVerb(VerbExtension):
    """Compare recorded efforts with those of the model."""


class AnimateVerb(VerbExtension):
    """Animate a planar arm, or a recording of one."""


class CalibrateGravityVerb(VerbExtension):
    """Calibrate effort scale and offset from static holds."""


class DemoVerb(VerbExtension):
    """Close the loop with simulated_arm, record it, and report."""


class ExciteVerb(VerbExtension):
    """Find a motion that excites all parameters."""


class ExportMjcfVerb(VerbExtension):
    """Write the arm as MJCF of MuJoCo."""


class IdentifyVerb(VerbExtension):
    """Identify the parameters of an arm from recordings."""


class TorqueMapVerb(VerbExtension):
    """Draw the gravity torque over two joints, or over the workspace."""


class ViewerVerb(VerbExtension):
    """Watch and move the arm in a browser."""
