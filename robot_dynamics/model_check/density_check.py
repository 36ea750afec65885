# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Density of a link: its mass divided by the volume of its geometry.

The volume is an upper bound: boxes, cylinders, capsules and spheres count exactly, a mesh counts
as its bounding box, and overlapping shapes count more than once. The bounds of the density are
those of solid materials (W. M. Haynes, *CRC Handbook of Chemistry and Physics*, 97th edition,
2016: lead 11,340 kg/m³, steel about 7,850, aluminium 2,700), and of the robots in the table of
docs/model_check.md. Drives may extend beyond the mesh of a small link, but a large link consists
of air for the most part: the densest link of these robots from `LARGE_VOLUME` on has 1,811 kg/m³.
"""

from collections.abc import Iterable, Iterator
import math

from robot_dynamics.model_check.body_checks import TINY_MASS
from robot_dynamics.model_check.finding import Finding, WARNING
from robot_dynamics.urdf.inertials import LinkBody

LEAST_DENSITY = 30.0
"""Density [kg/m³] below which a link is lighter than packaging foam."""
LARGEST_DENSITY = 12_000.0
"""Density [kg/m³] above that of lead."""
LARGEST_DENSITY_OF_LARGE = 4_000.0
"""Density [kg/m³] that no link from `LARGE_VOLUME` on reaches."""
LARGE_VOLUME = 1e-3
"""[m³]"""
LEAST_VOLUME_OF_LIGHT = 1e-4
"""Volume [m³] below which a low density is no finding: at most 0.1 kg of water are missing."""
LEAST_VOLUME_OF_DENSE = 1e-5
"""Volume [m³] below which a high density is no finding: the shape only marks a place."""


def check_densities(bodies: Iterable[LinkBody]) -> Iterator[Finding]:
    """
    Yield the links whose density is too high or too low for a body.

    If a link has collision and visual shapes, a high density is that of the larger volume, and a
    low one that of the smaller volume, which must both be known: a collision shape may be far
    larger than the body. Links without a known volume, and placeholder masses, are skipped.
    """
    for body in bodies:
        volumes = [volume for volume in body.volumes if 0.0 < volume < math.inf]
        if body.mass is None or body.mass < TINY_MASS or not volumes:
            continue
        least, largest = min(volumes), max(volumes)
        bound = LARGEST_DENSITY if largest < LARGE_VOLUME else LARGEST_DENSITY_OF_LARGE
        is_complete = len(volumes) == len(body.volumes)
        if largest >= LEAST_VOLUME_OF_DENSE and body.mass > bound * largest:
            yield _finding(body.name, body.mass, largest, bound)
        elif is_complete and least >= LEAST_VOLUME_OF_LIGHT and body.mass < LEAST_DENSITY * least:
            yield _finding(body.name, body.mass, least, bound)


def _finding(name: str, mass: float, volume: float, bound: float) -> Finding:
    return Finding(
        'density', WARNING, name,
        f'density of link {name!r} is {mass / volume:.3g} kg/m³: {mass:.4g} kg in at most '
        f'{1e3 * volume:.3g} litres of geometry, expected {LEAST_DENSITY:g} to {bound:g} kg/m³; '
        'check value and unit of its <mass>, and the size and scale of its geometry')
