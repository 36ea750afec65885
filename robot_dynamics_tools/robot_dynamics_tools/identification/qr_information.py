# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The information of recordings about the parameters, as small matrices that combine exactly.

The rows of a regression [X | y] of m samples can be replaced by the R factor of their QR
decomposition: the sum of squares of X θ − y is the same for every θ. R of [[R₁], [R₂]] is that of
both recordings together. (G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., section
5.3 and 6.5.3.) Any number of recordings of any length, reduced one by one, in any order and on any
computer, therefore give the same estimate as all their samples at once.

Samples for training are split into time-contiguous blocks, each with its own R factor. The gaps
between blocks, as wide as the effect of the filter, also have their own factors: a block that is
omitted for validation then shares no data with the remaining blocks. There is one factor per
joint, so that weights between joints can be chosen afterwards.

A short recording has fewer blocks, down to one. The blocks of several recordings share `BLOCKS`
folds, so that many short recordings are as good as a long one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics_tools.identification.friction_regressor import (
    JointExcitation,
    merged_excitation,
)

BLOCKS = 6
LEAST_BLOCKS = 3
"""Smallest number of blocks of all recordings together."""
_ROUNDING = 1e-20


@dataclass(frozen=True, eq=False)
class QrInformation:
    """
    The information of recordings: one R factor (k, k) per slot and joint, 2 × BLOCKS slots.

    Even slots are blocks, odd slots are the gaps after them; the last gap is before the first
    block, for recordings whose blocks begin at a later slot. `factors` are (slots, n, k, k);
    `rows` (slots,) are their sample counts. The last of the k columns is the effort; `columns` are
    the names of the columns before, the same for every joint. `correlation` (n,) is the number of
    samples per independent sample, summed over the samples of the blocks; it combines by addition.
    `excitation` states which friction parameters the samples can separate. `recorded` is the
    number of samples for training before decimation, `needed` the smallest such number.
    """

    joint_names: tuple[str, ...]
    columns: tuple[str, ...]
    factors: FloatArray
    rows: FloatArray
    correlation: FloatArray
    excitation: JointExcitation
    recorded: int
    needed: int

    @property
    def folds(self) -> tuple[int, ...]:
        """The numbers of the blocks that have samples."""
        return tuple(i for i in range(BLOCKS) if self.rows[2 * i] > 0.0)

    @property
    def samples_per_independent_sample(self) -> FloatArray:
        """The number of samples that count as one independent sample, (n,)."""
        return np.asarray(self.correlation / max(float(self.rows.sum()), 1.0))

    @property
    def rms_effort(self) -> FloatArray:
        """The RMS of the effort without that of payloads, (n,)."""
        power = np.sum(self.factors[..., -1]**2, axis=(0, 2))
        return np.asarray(np.sqrt(power / max(float(self.rows.sum()), 1.0)))

    @property
    def is_measured(self) -> BoolArray:
        """Marks the joints (n,) that have any effort, beyond rounding."""
        power = np.sum(self.factors[..., -1]**2, axis=(0, 2))
        return np.asarray(power > _ROUNDING * max(float(power.max()), 1e-300))

    def all_but(self, block: int) -> FloatArray:
        """Return the factors (n, k, k) of all samples except a block and its adjacent gaps."""
        slots = len(self.factors)
        kept = [i for i in range(slots) if 1 < (i - 2 * block) % slots < slots - 1]
        return stack_factors(self.factors[kept])

    def block(self, block: int) -> FloatArray:
        """Return the factors (n, k, k) of one block."""
        return np.asarray(self.factors[2 * block])

    def together(self) -> FloatArray:
        """Return the factors (n, k, k) of all samples."""
        return stack_factors(self.factors)


def reduce_rows(
    joint_names: Sequence[str], columns: Sequence[str], X: FloatArray, y: FloatArray,
    gap: int, samples_per_independent_sample: FloatArray, excitation: JointExcitation,
    step: int = 1,
) -> QrInformation:
    """
    Return the information in a regression: X (m, n, p) and y (m, n), in the order of time.

    Between blocks are gaps of `gap` samples; `samples_per_independent_sample` (n,) is the number
    of samples that count as one. The rows are every step-th sample of the recording. Raises
    InvalidInputError if there are no samples.
    """
    m, n, p = X.shape
    if m == 0:
        raise InvalidInputError(
            'the recording has no samples for training away from the ends of its stretches, '
            'expected at least one')
    blocks = min(max(m // (2 * (gap + 1)), 1), BLOCKS)
    edges = np.linspace(0, m, blocks + 1).astype(int)[1:-1, np.newaxis]
    ends = (edges - gap // 2 + [0, gap]).ravel().tolist()
    slots = [slice(*bounds) for bounds in zip([0, *ends], [*ends, m])]
    factors, counts = np.zeros((2 * BLOCKS, n, p + 1, p + 1)), np.zeros(2 * BLOCKS)
    for i, rows in enumerate(slots):
        counts[i] = rows.stop - rows.start
        factors[i] = [_factor(np.column_stack([X[rows, j], y[rows, j]])) for j in range(n)]
    return QrInformation(
        tuple(joint_names), tuple(columns), factors, counts, m * samples_per_independent_sample,
        excitation, m * step, LEAST_BLOCKS * 2 * (gap + 1) * step)


def merge(parts: Sequence[QrInformation]) -> QrInformation:
    """
    Return the combined information of several recordings.

    The blocks of recordings with fewer than `BLOCKS` follow each other in the folds. Raises
    InvalidInputError if there are no recordings, if their joints or columns differ, or if they
    have too few samples together.
    """
    if not parts:
        raise InvalidInputError('there is no recording to combine, expected at least one')
    first = parts[0]
    for other in parts[1:]:
        if (other.joint_names, other.columns) != (first.joint_names, first.columns):
            raise InvalidInputError(
                f'recordings of the joints {list(other.joint_names)} and '
                f'{list(first.joint_names)} cannot be combined, expected the same joints and '
                'columns')
    blocks = np.array([len(part.folds) for part in parts])
    starts = np.where(blocks < BLOCKS, np.cumsum(blocks) - blocks, 0) % BLOCKS
    shifts = (2 * starts).tolist()
    slots = np.stack([np.roll(part.factors, shift, axis=0) for part, shift in zip(parts, shifts)])
    merged = QrInformation(
        first.joint_names, first.columns,
        np.stack([stack_factors(slots[:, slot]) for slot in range(slots.shape[1])]),
        np.sum([np.roll(part.rows, shift) for part, shift in zip(parts, shifts)], axis=0),
        np.sum([part.correlation for part in parts], axis=0),
        merged_excitation([part.excitation for part in parts]),
        sum(part.recorded for part in parts), max(part.needed for part in parts))
    if merged.recorded < merged.needed or len(merged.folds) < 2:
        raise InvalidInputError(
            f'the recordings have {merged.recorded} samples for training together, expected at '
            f'least {max(merged.needed, merged.recorded + 1)} at this sampling rate and cut-off')
    return merged


def stack_factors(factors: FloatArray) -> FloatArray:
    """Return the combined factors (n, k, k) of several factors (s, n, k, k)."""
    s, n, k, _ = factors.shape
    return np.stack([_factor(factors[:, j].reshape(s * k, k)) for j in range(n)])


def _factor(rows: FloatArray) -> FloatArray:
    """Return R (k, k) of rows (m, k), with rows of zeros if m < k."""
    k = rows.shape[1]
    R = np.asarray(np.linalg.qr(rows, mode='r'))
    return np.vstack([R, np.zeros((k - len(R), k))]) if len(R) < k else R
