# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The findings of the checks of a model, and the names of the checks."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from robot_dynamics.exceptions import ModelError

ERROR, WARNING = 'error', 'warning'

CHECKS = {
    'mass': 'masses that are not positive, or tiny; joints that move no mass',
    'inertia': 'inertia tensors that are not positive definite',
    'triangle_inequality': 'principal moments of inertia that no body can have',
    'radius_of_gyration': 'mass further from its center than the geometry of the link reaches',
    'density': 'masses that are too large or too small for the volume of the geometry',
    'lost_mass': 'links whose mass is missing, or is not read',
    'limits': 'joints without a position, velocity or effort limit',
    'gravity_capability': 'effort limits that cannot hold gravity somewhere',
    'friction': 'dry friction beyond the effort limit',
    'rotors': 'joints whose inertia lacks the rotor of the drive',
    'condition': 'the condition number of M(q)',
}
"""The name of every check, which is stable, and its subject."""


@dataclass(frozen=True)
class Finding:
    """
    One error or suspicious property (warning) of a model.

    `check` is one of `CHECKS`, `where` the link or joint, or '' for the whole arm.
    """

    check: str
    level: str
    where: str
    message: str

    def __str__(self) -> str:
        return f'{self.check}: {self.message}'


def errors_of(findings: Iterable[Finding], ignored: Collection[str] = ()) -> list[Finding]:
    """Return the errors of the checks that are not ignored."""
    return [finding for finding in findings
            if finding.level == ERROR and finding.check not in ignored]


def refuse_errors(findings: Iterable[Finding], ignored: Collection[str] = ()) -> None:
    """Raise ModelError with the first error of a check that is not ignored."""
    errors = errors_of(findings, ignored)
    if errors:
        more = f' ({len(errors) - 1} more)' if len(errors) > 1 else ''
        raise ModelError(
            f'robot_description: model check {errors[0]}{more}; '
            f'ignore_checks: [{errors[0].check}] accepts it')
