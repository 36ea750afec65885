# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Check the model in a URDF: masses, inertias, limits, gravity, and the condition of M(q)."""

import argparse
from collections.abc import Sequence
from functools import partial
import json
from pathlib import Path
import sys
import textwrap

from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.body_checks import unmeasured
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.finding import CHECKS, ERROR, errors_of, Finding, WARNING
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.tools.command_line import DONE, FAILED, MISTAKE, Parser, run_tool
from robot_dynamics.urdf.description_file import read_description
from robot_dynamics.urdf.inertials import read_bodies

_WIDTH = 110


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the tool, and return its exit status.

    0: no error is left; 1: errors; 2: the file or the arguments cannot be used, which one line on
    stderr explains.
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.urdf is None:
        parser.print_help(sys.stderr)
        return MISTAKE
    return run_tool('check_model', partial(_run, arguments))


def _parser() -> Parser:
    parser = Parser(
        prog='check_model',
        description='Check the model in a URDF before trusting what is computed with it.\n'
                    'Errors are what dynamics_node refuses; warnings are suspicious.',
        epilog='checks:\n' + '\n'.join(f'  {name:20} {what}' for name, what in CHECKS.items())
               + '\n\nexit status: 0 no errors, 1 errors, 2 the file or arguments cannot be used')
    parser.add_argument(
        'urdf', nargs='?', type=Path, metavar='URDF',
        help='a file; .xacro is expanded where xacro is installed')
    parser.add_argument(
        '--ignore', nargs='+', default=[], metavar='NAME', choices=tuple(CHECKS),
        help='checks whose errors do not count')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='the actuated joints, as the parameter joints (default: all); the rest is locked')
    parser.add_argument('--json', action='store_true', help='write the findings as JSON')
    return parser


def _run(arguments: argparse.Namespace) -> int:
    xml = read_description(arguments.urdf, 'URDF')
    meshes = MeshReader(arguments.urdf.parent)
    findings = findings_of(xml, arguments.joints, meshes)
    unread = list(unmeasured(read_bodies(xml, meshes)))
    if arguments.json:
        print(json.dumps(findings_as_data(findings, arguments.ignore, unread), indent=2))
    else:
        print(findings_report(arguments.urdf, findings, arguments.ignore, unread))
    return FAILED if errors_of(findings, arguments.ignore) else DONE


def findings_of(
    xml: str, joints: Sequence[str], meshes: MeshReader | None = None,
) -> list[Finding]:
    """Return what is found in a URDF; raise RobotDynamicsError where it cannot be used at all."""
    try:
        arm = load_arm(xml, joints)
    except InvalidInputError:
        raise
    except ModelError:
        arm = None  # a negative mass is a finding; check_model raises whatever else it is
    return check_model(xml, arm, meshes=meshes)


def findings_as_data(
    findings: Sequence[Finding], ignored: Sequence[str], unread: Sequence[str] = (),
) -> dict[str, object]:
    """Return findings as what JSON is written of."""
    return {
        'findings': [
            {'check': finding.check, 'level': finding.level, 'where': finding.where,
             'message': finding.message, 'ignored': finding.check in ignored}
            for finding in findings],
        'links_with_unread_geometry': list(unread)}


def findings_report(
    where: object, findings: Sequence[Finding], ignored: Sequence[str],
    unread: Sequence[str] = (),
) -> str:
    """Return findings in lines, with a verdict on `where` they were found as the last one."""
    lines = []
    for level, title in ((ERROR, 'Errors'), (WARNING, 'Warnings')):
        of_level = [finding for finding in findings if finding.level == level]
        lines += [f'{title}: {len(of_level)}']
        lines += [row for finding in of_level for row in _rows(finding, ignored)]
        lines += [''] if of_level else []
    if unread:
        lines.append(
            f'Links whose geometry could not be read, and so was not compared: {len(unread)}')
    count = len(errors_of(findings, ignored))
    verdict = f'{count} error{"" if count == 1 else "s"}' if count else (
        'accepted, as the errors are ignored' if errors_of(findings) else 'no errors')
    return '\n'.join([*lines, f'{where}: {verdict}'])


def _rows(finding: Finding, ignored: Sequence[str]) -> list[str]:
    """Return the check, and its message in lines beside it."""
    note = ' (ignored)' if finding.level == ERROR and finding.check in ignored else ''
    message = textwrap.wrap(
        finding.message + note, _WIDTH - 24, break_long_words=False, break_on_hyphens=False)
    return [f'  {name:20}  {text}' for name, text in zip(
        [finding.check, *[''] * (len(message) - 1)], message)]


if __name__ == '__main__':
    sys.exit(main())
