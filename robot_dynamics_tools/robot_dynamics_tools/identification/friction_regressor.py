# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The columns of a regression that belong to a single joint: rotor, friction, offset of the effort.

The model is linear in its parameters for fixed widths and distances. Many candidate columns can
therefore be computed together, from which the data select a structure: the width of the sigmoid,
the presliding distance of Coulomb friction, and whether friction grows with the load
(`friction_terms`). A column is the friction with one parameter of 1. The offset F_b is the effort
of the drive at zero torque (`effort_calibration`).
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.joints.friction_terms import (
    DRY_FRICTION,
    FrictionTerm,
    TERMS,
    VISCOUS_FRICTION,
)
from robot_dynamics.joints.parameter_field import ParameterField
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model.effort_deviation import EFFORT_OFFSET

OFFSET_EFFORT = 'offset'
OFFSET_TERM = FrictionTerm(OFFSET_EFFORT, (ParameterField(
    EFFORT_OFFSET, '[N·m] or [N]', 0.0, -1e6, 1e6, 'Offset {unit} of the effort', 'offset'),))
PRISMATIC_SCALE = 0.1
"""Factor of the candidate widths [rad/s] and distances [rad] for a prismatic joint."""


class Column(NamedTuple):
    """A column of friction: its parameter, and the value of the width, if the term has one."""

    term: FrictionTerm
    parameter: ParameterField
    width: ParameterField | None
    candidate: float

    @property
    def name(self) -> str:
        """The name, such as 'viscous' or 'sigmoid 0.1'."""
        return self.parameter.heading + (f' {self.candidate:g}' if self.width else '')


def columns_of(term: FrictionTerm) -> Iterator[Column]:
    """Yield the columns of a term."""
    width = next((field for field in term.fields if field.candidates), None)
    for parameter in term.fields:
        if parameter.is_estimated:
            for candidate in width.candidates if width else (0.0,):
                yield Column(term, parameter, width, candidate)


FRICTION_COLUMNS = tuple(column for term in (*TERMS, OFFSET_TERM) for column in columns_of(term))
INERTIA = 0
PAYLOAD = 1 + len(FRICTION_COLUMNS)
"""The column of the known effort of payloads, which belongs to no friction structure."""
COLUMN_COUNT = PAYLOAD + 1
COLUMN_NAMES = ('reflected inertia', *(column.name for column in FRICTION_COLUMNS), 'payload')


def _where(is_one: Callable[[Column], bool]) -> IntArray:
    return np.array([i for i, column in enumerate(FRICTION_COLUMNS, 1) if is_one(column)])


VISCOUS = _where(lambda column: column.term.kind == VISCOUS_FRICTION)
OFFSET = _where(lambda column: column.term.kind == OFFSET_EFFORT)
SHARP = _where(lambda column: column.term.kind == DRY_FRICTION)
"""The columns that change fast at a velocity reversal."""
LOAD = _where(lambda column: not column.parameter.unit)
"""The columns of friction that grows with the load."""
DRY = np.setdiff1d(SHARP, LOAD)
COULOMB = _where(lambda column: column.parameter.name == 'coulomb')
"""The columns of Coulomb friction; the first has no presliding."""


class FrictionStructure(NamedTuple):
    """The friction of a joint with its rotor: the numbers of its columns, in ascending order."""

    columns: tuple[int, ...]

    @property
    def dry_count(self) -> int:
        """The number of columns of dry friction."""
        return int(np.isin(self.columns, DRY).sum())

    def has(self, columns: IntArray) -> bool:
        """Return whether any of these columns is one of this structure."""
        return bool(np.isin(self.columns, columns).any())

    def __str__(self) -> str:
        own = np.setdiff1d(self.columns, [INERTIA, *OFFSET])
        return ' + '.join(COLUMN_NAMES[column] for column in own) or 'none'


def structure(*names: str) -> FrictionStructure:
    """Return the structure of viscous friction, offset and these columns."""
    named = [COLUMN_NAMES.index(name) for name in names]
    return FrictionStructure(tuple(sorted((INERTIA, *VISCOUS.tolist(), *OFFSET.tolist(), *named))))


SIMPLEST = structure('sigmoid 0.01')
"""The sign of velocity, except in a narrow band around rest."""


def structures(left_out: Sequence[str] = ()) -> Iterator[FrictionStructure]:
    """
    Yield every candidate structure without the parameters `left_out` (`JointExcitation`).

    If the offset cannot be separated from dry friction, a structure has one of them. Friction that
    grows with the load then has no candidate, because it is as constant as the load.
    """
    viscous = () if VISCOUS_FRICTION in left_out else VISCOUS.tolist()
    terms = () if DRY_FRICTION in left_out else (
        term for term in TERMS if term.kind == DRY_FRICTION)
    for chosen in product(*map(_choices, terms)):
        dry = [column for columns in chosen for column in columns]
        is_known = OFFSET_EFFORT not in left_out
        if is_known or not np.isin(dry, LOAD).any():
            offset = OFFSET.tolist() if is_known or not dry else ()
            yield FrictionStructure(tuple(sorted((INERTIA, *viscous, *offset, *dry))))


def _choices(term: FrictionTerm) -> list[tuple[int, ...]]:
    """Return the columns of a term by choice: none, or those of one width, with load or not."""
    choices: list[tuple[int, ...]] = [()]
    own = [(i, column) for i, column in enumerate(FRICTION_COLUMNS, 1) if column.term is term]
    for width in dict.fromkeys(
            column.candidate for _, column in own if column.candidate or not column.width):
        columns = [i for i, column in own if column.candidate == width]
        choices.append(tuple(i for i in columns if i not in LOAD))
        if len(choices[-1]) < len(columns):
            choices.append(tuple(columns))
    return choices


def scales_of(kinds: Sequence[str]) -> FloatArray:
    """Return the factors (n,) of widths and distances for joints of these kinds."""
    return np.where([kind == 'prismatic' for kind in kinds], PRISMATIC_SCALE, 1.0)


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
    columns = np.zeros((m, n, COLUMN_COUNT))
    columns[:, :, INERTIA] = a
    stretches = [slice(*ends) for ends in zip(starts, [*starts[1:], m])]
    scale, plain = scales_of(kinds), make_friction(kinds)
    columns[:, :, OFFSET] = 1.0
    for i, column in enumerate(FRICTION_COLUMNS, 1):
        if i in OFFSET:
            continue
        widths = {column.width.name: scale * column.candidate} if column.width else {}
        friction = plain.replaced(**widths).unit(column.parameter.name)
        distance, sign = friction.presliding_distance, np.sign(v)
        for part in stretches if distance.any() else ():
            sign[part] = presliding_state(q[part], v[part], distance)
        columns[:, :, i] = friction.effort(v, load, sign)
    return columns
