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

"""
The columns of a regression that belong to one joint alone: rotor, friction, drive.

They are linear in their parameters once widths and distances are fixed, so that many of them can
be offered side by side, and the data choose a structure: which sigmoid, whether Coulomb friction
has a presliding distance, whether friction grows with the load (`friction`).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction import smooth_sign
from robot_dynamics.joints.presliding import presliding_state

SIGMOID_VELOCITIES = (0.01, 0.03, 0.1, 0.3)
"""[rad/s]; on a prismatic joint `PRISMATIC_SCALE` of it in [m/s]."""
PRESLIDING_DISTANCES = (0.0, 0.001, 0.003, 0.01, 0.03)
"""
[rad]; on a prismatic joint `PRISMATIC_SCALE` of it in [m]. The first, a sharp sign, is not
offered: the sign of a measured velocity says nothing around rest. It is for single states.
"""
PRISMATIC_SCALE = 0.1
INERTIA, VISCOUS, OFFSET = range(3)
_SIGMOID = 3
_LOAD = _SIGMOID + len(SIGMOID_VELOCITIES)
_COULOMB = _LOAD + len(SIGMOID_VELOCITIES)
COLUMN_COUNT = _COULOMB + len(PRESLIDING_DISTANCES)
SHARP = slice(_SIGMOID, COLUMN_COUNT)
"""The columns that change fast where velocity changes its sign."""
COULOMB = slice(_COULOMB, COLUMN_COUNT)
"""The columns of Coulomb friction; the first has no presliding."""


class FrictionStructure(NamedTuple):
    """
    Which friction a joint has, besides viscous friction, an offset and its rotor.

    `sigmoid` and `coulomb` number the entries of SIGMOID_VELOCITIES and PRESLIDING_DISTANCES, or
    are None; `load` says whether the sigmoid grows with the load.
    """

    sigmoid: int | None = None
    coulomb: int | None = None
    load: bool = False

    @property
    def columns(self) -> list[int]:
        """The numbers of the columns that it uses, in ascending order."""
        chosen = [INERTIA, VISCOUS, OFFSET]
        if self.sigmoid is not None:
            chosen += [_SIGMOID + self.sigmoid]
            chosen += [_LOAD + self.sigmoid] if self.load else []
        if self.coulomb is not None:
            chosen += [_COULOMB + self.coulomb]
        return chosen

    def __str__(self) -> str:
        parts = ['viscous']
        if self.coulomb is not None:
            parts += [f'Coulomb presliding over {PRESLIDING_DISTANCES[self.coulomb]:g}']
        if self.sigmoid is not None:
            parts += [f'sigmoid of {SIGMOID_VELOCITIES[self.sigmoid]:g}']
        if self.load:
            parts += ['load']
        return ' + '.join(parts)


SIMPLEST = FrictionStructure(sigmoid=0)
"""The sign of velocity, but for a narrow band around rest."""


def structures() -> Iterator[FrictionStructure]:
    """Yield every structure that is offered to the data."""
    for sigmoid in (None, *range(len(SIGMOID_VELOCITIES))):
        for coulomb in (None, *range(1, len(PRESLIDING_DISTANCES))):
            yield FrictionStructure(sigmoid, coulomb)
            if sigmoid is not None:
                yield FrictionStructure(sigmoid, coulomb, True)


def scale_of(kind: str) -> float:
    """Return what widths and distances are multiplied with on a joint of this kind."""
    return PRISMATIC_SCALE if kind == 'prismatic' else 1.0


def joint_columns(
    kinds: Sequence[str], q: FloatArray, v: FloatArray, a: FloatArray, load: FloatArray,
    starts: Sequence[int] = (0,),
) -> FloatArray:
    """
    Return all columns at the m samples of a motion, (m, n, COLUMN_COUNT).

    `load` (m, n) is what the joints bear of rigid bodies; `starts` are the samples at which a
    stretch without gaps begins.
    """
    m, n = q.shape
    columns = np.empty((m, n, COLUMN_COUNT))
    columns[:, :, INERTIA], columns[:, :, VISCOUS], columns[:, :, OFFSET] = a, v, 1.0
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
    """The parameters of one joint's own columns, in SI units; 0 where there is no such column."""

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
    """Return what the values of the structure's columns, in their order, mean."""
    found = dict(zip(structure.columns, values))
    scale = scale_of(kind)
    sigmoid = structure.sigmoid
    coulomb = structure.coulomb
    return JointEstimate(
        found[INERTIA], found[VISCOUS], found[OFFSET],
        0.0 if sigmoid is None else found[_SIGMOID + sigmoid],
        scale * SIGMOID_VELOCITIES[1 if sigmoid is None else sigmoid],
        found.get(_LOAD + sigmoid, 0.0) if sigmoid is not None else 0.0,
        0.0 if coulomb is None else found[_COULOMB + coulomb],
        0.0 if coulomb is None else scale * PRESLIDING_DISTANCES[coulomb])


COLUMN_NAMES = (
    'reflected inertia', 'viscous', 'offset',
    *(f'sigmoid {width:g}' for width in SIGMOID_VELOCITIES),
    *(f'load {width:g}' for width in SIGMOID_VELOCITIES),
    *(f'Coulomb {distance:g}' for distance in PRESLIDING_DISTANCES))
