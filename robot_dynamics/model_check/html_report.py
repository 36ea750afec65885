# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The HTML report of a model check: a verdict and a next step per joint and link."""

from collections.abc import Collection, Sequence

from robot_dynamics.model_check.finding import CHECKS, ERROR, errors_of, Finding
from robot_dynamics.reporting.html_page import Grade, items, Origin, report_page, table, Verdict

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
    title: str, joint_names: Sequence[str], findings: Sequence[Finding],
    ignored: Collection[str], unread: Sequence[str], origin: Origin,
) -> str:
    """
    Return the report; `unread` are the links whose geometry could not be read.

    `joint_names` are the joints of the arm, none if it cannot be created.
    """
    body = ['<h2>Findings</h2>']
    body += [table([('check', 'level', 'message'), *(
        (finding.check, finding.level + (
            ' (ignored)' if finding.level == ERROR and finding.check in ignored else ''),
         finding.message) for finding in findings)], kind='text')] if findings else [
             '<p>None.</p>']
    if unread:
        body += ['<h2>Links not compared with their geometry, which could not be read</h2>',
                 items(unread)]
    body += ['<h2>Checks</h2>', table(list(CHECKS.items()), has_head=False, kind='text')]
    return report_page(
        title, model_verdicts(joint_names, findings, ignored), RULE, origin, body,
        subject='joints, links and the whole arm')


def model_verdicts(
    joint_names: Sequence[str], findings: Sequence[Finding], ignored: Collection[str] = (),
) -> list[Verdict]:
    """Return the verdicts on all joints, on links with findings, and on the whole arm."""
    places = dict.fromkeys([
        *joint_names, *(finding.where for finding in findings if finding.where), ''])
    return [_verdict(place, [found for found in findings if found.where == place], ignored)
            for place in places]


def _verdict(place: str, findings: Sequence[Finding], ignored: Collection[str]) -> Verdict:
    name = place or WHOLE
    if not findings:
        return Verdict(name, Grade.GOOD, 'no findings', 'use the model')
    grade = Grade.BAD if errors_of(findings, ignored) else Grade.CHECK
    steps = dict.fromkeys(NEXT_STEPS[finding.check] for finding in findings)
    return Verdict(
        name, grade, '; '.join(finding.message for finding in findings), '; '.join(steps))

