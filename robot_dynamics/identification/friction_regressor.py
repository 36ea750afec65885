# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The columns of a regression that belong to a single joint: rotor, friction, drive.

The model is linear in its parameters for fixed widths and distances. Many candidate columns can
therefore be computed together, from which the data select a structure: the width of the sigmoid,
the presliding distance of Coulomb friction, and whether friction grows with the load (`friction`).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import smooth_sign
from robot_dynamics.joints.presliding import presliding_state

SIGMOID_VELOCITIES = (0.01, 0.03, 0.1, 0.3)
"""Widths [rad/s]; for a prismatic joint times `PRISMATIC_SCALE` in [m/s]."""
PRESLIDING_DISTANCES = (0.0, 0.001, 0.003, 0.01, 0.03)
"""
Distances [rad]; for a prismatic joint times `PRISMATIC_SCALE` in [m]. The first one, a sharp sign,
is no candidate, because the sign of a measured velocity is meaningless around rest. It is used for
single states.
"""
PRISMATIC_SCALE = 0.1
INERTIA, VISCOUS, OFFSET = range(3)
VISCOUS_FRICTION, DRY_FRICTION, OFFSET_EFFORT = 'viscous friction', 'dry friction', 'offset'
"""Names of parameters that a recording may be unable to separate."""
_SIGMOID = 3
_LOAD = _SIGMOID + len(SIGMOID_VELOCITIES)
_COULOMB = _LOAD + len(SIGMOID_VELOCITIES)
PAYLOAD = _COULOMB + len(PRESLIDING_DISTANCES)
"""The column of the known effort of payloads, which belongs to no friction structure."""
COLUMN_COUNT = PAYLOAD + 1
SHARP = slice(_SIGMOID, PAYLOAD)
"""The columns that change fast at a velocity reversal."""
LOAD = slice(_LOAD, _COULOMB)
"""The columns of friction that grows with the load."""
COULOMB = slice(_COULOMB, PAYLOAD)
"""The columns of Coulomb friction; the first has no presliding."""


class FrictionStructure(NamedTuple):
    """
    The friction of a joint, in addition to viscous friction, an offset and its rotor.

    `sigmoid` and `coulomb` are indices into SIGMOID_VELOCITIES and PRESLIDING_DISTANCES, or None;
    `load` states whether the sigmoid grows with the load. `viscous` and `offset` are false if the
    recordings cannot separate these terms from dry friction (`joint_excitation`).
    """

    sigmoid: int | None = None
    coulomb: int | None = None
    load: bool = False
    viscous: bool = True
    offset: bool = True

    @property
    def dry_count(self) -> int:
        """The number of columns of dry friction."""
        return (self.sigmoid is not None) + (self.coulomb is not None)

    @property
    def columns(self) -> list[int]:
        """The numbers of the columns of this structure, in ascending order."""
        chosen = [INERTIA]
        chosen += [VISCOUS] if self.viscous else []
        chosen += [OFFSET] if self.offset else []
        if self.sigmoid is not None:
            chosen += [_SIGMOID + self.sigmoid]
            chosen += [_LOAD + self.sigmoid] if self.load else []
        if self.coulomb is not None:
            chosen += [_COULOMB + self.coulomb]
        return chosen

    def __str__(self) -> str:
        parts = ['viscous'] if self.viscous else []
        if self.coulomb is not None:
            parts += [f'Coulomb presliding over {PRESLIDING_DISTANCES[self.coulomb]:g}']
        if self.sigmoid is not None:
            parts += [f'sigmoid of {SIGMOID_VELOCITIES[self.sigmoid]:g}']
        if self.load:
            parts += ['load']
        return ' + '.join(parts) or 'none'


SIMPLEST = FrictionStructure(sigmoid=0)
"""The sign of velocity, except in a narrow band around rest."""


def structures(left_out: Sequence[str] = ()) -> Iterator[FrictionStructure]:
    """
    Yield every candidate structure without the parameters `left_out` (`JointExcitation`).

    If the offset cannot be separated from dry friction, a structure has one of them. Friction that
    grows with the load then has no candidate, because it is as constant as the load.
    """
    every = (structure._replace(viscous=VISCOUS_FRICTION not in left_out)
             for structure in _all_structures())
    if DRY_FRICTION in left_out:
        every = (structure for structure in every if structure.dry_count == 0)
    for structure in every:
        if OFFSET_EFFORT not in left_out:
            yield structure
        elif not structure.load:
            yield structure._replace(offset=structure.dry_count == 0)


def _all_structures() -> Iterator[FrictionStructure]:
    for sigmoid in (None, *range(len(SIGMOID_VELOCITIES))):
        for coulomb in (None, *range(1, len(PRESLIDING_DISTANCES))):
            yield FrictionStructure(sigmoid, coulomb)
            if sigmoid is not None:
                yield FrictionStructure(sigmoid, coulomb, True)


def scale_of(kind: str) -> float:
    """Return the factor of widths and distances for a joint of this kind."""
    return PRISMATIC_SCALE if kind == 'prismatic' else 1.0


def joint_columns(
    kinds: Sequence[str], q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray,
    starts: Sequence[int] = (0,),
) -> FloatArray:
    """
    Return all columns at the m samples of a motion, (m, n, COLUMN_COUNT).

    `load` (m, n) are the joint efforts of the rigid bodies; `starts` are the samples at which a
    stretch without gaps begins.
    """
    m, n = q.shape
    columns = np.empty((m, n, COLUMN_COUNT))
    columns[:, :, INERTIA], columns[:, :, VISCOUS], columns[:, :, OFFSET] = a, v, 1.0
    columns[:, :, PAYLOAD] = 0.0
    scale = np.array([scale_of(kind) for kind in kinds])
    for i, width in enumerate(SIGMOID_VELOCITIES):
        direction = smooth_sign(v, width * scale)
        columns[:, :, _SIGMOID + i] = direction
        columns[:, :, _LOAD + i] = np.abs(load) * direction
    columns[:, :, _COULOMB] = np.sign(v)
    stretches = list(zip(starts, [*starts[1:], m]))
    for i, distance in enumerate(PRESLIDING_DISTANCES):
        for first, last in stretches if distance else ():
            columns[first:last, :, _COULOMB + i] = presliding_state(
                q[first:last], v[first:last], distance * scale)
    return columns


class JointEstimate(NamedTuple):
    """The parameters of one joint's own columns, in SI units; 0 for a column that is not used."""

    reflected_inertia: float
    viscous: float
    offset: float
    sigmoid: float
    sigmoid_velocity: float
    load: float
    coulomb: float
    presliding_distance: float

    @property
    def friction(self) -> dict[str, float]:
        """The parameters of friction, by their names after `friction.`."""
        found = {name: value for name, value in self._asdict().items()
                 if name not in ('reflected_inertia', 'offset')}
        return {**found, 'effort_offset': self.offset}


def joint_estimate(
    structure: FrictionStructure, kind: str, values: Sequence[float],
) -> JointEstimate:
    """Return the parameters for the values of the structure's columns, in their order."""
    found = dict(zip(structure.columns, values))
    scale = scale_of(kind)
    sigmoid = structure.sigmoid
    coulomb = structure.coulomb
    return JointEstimate(
        found[INERTIA], found.get(VISCOUS, 0.0), found.get(OFFSET, 0.0),
        0.0 if sigmoid is None else found[_SIGMOID + sigmoid],
        scale * SIGMOID_VELOCITIES[1 if sigmoid is None else sigmoid],
        found.get(_LOAD + sigmoid, 0.0) if sigmoid is not None else 0.0,
        0.0 if coulomb is None else found[_COULOMB + coulomb],
        0.0 if coulomb is None else scale * PRESLIDING_DISTANCES[coulomb])


COLUMN_NAMES = (
    'reflected inertia', 'viscous', 'offset',
    *(f'sigmoid {width:g}' for width in SIGMOID_VELOCITIES),
    *(f'load {width:g}' for width in SIGMOID_VELOCITIES),
    *(f'Coulomb {distance:g}' for distance in PRESLIDING_DISTANCES), 'payload')
