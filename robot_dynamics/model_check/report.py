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

"""The findings in a URDF, as text and as data."""

from collections.abc import Sequence
import textwrap

from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.finding import ERROR, errors_of, Finding, WARNING
from robot_dynamics.model_check.mesh_bounds import MeshReader

_WIDTH = 110


def findings_of(
    xml: str, joints: Sequence[str], meshes: MeshReader | None = None,
) -> list[Finding]:
    """Return the findings in a URDF; raise RobotDynamicsError if it cannot be used at all."""
    try:
        arm = load_arm(xml, joints)
    except InvalidInputError:
        raise
    except ModelError:
        arm = None  # a negative mass is a finding; check_model raises all other errors
    return check_model(xml, arm, meshes=meshes)


def joint_names_of(xml: str, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the joints of the arm in a URDF, none if a finding prevents its creation."""
    try:
        return load_arm(xml, joints).joint_names
    except ModelError:
        return ()


def findings_as_data(
    findings: Sequence[Finding], ignored: Sequence[str], unread: Sequence[str] = (),
) -> dict[str, object]:
    """Return findings as types of JSON."""
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
            f'Links not compared with their geometry, which could not be read: {len(unread)}')
    count = len(errors_of(findings, ignored))
    verdict = f'{count} error{"" if count == 1 else "s"}' if count else (
        'accepted, as the errors are ignored' if errors_of(findings) else 'no errors')
    return '\n'.join([*lines, f'{where}: {verdict}'])


def _rows(finding: Finding, ignored: Sequence[str]) -> list[str]:
    """Return the name of the check, followed by its message in wrapped lines."""
    note = ' (ignored)' if finding.level == ERROR and finding.check in ignored else ''
    message = textwrap.wrap(
        finding.message + note, _WIDTH - 24, break_long_words=False, break_on_hyphens=False)
    return [f'  {name:20}  {text}' for name, text in zip(
        [finding.check, *[''] * (len(message) - 1)], message)]
