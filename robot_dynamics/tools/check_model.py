# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Check the model in a URDF: masses, inertias, limits, gravity, and the condition of M(q)."""

import argparse
from collections.abc import Sequence
from functools import partial
import json
from pathlib import Path
import sys

from robot_dynamics.model_check import report
from robot_dynamics.model_check.finding import CHECKS, errors_of
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.tools import command_line
from robot_dynamics.urdf.description_file import description_path, read_description


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the tool, and return its exit status.

    0: no errors; 1: errors; 2: the file or the arguments are invalid. One line on stderr has the
    reason.
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.urdf is None:
        parser.print_help(sys.stderr)
        return command_line.MISTAKE
    return command_line.run_tool('check_model', partial(_run, arguments, argv))


def _parser() -> command_line.Parser:
    parser = command_line.Parser(
        prog='check_model',
        description='Check the model in a URDF before its use.\n'
                    'dynamics_node rejects a model with errors; warnings are suspicious values.',
        epilog='checks:\n' + '\n'.join(f'  {name:20} {what}' for name, what in CHECKS.items())
               + '\n\nexit status: 0 no errors, 1 errors, 2 the file or the arguments are invalid')
    parser.add_argument(
        'urdf', nargs='?', metavar='URDF',
        help=f'{command_line.ROBOT_HELP}; a .xacro file is expanded if xacro is installed')
    parser.add_argument(
        '--ignore', nargs='+', default=[], metavar='NAME', choices=tuple(CHECKS),
        help='Names of checks whose errors are ignored')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='Actuated joints, like the parameter joints (default: all); the others are locked')
    parser.add_argument(
        '--report', type=Path, metavar='FILE',
        help='HTML file with a verdict and a next step per joint and link, to write')
    command_line.add_force(parser)
    parser.add_argument('--json', action='store_true', help='Print the findings as JSON')
    return parser


def _run(arguments: argparse.Namespace, argv: Sequence[str] | None) -> int:
    path = description_path(arguments.urdf, 'URDF')
    xml = read_description(path, 'URDF')
    meshes = MeshReader(path.parent)
    if arguments.report is not None:
        command_line.prepare_file(arguments.report, arguments.force)
    checked = report.check_description(xml, arguments.joints, meshes=meshes)
    if arguments.report is not None:
        text = report.findings_page(
            f'{path.name}: model check', checked, arguments.ignore,
            command_line.origin_of('check_model', argv, arguments.urdf, ''))
        command_line.write_file(arguments.report, text)
    if arguments.json:
        print(json.dumps(report.findings_as_data(checked, arguments.ignore), indent=2))
    else:
        print(report.findings_report(arguments.urdf, checked, arguments.ignore))
    has_errors = errors_of(checked.findings, arguments.ignore)
    return command_line.FAILED if has_errors else command_line.DONE


if __name__ == '__main__':
    sys.exit(main())
