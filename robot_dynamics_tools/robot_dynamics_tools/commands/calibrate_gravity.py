# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Calibrate effort scale and offset of each joint from static holds, approached from both sides.

Writes a parameter file for dynamics_node and a report: scale and offset of the measured effort,
and of the command if the recordings contain effort_command. With --move it moves the arm of a
running node and records the holds itself; without it, BAG and --urdf are required.

Exit status: 0 done; 1 the nodes would not accept a value, the report names it, or the motion ended
early; 2 a mistake in the arguments, or node or recordings do not permit a calibration; 130
interrupted.
"""

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
import sys

from robot_dynamics.dependencies import require_ros
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.payload import make_payload, Payload
from robot_dynamics.model_check.html_page import summary
from robot_dynamics.tools import command_line
from robot_dynamics.validation import check_scalar, LARGEST_VALUE
from robot_dynamics_tools import options
from robot_dynamics_tools.gravity_calibration import recorded_holds, report
from robot_dynamics_tools.gravity_calibration.calibrated_file import calibrated_file, header
from robot_dynamics_tools.gravity_calibration.scale_fit import Tool
from robot_dynamics_tools.gravity_motion.plan import MotionSettings
from robot_dynamics_tools.gravity_motion.poses import PoseChoice
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.reporting.text_table import quantity_table, text_table

REPORT = '.html'


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='calibrate_gravity', description=__doc__)
    options.add_recordings(parser, None, required=False)
    parser.add_argument(
        '--with-weight', nargs='+', type=Path, default=[], metavar='BAG',
        help='Recordings of holds with a known weight, which determines the scale; requires '
             '--weight-mass and --weight-link')
    parser.add_argument('--weight-mass', **options.number(None, 'KG', 'Mass of the weight [kg]'))
    parser.add_argument(
        '--weight-link', metavar='LINK', help='Link of the URDF that carries the weight')
    parser.add_argument('--weight-position', **options.number(
        (0.0, 0.0, 0.0), ('X', 'Y', 'Z'),
        'Centre of mass of the weight in the frame of its link [m] (default: 0 0 0)', nargs=3))
    parser.add_argument(
        '--tool-link', metavar='LINK',
        help='Link that carries a tool that is not part of the URDF: its first moments are '
             'estimated, and its mass if --tool-mass is omitted')
    parser.add_argument('--tool-mass', **options.number(
        None, 'KG', 'Known mass of this tool [kg]; required without --with-weight'))
    options.add_parameters(
        parser, 'joints, gravity, motors, measured_effort, effort; all are copied to the output')
    options.add_output(parser, 'FILE', (
        'Output parameter file; the report has the same name, with the suffix .html (default: '
        '%(default)s)'), Path('calibrated.yaml'))
    _add_motion(parser)
    parser.set_defaults(cutoff=None)  # holds are not filtered
    return options.run_tool(parser, lambda arguments: _run(arguments, argv), argv)


def _add_motion(parser: argparse.ArgumentParser) -> None:
    """Add --move and the options of the motion."""
    group = parser.add_argument_group('motion of the arm')
    for name, text in (
            ('move', 'Move the arm of a running dynamics_node through poses, record, and compute '
                     'from the recording. Collisions are not checked'),
            ('preview', 'With --move: print the poses and their gravity torques, and do not move '
                        'the arm'),
            ('yes', 'Move without the question on the terminal, for scripts'),
            ('with-weight-after',
             'Record a second time with the weight of --weight-mass, --weight-link and '
             '--weight-position, which the operator attaches when the tool asks for it')):
        group.add_argument(f'--{name}', action='store_true', help=text)
    group.add_argument(
        '--recording', type=Path, metavar='DIR',
        help='New directory of the recording; that with the weight is DIR-with-weight (default: '
             'gravity-<time>)')
    group.add_argument(
        '--poses', type=Path, metavar='FILE',
        help='YAML file with the list `poses` of JOINT: POSITION in rad or m (default: poses that '
             'are selected for this arm)')
    for name, default, text in (('count', 10, 'Number of selected poses, 8 to 20'),
                                ('seed', 0, 'Seed of the selection of the poses')):
        group.add_argument(f'--{name}', **options.number(default, 'N', text, int))
    group.add_argument(
        '--range', nargs=3, action='append', default=[], metavar=('JOINT', 'MIN', 'MAX'),
        dest='ranges',
        help='Range of a joint at the poses and between them [rad] or [m]; may be repeated '
             '(default: the position limits; without limits, one turn around 0)')
    group.add_argument('--hold', **options.number(
        2.0, 'S', 'Time at rest at each pose, after the motion from each side [s]'))
    for name, text in (
            ('approach', 'Distance from which each pose is approached, on both sides [rad] or [m] '
                         '(default: 0.1 rad, 0.02 m, at most 0.05 of the range)'),
            ('step', 'Largest displacement of a joint per move [rad] or [m] (default: 0.5 rad, '
                     '0.1 m)'),
            ('velocity', 'Largest velocity of a joint [rad/s] or [m/s] (default: 0.5 rad/s, '
                         '0.1 m/s); at most half of its limit'),
            ('tolerance', 'Largest distance of a measured position at rest from its goal [rad] or '
                          '[m]; an arm with wrong torque constants sags (default: 0.2 rad, '
                          '0.05 m)')):
        group.add_argument(f'--{name}', **options.number(None, 'X', text))
    options.add_node(group)


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    if arguments.move:
        return _move(arguments, argv)
    if not arguments.bags or arguments.urdf is None:
        raise InvalidInputError('expected BAG and --urdf, or --move')
    if arguments.preview or arguments.with_weight_after:
        raise InvalidInputError('expected --move with --preview and with --with-weight-after')
    loads(arguments)  # report a mistake before the recordings are read
    prepare_outputs(arguments)
    return finish(
        arguments, argv, find_recordings(arguments.bags),
        find_recordings(arguments.with_weight) if arguments.with_weight else [])


def _move(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    """Move the arm and record; then calibrate from the recordings."""
    require_ros('calibrate_gravity --move')
    from robot_dynamics_tools.gravity_motion.session import MotionRequest, record_holds
    if arguments.bags or arguments.with_weight:
        raise InvalidInputError(
            'recordings are given with --move, expected none: --move makes them')
    if not arguments.preview:
        prepare_outputs(arguments)
    if arguments.poses is not None and not arguments.poses.is_file():
        raise InvalidInputError(f'--poses is {str(arguments.poses)!r}, expected a YAML file')
    weight, _ = loads(arguments)
    first = arguments.recording or Path(f'gravity-{datetime.now():%Y%m%d-%H%M%S}')
    request = MotionRequest(
        [first] if weight is None else [first, first.with_name(f'{first.name}-with-weight')],
        PoseChoice(arguments.poses, arguments.count, arguments.seed, arguments.ranges),
        MotionSettings(
            arguments.hold, arguments.approach, arguments.step, arguments.velocity,
            arguments.tolerance),
        weight, arguments.node, arguments.timeout,
        None if arguments.urdf is None else options.read_robot(arguments.urdf),
        options.read_parameters(arguments.parameters), arguments.yes, arguments.preview)
    arguments.topic = record_holds(request)
    if arguments.topic is None:
        return command_line.DONE
    print('Recorded: ' + ', '.join(map(str, request.outputs)) + '\n', flush=True)
    return finish(arguments, argv, request.outputs[:1], request.outputs[1:])


def prepare_outputs(arguments: argparse.Namespace) -> None:
    """Make the directory of the output files; raise InvalidInputError if a file exists."""
    for path in (arguments.output, arguments.output.with_suffix(REPORT)):
        command_line.prepare_file(path, arguments.force)


def loads(arguments: argparse.Namespace) -> tuple[Payload | None, Tool | None]:
    """Return the known weight and the tool; raise InvalidInputError if options are missing."""
    weight = tool = None
    given = [arguments.weight_mass is not None, arguments.weight_link is not None]
    is_used = bool(arguments.with_weight) or arguments.with_weight_after
    if given != 2 * [is_used]:
        option = '--with-weight-after' if arguments.move else '--with-weight'
        raise InvalidInputError(
            f'expected {option}, --weight-mass and --weight-link together, or none of them')
    if is_used:
        check_scalar(
            '--weight-mass', arguments.weight_mass, 0.0, LARGEST_VALUE, exclusive_minimum=True)
        weight = make_payload(
            arguments.weight_link, arguments.weight_mass, arguments.weight_position)
    if arguments.tool_link is not None:
        if arguments.tool_mass is not None:
            check_scalar('--tool-mass', arguments.tool_mass, 0.0, LARGEST_VALUE)
        tool = Tool(arguments.tool_link, arguments.tool_mass)
    elif arguments.tool_mass is not None:
        raise InvalidInputError('--tool-mass is given, expected --tool-link with it')
    if tool is not None and tool.mass is None and weight is None:
        raise InvalidInputError(
            '--tool-link is given without --tool-mass, expected it, or --with-weight: effort '
            'scale and mass are confounded')
    return weight, tool


def finish(
    arguments: argparse.Namespace, argv: Sequence[str] | None, bags: Sequence[Path],
    weighted_bags: Sequence[Path],
) -> int:
    """Calibrate from recordings, write the files, print the results; return the exit status."""
    weight, tool = loads(arguments)
    found = recorded_holds.calibrate_recordings(
        bags, options.read_settings(arguments), weighted_bags, weight, tool)
    origin = command_line.origin_of('calibrate_gravity', argv, arguments.urdf, '')
    written = [arguments.output.with_suffix(REPORT)]
    command_line.write_file(written[0], report.calibration_page(found, origin))
    is_good = all(report.is_accepted(one) for one in (found.calibration, found.command) if one)
    if is_good:
        given = '' if arguments.parameters is None else arguments.parameters.read_text(
            encoding='utf-8')
        command_line.write_file(arguments.output, calibrated_file(
            given, found.calibration, header(found, arguments.output), found.command))
        written.insert(0, arguments.output)
    _print(found, written)
    if not is_good:
        print(f'calibrate_gravity: {arguments.output} is not written, because the nodes would not '
              'accept all values', file=sys.stderr)
    return command_line.DONE if is_good else command_line.FAILED


def _print(found: recorded_holds.RecordedCalibration, written: Sequence[Path]) -> None:
    verdicts = report.joint_verdicts(found.calibration)
    print(text_table([], report.fact_rows(found)))
    for words, one in (('measured', found.calibration), ('commanded', found.command)):
        if one is not None:
            print(f'\nTorque at the joint = effort scale · ({words} effort − effort offset):')
            print(quantity_table(report.joint_rows(one)))
    if found.calibration.tool is not None:
        print('\n' + quantity_table(report.tool_rows(found.calibration.tool)))
    print('\n' + summary(verdicts, 'joints'))
    for name, grade, text, step in verdicts:
        print(f'  {name}: {grade.value[0]}: {text}. Next step: {step}')
    print('\nWritten:\n' + '\n'.join(f'  {path}' for path in written))
    for note in filter(None, (found.mount, *report.notes(found.calibration))):
        print(note)
