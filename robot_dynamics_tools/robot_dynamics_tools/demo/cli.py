# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A simulated arm follows a trajectory under computed torque, with both nodes as processes.

With --replay, the model is compared with the efforts of a recording.

Exit status: 0 done, and every joint tracked; 1 a joint did not track, or a node failed; 2 a
mistake in the arguments, a file that cannot be used, or a library that is not installed; 130
interrupted.
"""

import argparse
from collections.abc import Sequence
from datetime import datetime
import os
from pathlib import Path
import signal
import sys
from typing import TYPE_CHECKING

from robot_dynamics.dependencies import require, require_ros
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.tools import command_line
from robot_dynamics_tools import options
from robot_dynamics_tools.viewer.cli import DEFAULT_PORT, PORT_NUMBER

if TYPE_CHECKING:
    from robot_dynamics.model.arm import ArmModel
    from robot_dynamics.model_check.html_page import Origin
    from robot_dynamics_tools.excitation.demo_motion import ReferenceMotion

DEFAULT_DURATION = 10.0
DEFAULT_RATE = 500.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit status."""
    parser = command_line.Parser(prog='demo', description=__doc__)
    options.add_robot(
        parser, '--robot',
        'the planar two-link arm, or with --replay the description in the recording', 'URDF')
    parser.add_argument('--duration', **options.number(
        None, 'S', f'Duration of the motion [s] (default: {DEFAULT_DURATION:g}); with --replay: '
        'play only the first S seconds', options.number_in(1.0, 3600.0)))
    parser.add_argument('--rate', **options.number(
        None, 'HZ', f'Rate of the joint states [Hz] (default: {DEFAULT_RATE:g}); with --replay: '
        'largest rate (default: as fast as the node responds)', options.number_in(1.0, 10000.0)))
    parser.add_argument(
        '--trajectory', type=Path, metavar='FILE',
        help='YAML file with the trajectory_msgs/JointTrajectory to follow, in the format of '
             'excite')
    parser.add_argument(
        '--parameters', type=Path, metavar='FILE',
        help='Parameter file for both nodes, for example with friction, motors and noise')
    parser.add_argument(
        '--replay', type=Path, metavar='BAG',
        help='Recording whose joint states are played to the node instead of a simulation: a '
             'rosbag2 directory, or a .mcap or .db3 file')
    parser.add_argument(
        '--topic', metavar='NAME',
        help='Topic of the joint states in the recording (default: /joint_states, or the only '
             'topic of type sensor_msgs/msg/JointState)')
    parser.add_argument(
        '--out', type=Path, metavar='DIR',
        help='Directory of the figure, the report, the recording and the logs (default: '
             'out/demo-<time>)')
    parser.add_argument(
        '--viewer', type=PORT_NUMBER, nargs='?', const=DEFAULT_PORT, metavar='PORT',
        help='Show the arm in a browser, where sliders move it, until Ctrl-C; port of the page '
             f'(default: {DEFAULT_PORT})')
    parser.add_argument(
        '--no-plot', action='store_true', help='Write neither the figure nor the report')
    parser.add_argument(
        '--yes', action='store_true',
        help='Install the description of a robot by name without a question (scripts of a clone)')
    return options.run_tool(parser, lambda arguments: _run(arguments, argv), argv)


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    # A signal that ends the demo also ends its nodes; the recording is kept.
    for signal_number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(signal_number, signal.default_int_handler)
    if arguments.topic is not None and arguments.replay is None:
        raise InvalidInputError(
            '--topic is given without --replay; it is a topic of the recording')
    for option, other in (('trajectory', 'replay'), ('trajectory', 'duration'),
                          ('parameters', 'replay'), ('viewer', 'replay')):
        if None not in (getattr(arguments, option), getattr(arguments, other)):
            raise InvalidInputError(f'--{option} is given with --{other}, expected one of the two')
    require_ros('the demo')
    if arguments.viewer is not None:
        require('demo --viewer', 'viser')
    urdf = None if arguments.robot is None else options.read_robot(arguments.robot, '--robot')
    directory = _make_directory(arguments.out)
    print(f'Writing to {directory}', flush=True)
    from robot_dynamics_tools.processes import choose_domain
    os.environ.update(choose_domain(os.environ))
    default = 'the planar two-link arm of this package' if arguments.replay is None else (
        'robot_description of the recording, or else the planar two-link arm of this package')
    begin = _closed_loop if arguments.replay is None else _replay
    return begin(arguments, urdf, directory, command_line.origin_of(
        'demo', argv, arguments.robot, default))


def _closed_loop(
    arguments: argparse.Namespace, given: str | None, directory: Path, origin: 'Origin',
) -> int:
    from robot_dynamics.model.arm_parameters import arm_from_parameters
    from robot_dynamics_tools.demo.loop import run_closed_loop
    from robot_dynamics_tools.demo.report import loop_report, print_report, write_loop_page
    from robot_dynamics_tools.demo.session import PICTURE, RECORDING, REPORT
    urdf = _written(given or options.read_robot(None), directory)
    arm = arm_from_parameters(urdf, options.read_parameters(arguments.parameters))
    run = run_closed_loop(
        arm, urdf, _motion(arm, arguments), arguments.rate or DEFAULT_RATE, directory,
        arguments.parameters, None if arguments.viewer is None else (
            '--port', str(arguments.viewer),
            *(() if arguments.robot is None else ('--robot', arguments.robot))))
    try:
        report = loop_report(directory / RECORDING, arm, run)
        print_report(report, run)
        print(f'Recording        {directory / RECORDING}')
        if not arguments.no_plot:
            write_loop_page(report, run, directory / PICTURE, directory / REPORT, origin)
            print(f'Figure           {directory / PICTURE}')
            print(f'Report           {directory / REPORT}')
    except (RobotDynamicsError, OSError) as error:
        if not run.interrupted:
            raise command_line.ToolError(str(error)) from None
    if run.interrupted:
        print(f'demo: interrupted; partial results are in {directory}', file=sys.stderr)
        return command_line.INTERRUPTED
    if report.missed:
        raise command_line.ToolError(
            f'did not track: RMS error too large at {", ".join(report.missed)}')
    print('All joints tracked.')
    return command_line.DONE


def _motion(arm: 'ArmModel', arguments: argparse.Namespace) -> 'ReferenceMotion':
    from robot_dynamics_tools.excitation.demo_motion import make_reference_motion, motion_along
    if arguments.trajectory is None:
        return make_reference_motion(arm, arguments.duration or DEFAULT_DURATION)
    from robot_dynamics.trajectories.files import read_trajectory
    return motion_along(arm, read_trajectory(arguments.trajectory, arm.joint_names))


def _replay(
    arguments: argparse.Namespace, given: str | None, directory: Path, origin: 'Origin',
) -> int:
    from robot_dynamics_tools.analysis.tasks import AnalysisTask, analyze_task
    from robot_dynamics_tools.commands.analyze import print_one
    from robot_dynamics_tools.demo.replay import play_recording, read_recording
    from robot_dynamics_tools.demo.session import RECORDING, REPORT
    recorded, own = read_recording(arguments.replay, arguments.topic, arguments.duration)
    urdf = _written(given or own or options.read_robot(None), directory)
    settings = play_recording(recorded, urdf, arguments.rate, directory)
    outputs = () if arguments.no_plot else (REPORT,)
    try:
        print_one(analyze_task(directory / RECORDING, AnalysisTask(
            settings, outputs, str(directory), origin)), is_resumed=False)
    except (RobotDynamicsError, OSError) as error:
        raise command_line.ToolError(str(error)) from None
    return command_line.DONE


def _written(urdf: str, directory: Path) -> str:
    """Return a URDF, and write it into `directory`."""
    from robot_dynamics_tools.demo.session import DESCRIPTION
    command_line.write_file(directory / DESCRIPTION, urdf)
    return urdf


def _make_directory(wanted: Path | None) -> Path:
    """Return a new or empty directory: the requested one, or a new one in it or in out/."""
    if wanted is not None:
        if wanted.is_file():
            raise InvalidInputError(
                f'--out: {str(wanted)!r} cannot be used: it is a file, expected a directory')
        command_line.make_directory(wanted)
        if not any(wanted.iterdir()):
            return wanted
    parent = wanted or Path('out')
    directory = parent / f'demo-{datetime.now():%Y%m%d-%H%M%S-%f}'
    command_line.make_directory(directory)
    return directory
