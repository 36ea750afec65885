# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of the bodies of a URDF, link by link: mass, inertia, and both against the geometry.

Source: S. Traversaro et al., *Identification of fully physical consistent inertial parameters
using optimization on manifolds*, IROS 2016, section II: a rigid body has a positive mass, and
principal moments of inertia that are positive and obey the triangle inequality.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model_check.finding import ERROR, Finding, WARNING
from robot_dynamics.urdf.inertials import LinkBody

TINY_MASS = 1e-6
"""Mass [kg] below which a mass is a placeholder."""
EIGENVALUE_TOLERANCE = 1e-6
"""Fraction of the largest moment by which a moment may be negative, because of rounding."""
ZERO_INERTIA = 1e-12
"""Moment [kg·m²] up to which a moment counts as 0."""
TRIANGLE_TOLERANCE = 0.01
"""Fraction of the largest moment by which it may exceed the sum of the others (rounding)."""
RADIUS_MARGIN = 1.1
"""Factor by which a radius of gyration may exceed the geometry, which is often simplified."""
BARE_RADIUS_MARGIN = 2.0
"""The same factor if only joints determine the size of a link."""
COM_MARGIN = 0.25
"""Fraction of the diagonal of the geometry by which a center of mass may be outside."""
_AXES = 'xyz'


def check_masses(bodies: Iterable[LinkBody]) -> Iterator[Finding]:
    """Yield the links with an `<inertial>` whose mass is negative, zero or tiny."""
    for body in bodies:
        if body.mass is None or body.mass >= TINY_MASS:
            continue
        level, expected = (ERROR, 'a positive number') if body.mass < 0.0 else (
            WARNING, f'at least {TINY_MASS:g} kg, or no <inertial> for a massless frame')
        yield Finding(
            'mass', level, body.name,
            f'mass of link {body.name!r} is {body.mass:g} kg, expected {expected}')


def check_inertias(bodies: Iterable[LinkBody]) -> Iterator[Finding]:
    """
    Yield the links whose inertia tensor is physically inconsistent.

    A negative moment is an error, because M(q) may become indefinite. A point mass, or moments
    that violate the triangle inequality, leave M(q) positive definite and are warnings.
    """
    for body in bodies:
        if body.mass is None or not np.isfinite(body.inertia).all():
            continue
        where = f'link {body.name!r}'
        moments = np.asarray(np.linalg.eigvalsh(body.inertia))
        words = ', '.join(f'{moment:.4g}' for moment in moments)
        largest = float(np.abs(moments).max())
        excess = moments[2] - moments[0] - moments[1]
        if largest <= ZERO_INERTIA:
            if body.mass >= TINY_MASS:
                yield Finding(
                    'inertia', WARNING, body.name,
                    f'inertia of {where} is zero with {body.mass:g} kg, a point mass, expected '
                    'positive moments')
        elif moments[0] < -EIGENVALUE_TOLERANCE * largest:
            yield Finding(
                'inertia', ERROR, body.name,
                f'principal moments of inertia of {where} are ({words}) kg·m², expected none '
                'below 0')
        elif excess > TRIANGLE_TOLERANCE * moments[2]:
            yield Finding(
                'triangle_inequality', WARNING, body.name,
                f'principal moments of inertia of {where} are ({words}) kg·m², expected the '
                f'largest to be at most the sum of the others, {moments[0] + moments[1]:.4g}')


def check_extents(
    bodies: Iterable[LinkBody], joint_origins: Mapping[str, Sequence[FloatArray]],
) -> Iterator[Finding]:
    """
    Yield the links whose mass distribution is inconsistent with their geometry.

    With k_a² = I_a / m about an axis a through the center of mass, no radius of gyration k_a is
    larger than the distance from that axis to the furthest point of the body. The size of a link
    without geometry is that of its `joint_origins` in its frame; a link whose geometry could not
    be read is skipped.
    """
    for body in bodies:
        if body.mass is None or body.mass < TINY_MASS:
            continue
        if not body.has_geometry:
            yield from _against_joints(body, joint_origins.get(body.name, ()))
        elif body.corners is not None:
            yield from _against_geometry(body, body.corners)


def check_lost_masses(bodies: Iterable[LinkBody]) -> Iterator[Finding]:
    """Yield the links with geometry and no `<inertial>`, or with more than one."""
    for body in bodies:
        if body.inertials > 1:
            yield Finding(
                'lost_mass', WARNING, body.name,
                f'link {body.name!r} has {body.inertials} <inertial> elements, of which only the '
                'first is read, expected one')
        elif body.inertials == 0 and body.has_geometry:
            yield Finding(
                'lost_mass', WARNING, body.name,
                f'link {body.name!r} has geometry but no <inertial>, so that its mass is 0, '
                'expected one')


def _against_geometry(body: LinkBody, corners: FloatArray) -> Iterator[Finding]:
    low, high = corners.min(axis=0), corners.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    outside = float(np.linalg.norm(body.com - np.clip(body.com, low, high)))
    if outside > COM_MARGIN * diagonal:
        yield Finding(
            'radius_of_gyration', WARNING, body.name,
            f'center of mass of link {body.name!r} is {outside:.3g} m outside its geometry, '
            f'whose diagonal is {diagonal:.3g} m, expected it inside')
    arms = corners - body.com
    reach = np.sqrt([np.delete(arms**2, axis, axis=1).sum(axis=1).max() for axis in range(3)])
    radius = radii_of_gyration(body)
    worst = int(np.argmax(radius - RADIUS_MARGIN * reach))
    if radius[worst] > RADIUS_MARGIN * reach[worst]:
        yield Finding(
            'radius_of_gyration', WARNING, body.name,
            f'radius of gyration of link {body.name!r} about its {_AXES[worst]} axis is '
            f'{radius[worst]:.3g} m, expected at most {reach[worst]:.3g} m, the largest distance '
            'of its geometry from this axis')


def _against_joints(body: LinkBody, origins: Sequence[FloatArray]) -> Iterator[Finding]:
    points = np.array([body.com, np.zeros(3), *origins])
    size = float(np.linalg.norm(points[:, None] - points, axis=2).max())
    radius = float(radii_of_gyration(body).max())
    if size == 0.0 or radius <= BARE_RADIUS_MARGIN * size:
        return
    yield Finding(
        'radius_of_gyration', WARNING, body.name,
        f'radius of gyration of link {body.name!r}, which has no geometry, is {radius:.3g} m, '
        f'expected at most {BARE_RADIUS_MARGIN:g} times {size:.3g} m, the largest distance '
        'between its joints and its center of mass')


def radii_of_gyration(body: LinkBody) -> FloatArray:
    """Return √(I_a / m) (3,) [m] about the axes of the link through its center of mass."""
    moments = np.maximum(np.diag(body.inertia), 0.0)
    return np.asarray(np.sqrt(moments / body.mass))
