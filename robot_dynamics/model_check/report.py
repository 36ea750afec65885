# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The findings in a URDF with the scope of their checks, as text, data and HTML report."""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import asdict
import textwrap
from typing import NamedTuple

from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.worst_gravity import Search, THOROUGH
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.model_check.finding import CHECKS, ERROR, errors_of, Finding, WARNING
from robot_dynamics.model_check.html_page import Grade, Origin, Page, Verdict
from robot_dynamics.urdf.inertials import MeshBounds, read_bodies

_WIDTH = 110


class CheckedModel(NamedTuple):
    """
    The findings in a URDF, and what the checks cover.

    `joint_names` are the joints of the arm, none if a finding prevents its creation. `unread` are
    the links with mass whose geometry was not read, so that it was not compared.
    """

    findings: Sequence[Finding]
    unread: Sequence[str]
    reads_meshes: bool
    search: Search
    joint_names: Sequence[str]

    def of_level(self, level: str) -> list[Finding]:
        """Return the findings of a level."""
        return [finding for finding in self.findings if finding.level == level]

    @property
    def counts(self) -> str:
        """The numbers of errors and warnings as text."""
        return ', '.join(
            _count(len(self.of_level(level)), level) for level in (ERROR, WARNING))

    @property
    def scope(self) -> str:
        """What the checks cover, and which program covers more or less, as text."""
        not_compared = f' (not compared: {_count(len(self.unread), "link")})'
        geometry = 'links compared with their shapes ' + (
            'and meshes' if self.reads_meshes else 'only, meshes are not read') + (
            not_compared if self.unread else '')
        other = (
            'The check of dynamics_node reads meshes of installed packages only and tries fewer '
            'positions: it may report fewer warnings.') if self.reads_meshes else (
            f'The tool check_model also reads meshes and tries {THOROUGH.samples} positions: it '
            'may report more warnings.')
        return (
            f'{geometry}; largest gravity torque searched from {self.search.samples} positions. '
            f'{other}')


def check_description(
    xml: str, joints: Sequence[str] = (), arm: ArmModel | None = None,
    search: Search = THOROUGH, meshes: MeshBounds | None = None,
) -> CheckedModel:
    """
    Return the findings in a URDF, for `arm`, or for an arm with these joints.

    Without `meshes`, meshes are not read. Raises RobotDynamicsError if the URDF cannot be used at
    all.
    """
    if arm is None:
        with suppress(ModelError):  # a negative mass is a finding; check_model raises the others
            arm = arm_from_urdf(xml, joints)
    findings = check_model(xml, arm, search=search, meshes=meshes)
    unread = [body.name for body in read_bodies(xml, meshes)
              if body.mass is not None and body.has_geometry and body.corners is None]
    return CheckedModel(
        findings, unread, meshes is not None, search, () if arm is None else arm.joint_names)


def findings_as_data(checked: CheckedModel, ignored: Sequence[str]) -> dict[str, object]:
    """Return findings and their scope as types of JSON."""
    return {
        'findings': [
            {**asdict(finding), 'ignored': finding.check in ignored}
            for finding in checked.findings],
        'links_with_unread_geometry': list(checked.unread),
        'scope': checked.scope}


def findings_report(where: object, checked: CheckedModel, ignored: Sequence[str]) -> str:
    """Return findings in lines, with a verdict on `where` they were found as the last one."""
    lines = []
    for level, title in ((ERROR, 'Errors'), (WARNING, 'Warnings')):
        of_level = checked.of_level(level)
        lines += [f'{title}: {len(of_level)}']
        lines += [row for finding in of_level for row in _rows(finding, ignored)]
        lines += [''] if of_level else []
    lines += textwrap.wrap(f'Scope: {checked.scope}', _WIDTH)
    count = len(errors_of(checked.findings, ignored))
    verdict = _count(count, 'error') if count else (
        'accepted, as the errors are ignored' if errors_of(checked.findings) else 'no errors')
    return '\n'.join([*lines, f'{where}: {verdict}'])


def _count(number: int, name: str) -> str:
    return f'{number} {name}{"" if number == 1 else "s"}'


def _rows(finding: Finding, ignored: Sequence[str]) -> list[str]:
    """Return the name of the check, followed by its message in wrapped lines."""
    return textwrap.wrap(
        finding.message + _note(finding, ignored), _WIDTH,
        initial_indent=f'  {finding.check:20}  ', subsequent_indent=' ' * 24,
        break_long_words=False, break_on_hyphens=False)


def _note(finding: Finding, ignored: Collection[str]) -> str:
    return ' (ignored)' if finding.level == ERROR and finding.check in ignored else ''


WHOLE = 'whole arm'
_INERTIAL = 'correct <inertial> of the link, for example with a new export from CAD'
NEXT_STEPS = {
    'mass': 'correct the mass; remove <inertial> if the link is a massless frame',
    'inertia': _INERTIAL,
    'triangle_inequality': _INERTIAL,
    'radius_of_gyration': 'check the units and the origin of <inertial>',
    'density': 'check value and unit of <mass>, and the size and scale of the geometry',
    'lost_mass': 'add <inertial> with mass and inertia to the link, or remove its mass',
    'limits': 'add the limit from the data sheet to <limit>',
    'gravity_capability': 'check masses and effort limits; `torque_map workspace` shows where',
    'friction': 'check friction and effort limit; `identify` needs motion in both directions',
    'rotors': 'set `actuator.reflected_inertia` from the data sheet or with `identify`',
    'condition': 'check the masses and inertias along the chain for errors of unit',
}
"""The next step after a finding, by its check."""
RULE = ('Rule: bad for an error, with which dynamics_node rejects the model; check for a warning '
        'or an ignored error; good without findings.')


def findings_page(
    title: str, checked: CheckedModel, ignored: Collection[str], origin: Origin,
) -> str:
    """Return the report of the findings."""
    page = Page(
        title, model_verdicts(checked, ignored), RULE, origin,
        subject='joints, links and the whole arm')
    page.section('Findings')
    if checked.findings:
        page.table([('check', 'level', 'message'), *(
            (finding.check, finding.level + _note(finding, ignored), finding.message)
            for finding in checked.findings)], kind='text')
    else:
        page.text('None.')
    if checked.unread:
        page.section('Links not compared with their geometry, which could not be read')
        page.items(checked.unread)
    page.section('Checks')
    page.table(list(CHECKS.items()), has_head=False, kind='text')
    return page.html()


def model_verdicts(checked: CheckedModel, ignored: Collection[str]) -> list[Verdict]:
    """Return the verdicts on all joints, on links with findings, and on the whole arm."""
    places = dict.fromkeys([
        *checked.joint_names, *(found.where for found in checked.findings if found.where), ''])
    return [
        _verdict(place, [found for found in checked.findings if found.where == place], ignored)
        for place in places]


def _verdict(place: str, findings: Sequence[Finding], ignored: Collection[str]) -> Verdict:
    name = place or WHOLE
    if not findings:
        return Verdict(name, Grade.GOOD, 'no findings', 'use the model')
    grade = Grade.BAD if errors_of(findings, ignored) else Grade.CHECK
    steps = dict.fromkeys(NEXT_STEPS[finding.check] for finding in findings)
    return Verdict(
        name, grade, '; '.join(finding.message for finding in findings), '; '.join(steps))
