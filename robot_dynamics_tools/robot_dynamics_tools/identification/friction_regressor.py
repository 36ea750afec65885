# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The columns of a regression that belong to a single joint: rotor, friction, offset of the effort.

The model is linear in its parameters for fixed widths and distances. Many candidate columns can
therefore be computed together, from which the data select a structure: the width of the sigmoid,
the presliding distance of Coulomb friction, and whether friction grows with the load
(`friction_terms`). A column is the friction with one parameter of 1. The offset F_b is the effort
of the drive at zero torque (`effort_calibration`).

Which friction parameters a recording separates depends on its motion. In one direction, dry
friction and the offset F_b are the same constant; at one speed, viscous and dry friction are
proportional. Near rest, dry friction has any value up to static friction, so that samples near
rest separate nothing. The separation therefore follows from the moving samples only: from the
smallest eigenvalue of the normalized Gram matrix of the columns q̇, sgn q̇ and 1. A parameter that
cannot be separated is left out of the model.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.joints import friction_terms
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.joints.parameter_field import ParameterField
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model.effort_deviation import EFFORT_OFFSET
from robot_dynamics_tools.analysis.motion_filter import FilteredMotion

OFFSET_EFFORT = 'offset'
OFFSET_TERM = friction_terms.FrictionTerm(OFFSET_EFFORT, (ParameterField(
    EFFORT_OFFSET, '[N·m] or [N]', 0.0, -1e6, 1e6, 'Offset {unit} of the effort', 'offset'),))
PRISMATIC_SCALE = 0.1
"""Factor of the candidate widths [rad/s] and distances [rad] for a prismatic joint."""


class Column(NamedTuple):
    """A column of friction: its parameter, and the value of the width, if the term has one."""

    term: friction_terms.FrictionTerm
    parameter: ParameterField
    width: ParameterField | None
    candidate: float

    @property
    def name(self) -> str:
        """The name, such as 'viscous' or 'sigmoid 0.1'."""
        return self.parameter.heading + (f' {self.candidate:g}' if self.width else '')


def columns_of(term: friction_terms.FrictionTerm) -> Iterator[Column]:
    """Yield the columns of a term."""
    width = next((field for field in term.fields if field.candidates), None)
    for parameter in term.fields:
        if parameter.is_estimated:
            for candidate in width.candidates if width else (0.0,):
                yield Column(term, parameter, width, candidate)


FRICTION_COLUMNS = tuple(
    column for term in (*friction_terms.TERMS, OFFSET_TERM) for column in columns_of(term))
INERTIA = 0
PAYLOAD = 1 + len(FRICTION_COLUMNS)
"""The column of the known effort of payloads, which belongs to no friction structure."""
COLUMN_COUNT = PAYLOAD + 1
COLUMN_NAMES = ('reflected inertia', *(column.name for column in FRICTION_COLUMNS), 'payload')


def _where(is_one: Callable[[Column], bool]) -> IntArray:
    return np.array([i for i, column in enumerate(FRICTION_COLUMNS, 1) if is_one(column)])


VISCOUS = _where(lambda column: column.term.kind == friction_terms.VISCOUS_FRICTION)
OFFSET = _where(lambda column: column.term.kind == OFFSET_EFFORT)
SHARP = _where(lambda column: column.term.kind == friction_terms.DRY_FRICTION)
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
    viscous = () if friction_terms.VISCOUS_FRICTION in left_out else VISCOUS.tolist()
    terms = () if friction_terms.DRY_FRICTION in left_out else (
        term for term in friction_terms.TERMS if term.kind == friction_terms.DRY_FRICTION)
    for chosen in product(*map(_choices, terms)):
        dry = [column for columns in chosen for column in columns]
        is_known = OFFSET_EFFORT not in left_out
        if is_known or not np.isin(dry, LOAD).any():
            offset = OFFSET.tolist() if is_known or not dry else ()
            yield FrictionStructure(tuple(sorted((INERTIA, *viscous, *offset, *dry))))


def _choices(term: friction_terms.FrictionTerm) -> list[tuple[int, ...]]:
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


MOVING = 0.1
"""Fraction of the RMS velocity of a joint above which a sample counts as moving."""
LEAST_REVERSED = 0.025
"""Share of the moving samples in the less frequent direction, below which F_b is left out."""
LEAST_EIGENVALUE = 0.01
"""Smallest eigenvalue of the normalized Gram matrix of columns that count as separable."""
LEAST_TRAVEL = 0.01
"""Travel [rad], below which a joint is at rest; for a prismatic joint times `PRISMATIC_SCALE`."""
_V, _SIGN, _ONE = range(3)


@dataclass(frozen=True, eq=False)
class JointExcitation:
    """
    The excitation of n joints by the training samples of recordings.

    `moments` (n, 3, 3) are sums of the products of q̇, sgn q̇ and 1 over moving samples, `travel`
    (n,) is the largest range of the position in a recording, relative to `LEAST_TRAVEL`, and
    `largest_effort` (n,) the largest absolute value of the effort [N·m] or [N].
    """

    moments: FloatArray
    travel: FloatArray
    largest_effort: FloatArray

    @property
    def shares(self) -> FloatArray:
        """The shares of the moving samples that move forward and backward, (n, 2)."""
        mean = self.moments[:, _SIGN, _ONE] / np.maximum(self.moments[:, _ONE, _ONE], 1.0)
        return np.column_stack([0.5 * (1.0 + mean), 0.5 * (1.0 - mean)])

    @property
    def rms_velocity(self) -> FloatArray:
        """The RMS velocity of the moving samples, (n,)."""
        count = np.maximum(self.moments[:, _ONE, _ONE], 1.0)
        return np.asarray(np.sqrt(self.moments[:, _V, _V] / count))

    def left_out(self, joint: int) -> tuple[str, ...]:
        """Return the friction parameters of a joint that the recordings cannot separate."""
        G = self.moments[joint]
        if self.travel[joint] < 1.0 or G[_ONE, _ONE] == 0.0:
            return friction_terms.VISCOUS_FRICTION, friction_terms.DRY_FRICTION
        kept = [_V, _SIGN, _ONE]
        if self.shares[joint].min() < LEAST_REVERSED:
            kept.remove(_ONE)
        if not _is_separable(G, kept):
            kept = [_V, _SIGN] if _is_separable(G, [_V, _SIGN]) else [
                column for column in kept if column != _V]
        return tuple(name for name, column in (
            (friction_terms.VISCOUS_FRICTION, _V), (OFFSET_EFFORT, _ONE))
            if column not in kept)

    def reason(self, joint: int) -> str:
        """Return why the parameters of `left_out` cannot be separated, for a report."""
        forward, backward = self.shares[joint]
        if self.travel[joint] < 1.0 or self.moments[joint, _ONE, _ONE] == 0.0:
            return 'the joint does not move'
        if min(forward, backward) < LEAST_REVERSED:
            return (f'the joint moves in one direction only ({100.0 * forward:.0f} % of its '
                    f'motion forward, {100.0 * backward:.0f} % backward)')
        return 'the joint moves at too few different speeds'


def _is_separable(G: FloatArray, columns: Sequence[int]) -> bool:
    kept = G[np.ix_(columns, columns)]
    norm = np.sqrt(np.diag(kept))
    return bool(np.linalg.eigvalsh(kept / np.outer(norm, norm))[0] >= LEAST_EIGENVALUE)


def excitation_of(motion: FilteredMotion, kinds: Sequence[str], count: int) -> JointExcitation:
    """Return the excitation by the first samples of a motion, with joints of these kinds."""
    v = motion.velocity[:count]
    is_moving = np.abs(v) > MOVING * np.sqrt(np.mean(v**2, axis=0)) if len(v) else v > 0.0
    columns = np.stack([v, np.sign(v), np.ones_like(v)], axis=2) * is_moving[:, :, np.newaxis]
    n = v.shape[1]
    scale = LEAST_TRAVEL * scales_of(kinds)
    travel = np.ptp(motion.position[:count], axis=0) / scale if len(v) else np.zeros(n)
    return JointExcitation(
        np.einsum('mji,mjk->jik', columns, columns), travel,
        np.abs(motion.measured_effort[:count]).max(axis=0, initial=0.0))


def merged_excitation(parts: Sequence[JointExcitation]) -> JointExcitation:
    """Return the excitation of several recordings together."""
    return JointExcitation(
        np.sum([part.moments for part in parts], axis=0),
        np.max([part.travel for part in parts], axis=0),
        np.max([part.largest_effort for part in parts], axis=0))
