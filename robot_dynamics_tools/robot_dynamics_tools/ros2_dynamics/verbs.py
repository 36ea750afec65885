# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Ask a running `dynamics` node on the command line, or move the arm: `ros2 dynamics move 0.1 0.2`.

Without ros2cli: `ros2 run robot_dynamics_tools dynamics inverse 0.1 0.2`, or
`python -m robot_dynamics_tools.ros2_dynamics inverse 0.1 0.2`.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from importlib import import_module
import json
from pathlib import Path
import re
import sys
from typing import Any, NamedTuple, TYPE_CHECKING

from robot_dynamics.tools import command_line
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, TIMEOUT
from robot_dynamics_tools.ros2_dynamics.completion import (
    complete_checks,
    complete_commands,
    complete_joints,
    complete_links,
    complete_nodes,
    complete_nothing,
    complete_topics,
)
from robot_dynamics_tools.ros2_dynamics.tool_verbs import take_all, TOOLS

if TYPE_CHECKING:
    from robot_dynamics_tools.ros2_dynamics.answers import Answer

_PROG = 'ros2 dynamics'
_NEGATIVE = re.compile(r'^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$', re.IGNORECASE)


def _inverse_arguments(parser: argparse.ArgumentParser) -> None:
    _add_position(parser)
    _add_joints(parser, '-v', '--velocity', 'velocities [rad/s] or [m/s] (default: 0)')
    _add_joints(
        parser, '-a', '--acceleration', 'accelerations [rad/s²] or [m/s²] (default: 0)')
    parser.add_argument(
        '-d', '--derivatives', action='store_true',
        help='Print the derivatives of the efforts by position, velocity and acceleration.')


def _equation_arguments(parser: argparse.ArgumentParser) -> None:
    _add_position(parser)
    _add_joints(parser, '-v', '--velocity', 'velocities [rad/s] or [m/s] (default: 0)')
    parser.add_argument(
        '-c', '--christoffel', action='store_true', help='the Christoffel symbols c_ijk too')


def _task_space_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_links, 'frame', metavar='FRAME', help='Name of a link')
    _add(parser, complete_joints, 'position', nargs='*', metavar='POSITION',
         help='Positions [rad] or [m]: a number for each joint in order, or JOINT=NUMBER. The '
              'default is the measured position.')
    _add_joints(parser, '-v', '--velocity', 'velocities [rad/s] or [m/s] (default: 0)')
    _add(parser, complete_nothing, '--point', nargs=3, type=float, default=[0.0] * 3,
         metavar=('X', 'Y', 'Z'),
         help='Point in the frame of the link [m]. The default is its origin.')
    _add(parser, complete_nothing, '--reference', default='base_aligned', metavar='AXES',
         help='Axes of velocities and forces: base_aligned, those of the base frame, or local, '
              'those of the link. The default is base_aligned.')


def _check_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_checks, '--ignore', nargs='*', metavar='NAME',
         help='checks whose errors do not count (default: what the node ignores)')


def _payload_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_links, 'link', nargs='?', metavar='LINK', help='where the load is')
    _add(parser, complete_nothing, 'mass', nargs='?', type=float, metavar='MASS',
         help='its mass [kg]; it replaces the load on this link')
    _add(parser, complete_nothing, '--com', nargs=3, type=float, default=[0.0] * 3,
         metavar=('X', 'Y', 'Z'),
         help='its centre of mass in the frame of the link [m] (default: 0 0 0)')
    _add(parser, complete_nothing, '--inertia', nargs=6, type=float, default=[0.0] * 6,
         metavar=('XX', 'XY', 'XZ', 'YY', 'YZ', 'ZZ'),
         help='its inertia about the centre of mass [kg·m²] (default: 0, a point)')
    _add(parser, complete_nothing, '--transition', type=float, default=0.0, metavar='SECONDS',
         help='time over which it replaces the load on its link (default: 0, at once)')
    parser.add_argument(
        '--clear', action='store_true',
        help='remove the loads of all links (MASS 0 removes that of LINK)')
    parser.add_argument(
        '--simulated', action='store_true',
        help='load simulated_arm in the namespace of the node too, which a real arm does itself')


def _estimate_payload_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_links, 'link', nargs='?', metavar='LINK',
         help='Link for which an estimation begins. Without it, the estimate so far is printed. '
              'With --urdf, recordings are read instead: estimate_payload --urdf URDF --help.')
    parser.add_argument(
        '--apply', action='store_true',
        help='Set the estimate as payload if mass and first moments are observable.')
    parser.add_argument('--stop', action='store_true', help='End the estimation.')
    _add(parser, complete_nothing, '--transition', type=float, default=0.0, metavar='SECONDS',
         help='Time over which an applied payload replaces the old one [s]. The default is 0.')


def _status_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        '-v', '--verbose', action='store_true', help='the figures of each check too')


def _move_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_joints, 'position', nargs='+', metavar='POSITION',
         help='Goal [rad] or [m]: one number per joint in the order of the node, or JOINT=NUMBER. '
              'Joints that are left out by name keep their measured position.')
    _add(parser, complete_nothing, '--duration', type=float, metavar='S',
         help='Duration of the motion [s]. The default follows from the velocity limits of the '
              'URDF, and is at least 2 s if a joint that moves has none. The node takes longer '
              'if the arm cannot follow.')
    _add(parser, complete_joints, '-v', '--velocity', nargs='+', default=[], metavar='VALUE',
         help='Largest joint velocities [rad/s] or [m/s], from which the duration follows. The '
              'default is 60 %% of the limits in the URDF, also for joints that are left out by '
              'name.')
    parser.add_argument(
        '--no-wait', action='store_true',
        help='Return as soon as the node follows the motion, and do not wait for its end.')


def _pose_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_nothing, 'translation', nargs=3, type=float, metavar='COORDINATE',
         help='X, Y and Z of the frame of the node (its parameter cartesian.frame) [m]')
    _add(parser, complete_nothing, '--rpy', nargs=3, type=float, metavar=('R', 'P', 'Y'),
         help='Rotation as roll, pitch and yaw [rad], as in a URDF. The default is the present '
              'rotation.')
    _add(parser, complete_links, '--frame-id', default='', metavar='LINK',
         help='Link that no joint moves, in whose frame the pose is given. The default is the '
              'root link of the URDF.')
    parser.add_argument(
        '--no-wait', action='store_true',
        help='Return as soon as the node follows the motion, and do not wait for its end.')


def _retime_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_nothing, 'file', type=Path, metavar='FILE',
         help='Trajectory file (YAML, a trajectory_msgs/JointTrajectory)')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE',
        help='File for the result. Without it, only the summary is printed.')
    _add(parser, complete_nothing, '--method', default='fastest', metavar='METHOD',
         help='fastest, the fastest timing of the path, or slow_down, a uniform slow-down. The '
              'default is fastest.')
    _add(parser, complete_nothing, '--corner-tolerance', type=float, default=0.0,
         metavar='DISTANCE',
         help='Distance [rad] or [m] within which a path without velocities passes the points. '
              'The default is 0: paths with corners are rejected.')
    _add(parser, complete_joints, '-a', '--acceleration', nargs='+', default=[], metavar='VALUE',
         help='Acceleration limits [rad/s²] or [m/s²] of all joints. The default is no limits.')
    _add(parser, complete_nothing, '--effort-limit-fraction', type=float, default=0.0,
         metavar='SHARE',
         help='Share of the limits of effort, current and voltage in (0, 1]. The default is the '
              'parameter of the node.')
    parser.add_argument(
        '--efforts-may-jump', action='store_true',
        help='Do not limit the rate of the efforts. The motion is shorter, but the node follows '
             'it with a larger error.')


def _no_arguments(parser: argparse.ArgumentParser) -> None:
    pass


def _command_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_commands, 'mode', nargs='?', metavar='MODE',
         help='Control law, such as computed_torque, gravity_compensation or none. Without it, '
              'the one in use is printed.')


def _watch_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_nothing, '--rate', type=float, default=2.0, metavar='HZ',
         help='Number of tables per second. The default is 2.')
    _add(parser, complete_nothing, '--count', type=int, metavar='N',
         help='Number of tables after which the command ends. Without it, Ctrl-C ends it.')


def _record_arguments(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_topics, 'topics', nargs='*', metavar='TOPIC',
         help='Topics to record, such as joint_states, ~/terms (of the node) or /tf. The '
              'default is joint_states, effort_command, ~/terms, ~/computed_torque, '
              '~/gravity_compensation, ~/reference, ~/payload and /diagnostics.')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='DIR',
        help='New directory for the recording (rosbag2, MCAP). The default is recording-<time>.')
    _add(parser, complete_nothing, '--duration', type=float, metavar='S',
         help='Duration of the recording [s]. Without it, Ctrl-C ends the recording.')


def _add_position(parser: argparse.ArgumentParser) -> None:
    _add(parser, complete_joints, 'position', nargs='+', metavar='POSITION',
         help='positions [rad] or [m]: a number for each joint in order, or JOINT=NUMBER')


def _add_joints(parser: argparse.ArgumentParser, short: str, name: str, what: str) -> None:
    _add(parser, complete_joints, short, name, nargs='+', default=[], metavar='VALUE',
         help=f'{what}; with JOINT=NUMBER joints left out have 0')


def _add(
    parser: argparse.ArgumentParser, completer: Callable[..., list[str]], *names: str,
    **options: Any,
) -> None:
    argument: Any = parser.add_argument(*names, **options)
    argument.completer = completer


class Verb(NamedTuple):
    """One verb: its help in a line, its arguments, and the function that answers."""

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    module: str
    """Module of the function `answer_VERB`, imported for this verb only: some load the library."""


VERBS: Mapping[str, Verb] = {
    'inverse': Verb(
        'Which efforts a motion takes, split by term', _inverse_arguments, 'answers'),
    'equation': Verb(
        'M(q), C(q, v), g(q), friction and energies at a state', _equation_arguments, 'answers'),
    'task_space': Verb(
        'Pose, Jacobian, inertia and forces at a point of a link', _task_space_arguments,
        'task_space'),
    'check': Verb(
        'Whether the model of the node is fit to compute with', _check_arguments, 'answers'),
    'payload': Verb(
        'Show the active loads, put one on a link, or remove them', _payload_arguments, 'answers'),
    'estimate_payload': Verb(
        'Estimate what is attached to a link from measured efforts', _estimate_payload_arguments,
        'payload_estimate'),
    'status': Verb(
        'How the node is: lifecycle, command, payload, diagnostics', _status_arguments, 'answers'),
    'move': Verb(
        'Move the arm to a position, and report the position that it reached', _move_arguments,
        'move'),
    'pose': Verb(
        'Move a link to a pose, and report the position that the joints reached',
        _pose_arguments, 'move'),
    'stop': Verb(
        'Stop the arm within its limits, and hold it', _no_arguments, 'orders'),
    'command': Verb(
        'Show the control law whose efforts are commanded, or change it', _command_arguments,
        'orders'),
    'reset': Verb('Reset a latched fault', _no_arguments, 'orders'),
    'retime': Verb(
        'The fastest timing of a trajectory file within the limits of the arm',
        _retime_arguments, 'retime'),
    'watch': Verb('Print a table of the joints again and again', _watch_arguments, 'watch'),
    'record': Verb(
        'Record the topics of the node to a rosbag2 directory', _record_arguments, 'record'),
}


def add_arguments(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the arguments of a verb to its parser."""
    # argparse takes -1e-3 for an option before Python 3.14.
    parser._negative_number_matcher = _NEGATIVE
    VERBS[name].add_arguments(parser)
    _add(parser, complete_nodes, '-n', '--node', default='', metavar='NODE',
         help='Name of the dynamics node with its namespace. The default is the only one that '
              'runs.')
    _add(parser, complete_nothing, '--timeout', type=float, default=TIMEOUT, metavar='SECONDS',
         help='Time to search for the node, and to wait for each answer [s]. The default is '
              f'{TIMEOUT:g}.')
    parser.add_argument('--json', action='store_true', help='Print the answer as JSON.')


def run(
    name: str, arguments: argparse.Namespace,
    client_for: Callable[[str, float], AbstractContextManager[DynamicsClient]] = DynamicsClient,
) -> int:
    """
    Answer a verb by a client for the node and the timeout asked for; return the exit status.

    0: answered; 1: answered with errors (`check`, `status`), or the motion of `move` was rejected
    or ended early; 2: no node, or it refused; 130: `move` was interrupted. One line on stderr
    explains an error.
    """
    def answer() -> int:
        module = import_module(f'robot_dynamics_tools.ros2_dynamics.{VERBS[name].module}')
        with client_for(arguments.node, arguments.timeout) as client:
            found: Answer | None = getattr(module, f'answer_{name}')(client, arguments)
        if found is None:  # the verb has printed its answers
            return command_line.DONE
        print(json.dumps(found.data, indent=2) if arguments.json else found.text)
        return found.status

    return command_line.run_tool(f'{_PROG} {name}', answer)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool without ros2cli, and return its exit status."""
    parser = make_parser()
    try:
        import argcomplete
    except ImportError:
        pass
    else:
        argcomplete.autocomplete(parser)
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        command_line.Parser(prog=f'{_PROG} {arguments.verb or ""}'.rstrip()).error(
            f'unrecognized arguments: {" ".join(unknown)}')
    if arguments.verb is None:
        parser.print_help(sys.stderr)
        return command_line.MISTAKE
    return run(arguments.verb, arguments)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all verbs; `cli` runs the tools before."""
    parser = command_line.Parser(
        prog='dynamics',
        description='Ask a running dynamics node, move the arm, and run the tools.')
    verbs = parser.add_subparsers(dest='verb', metavar='VERB')
    for name, verb in VERBS.items():
        add_arguments(name, verbs.add_parser(name, help=verb.help, description=f'{verb.help}.'))
    for name, tool in TOOLS.items():
        if name not in VERBS:
            take_all(verbs.add_parser(name, help=tool.help, add_help=False))
    return parser
