# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Check a robot that publishes joint states, and write a parameter file for dynamics_node.

Prints one line per check: its grade, the value, what is expected, and what to do. The arm is moved
by hand or by its own controller through a few poses, and the efforts that it reports are compared
with g(q). Then, unless --passive, a dynamics node with the new file holds the arm and moves each
joint by 0.02 rad or 0.005 m; Ctrl-C stops it. The parameter file contains the description.

Exit status: 0 done; 1 a check is bad, and the parameter file is not written; 2 a mistake in the
arguments, or nothing found; 130 interrupted.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from robot_dynamics.dependencies import require_ros
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='connect', description=__doc__)
    options.add_output(
        parser, 'FILE', 'Output parameter file (default: %(default)s)', Path('arm.yaml'))
    parser.add_argument('--report', type=Path, metavar='FILE', help='Report page (HTML)')
    options.add_robot(parser, '--urdf', None, 'FILE_OR_PACKAGE', False)
    parser.add_argument(
        '--topic', metavar='NAME', help='Topic of the joint states (default: the one found)')
    parser.add_argument(
        '--receiver', metavar='NAME',
        help='Topic on which the robot receives efforts: sensor_msgs/msg/JointState, or '
             '.../commands of a controller (default: effort_command, or the only controller)')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='Joints of the arm in their order (default: those of the controller, or those of the '
             'description that are published)')
    options.add_parameters(parser, 'all are copied to the output, unless they are measured')
    parser.add_argument(
        '--limit', nargs=3, action='append', default=[], metavar=('JOINT', 'VELOCITY', 'EFFORT'),
        help='Limits of a joint [rad/s, N·m] or [m/s, N]; may be repeated. Limits that are 0 or '
             'missing in the description are asked for on a terminal')
    parser.add_argument('--gravity', **options.number(
        None, ('X', 'Y', 'Z'), 'Gravity in the base frame [m/s²], if the mount is known (default: '
        'from the efforts)', nargs=3))
    parser.add_argument('--unit', choices=('rad',), help=(
        'States that positions are in radians, if no motion shows it; degrees are not supported'))
    parser.add_argument('--poses', **options.number(
        6, 'N', 'Number of poses that the arm is moved to', options.number_in(1, 100, int)))
    parser.add_argument('--duration', **options.number(
        120.0, 'S', 'Longest time for the poses [s]', options.number_in(1.0, 3600.0)))
    parser.add_argument('--passive', action='store_true', help='Send no command at all')
    parser.add_argument(
        '--yes', action='store_true', help='Ask nothing on the terminal, for scripts')
    parser.add_argument('--timeout', **options.number(
        5.0, 'S', 'Time to search for the robot, and to wait for each answer [s]',
        options.number_in(0.1, 600.0)))

    def run(arguments: argparse.Namespace) -> int:
        require_ros('connect')
        from robot_dynamics_tools.connect.session import connect
        return connect(arguments, command_line.origin_of(
            'connect', argv, arguments.urdf, 'of --parameters, or the topic robot_description'))

    return options.run_tool(parser, run, argv)
