# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Ask a running `dynamics` node on the command line, or move the arm: `ros2 dynamics move 0.1 0.2`.

Without ros2cli: `ros2 run robot_dynamics_tools dynamics inverse 0.1 0.2`, or
`python -m robot_dynamics_tools inverse 0.1 0.2`.
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
from robot_dynamics_tools.options import add_node, complete, number
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.completion import add_completers
from robot_dynamics_tools.ros2_dynamics.tools import is_tool, take_all, Tool, TOOLS

if TYPE_CHECKING:
    from robot_dynamics_tools.ros2_dynamics.answers import Answer

_PROG = 'ros2 dynamics'
_NEGATIVE = re.compile(r'^-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$', re.IGNORECASE)


class Verb(NamedTuple):
    """One verb: its help in a line, the module of the function that answers, its arguments."""

    help: str
    module: str
    """Module of the function `answer_VERB`, imported for this verb only: some load the library."""
    arguments: tuple[tuple[Any, ...], ...] = ()
    """Names of each argument, then its settings."""


def _flag(text: str) -> dict[str, Any]:
    return {'action': 'store_true', 'help': text}


def _word(metavar: str, text: str, **settings: Any) -> dict[str, Any]:
    return {'metavar': metavar, 'help': text, **settings}


def _joints(text: str) -> dict[str, Any]:
    return _word('VALUE', text, nargs='+', default=[])


_ANY_ORDER = 'a number for each joint in order, or JOINT=NUMBER'
_OTHERS_ZERO = ' (default: 0); with JOINT=NUMBER joints left out have 0'
_POSITION = 'position', _word('POSITION', f'Positions [rad] or [m]: {_ANY_ORDER}', nargs='+')
_VELOCITY = '-v', '--velocity', _joints(f'Velocities [rad/s] or [m/s]{_OTHERS_ZERO}')
_ACCELERATION = (
    '-a', '--acceleration', _joints(f'Accelerations [rad/s²] or [m/s²]{_OTHERS_ZERO}'))
_TRANSITION = '--transition', number(
    0.0, 'SECONDS', 'Time over which a payload replaces the one on its link [s]')
_NO_WAIT = '--no-wait', _flag(
    'Return as soon as the node follows the motion, and do not wait for its end')
_FORCE = '--force', _flag('Replace an output that exists; without it, that is an error')
_XYZ = 'X', 'Y', 'Z'

VERBS: Mapping[str, Verb] = {
    'inverse': Verb('Efforts of a motion, split by term', 'answers', (
        _POSITION, _VELOCITY, _ACCELERATION,
        ('-d', '--derivatives', _flag(
            'Print the derivatives of the efforts by position, velocity and acceleration')))),
    'equation': Verb('M(q), C(q, v), g(q), friction and energies at a state', 'answers', (
        _POSITION, _VELOCITY,
        ('-c', '--christoffel', _flag('Print the Christoffel symbols c_ijk too')))),
    'task_space': Verb('Pose, Jacobian, inertia and forces at a point of a link', 'task_space', (
        ('frame', _word('FRAME', 'Name of a link')),
        ('position', _word(
            'POSITION', f'Positions [rad] or [m]: {_ANY_ORDER} (default: the measured position)',
            nargs='*')),
        _VELOCITY,
        ('--point', number(
            [0.0] * 3, _XYZ, 'Point in the frame of the link [m] (default: its origin)', nargs=3)),
        ('--reference', _word(
            'AXES', 'Axes of velocities and forces: base_aligned, those of the base frame, or '
            'local, those of the link (default: %(default)s)', default='base_aligned')))),
    'check': Verb('Findings of the model check in the model of the node', 'answers', (
        ('--ignore', _word(
            'NAME', 'Checks whose errors do not count (default: those that the node ignores)',
            nargs='*')),)),
    'payload': Verb('Show the active loads, put one on a link, or remove them', 'orders', (
        ('link', _word('LINK', 'Link that carries the load', nargs='?')),
        ('mass', number(
            None, 'MASS', 'Mass of the load [kg], which replaces the load on this link',
            nargs='?')),
        ('--com', number(
            [0.0] * 3, _XYZ, 'Centre of mass in the frame of the link [m] (default: 0 0 0)',
            nargs=3)),
        ('--inertia', number(
            [0.0] * 6, ('XX', 'XY', 'XZ', 'YY', 'YZ', 'ZZ'),
            'Inertia about the centre of mass [kg·m²] (default: 0, a point)', nargs=6)),
        _TRANSITION,
        ('--clear', _flag('Remove the loads of all links (MASS 0 removes that of LINK)')),
        ('--simulated', _flag(
            'Load simulated_arm in the namespace of the node too, as a load does a real arm')))),
    'estimate_payload': Verb(
        'Estimate what is attached to a link from measured efforts', 'orders', (
            ('link', _word(
                'LINK', 'Link for which an estimation begins. Without it, the estimate so far is '
                'printed. With --urdf, recordings are read instead: estimate_payload --urdf URDF '
                '--help', nargs='?')),
            ('--apply', _flag(
                'Set the estimate as payload if mass and first moments are observable')),
            ('--stop', _flag('End the estimation')), _TRANSITION)),
    'status': Verb('State of the node: lifecycle, command, payload, diagnostics', 'orders', (
        ('-v', '--verbose', _flag('Print the values of each check too')),)),
    'move': Verb('Move the arm to a position, wait for rest, and report the errors', 'move', (
        ('position', _word(
            'POSITION', f'Goal [rad] or [m]: {_ANY_ORDER}. Joints that are left out by name keep '
            'their measured position', nargs='+')),
        ('--duration', number(
            None, 'S', 'Duration of the motion [s] (default: by the velocity limits of the URDF, '
            'at least 2 s if a joint that moves has none). The node takes longer if the arm '
            'cannot follow')),
        ('-v', '--velocity', _joints(
            'Largest joint velocities [rad/s] or [m/s], from which the duration follows (default: '
            '60 %% of the limits in the URDF, also for joints that are left out by name)')),
        _NO_WAIT)),
    'pose': Verb(
        'Move a link to a pose, wait for rest, and report the errors', 'move', (
            ('translation', number(
                None, 'COORDINATE',
                'X, Y and Z of the frame of the node (its parameter cartesian.frame) [m]',
                nargs=3)),
            ('--rpy', number(
                None, ('R', 'P', 'Y'), 'Rotation as roll, pitch and yaw [rad], as in a URDF '
                '(default: the present rotation)', nargs=3)),
            ('--frame-id', _word(
                'LINK', 'Link that no joint moves, in whose frame the pose is given (default: the '
                'root link of the URDF)', default='')),
            _NO_WAIT)),
    'stop': Verb('Stop the arm within its limits, and hold it', 'orders'),
    'command': Verb('Show the control law whose efforts are commanded, or change it', 'orders', (
        ('mode', _word(
            'MODE', 'Control law, such as computed_torque, gravity_compensation or none. Without '
            'it, the one in use is printed', nargs='?')),)),
    'reset': Verb('Reset a latched fault', 'orders'),
    'retime': Verb(
        'The fastest timing of a trajectory file within the limits of the arm', 'retime', (
            ('file', _word(
                'FILE', 'Trajectory file (YAML, a trajectory_msgs/JointTrajectory)', type=Path)),
            ('-o', '--output', _word(
                'FILE', 'File for the result. Without it, only the summary is printed',
                type=Path)),
            _FORCE,
            ('--method', _word(
                'METHOD', 'fastest, the fastest timing of the path, or slow_down, a uniform '
                'slow-down (default: %(default)s)', default='fastest')),
            ('--corner-tolerance', number(
                0.0, 'DISTANCE', 'Distance [rad] or [m] within which a path without velocities '
                'passes the points; with 0, paths with corners are rejected')),
            ('-a', '--acceleration', _joints(
                'Acceleration limits [rad/s²] or [m/s²] of all joints (default: no limits)')),
            ('--effort-limit-fraction', number(
                0.0, 'SHARE', 'Share of the limits of effort, current and voltage in (0, 1]; with '
                '0, the parameter of the node')),
            ('--efforts-may-jump', _flag(
                'Do not limit the rate of the efforts. The motion is shorter, but the node '
                'follows it with a larger error')))),
    'watch': Verb('Print a table of the joints again and again', 'watch', (
        ('--rate', number(2.0, 'HZ', 'Number of tables per second')),
        ('--count', number(
            None, 'N', 'Number of tables after which the command ends. Without it, Ctrl-C ends it',
            int)))),
    'record': Verb('Record the topics of the node to a rosbag2 directory', 'record', (
        ('topics', _word(
            'TOPIC', 'Topics to record, such as joint_states, ~/terms (of the node) or /tf '
            '(default: joint_states, effort_command, ~/terms, ~/computed_torque, '
            '~/gravity_compensation, ~/reference, ~/payload and /diagnostics)', nargs='*')),
        ('-o', '--output', _word(
            'DIR', 'New directory for the recording (rosbag2, MCAP; default: recording-<time>)',
            type=Path)),
        _FORCE,
        ('--duration', number(
            None, 'S', 'Duration of the recording [s]. Without it, Ctrl-C ends the recording')))),
}
"""The verbs of a node."""


def add_arguments(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the arguments of a verb to its parser."""
    # argparse takes -1e-3 for an option before Python 3.14.
    parser._negative_number_matcher = _NEGATIVE
    for *names, settings in VERBS[name].arguments:
        parser.add_argument(*names, **settings)
    add_node(parser)
    parser.add_argument('--json', **_flag('Print the answer as JSON'))
    add_completers(parser)


def run(
    name: str, arguments: argparse.Namespace,
    client_for: Callable[[str, float], AbstractContextManager[DynamicsClient]] = DynamicsClient,
) -> int:
    """
    Answer a verb by a client for the node and the timeout asked for; return the exit status.

    0: answered; 1: answered with errors (`check`, `status`), or the motion of `move` was rejected,
    ended early or left a joint away from its goal; 2: no node, or it refused; 130: interrupted.
    One line on stderr explains an error.
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
    complete(parser)
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        command_line.Parser(prog=f'{_PROG} {arguments.verb or ""}'.rstrip()).error(
            f'unrecognized arguments: {" ".join(unknown)}')
    if arguments.verb is None:
        parser.print_help(sys.stderr)
        return command_line.MISTAKE
    return run(arguments.verb, arguments)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all verbs; `__main__` runs the tools before."""
    parser = command_line.Parser(
        prog='dynamics',
        description='Ask a running dynamics node, move the arm, and run the tools.')
    add_verbs(parser)
    return parser


def add_verbs(parser: argparse.ArgumentParser, words: Sequence[str] = ()) -> None:
    """Add the verbs to a parser for these words, which decide what a tool is."""
    verbs = parser.add_subparsers(dest='verb', metavar='VERB')
    described: dict[str, Verb | Tool] = {**VERBS, **TOOLS, **VERBS}  # tools are last
    for name, verb in described.items():
        if is_tool(name, words):
            take_all(verbs.add_parser(name, help=verb.help, add_help=False))
        else:
            add_arguments(name, verbs.add_parser(
                name, help=verb.help, description=f'{verb.help}.'))
