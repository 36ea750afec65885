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
What recordings say about the parameters, reduced to small matrices that merge exactly.

The rows of a regression [X | y] of m samples can be replaced by the R factor of their QR
decomposition: the sum of squares of X θ − y is the same for every θ. R of [[R₁], [R₂]] is that of
both recordings together. (G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed., section
5.3 and 6.5.3.) So recordings of any number and length, reduced one by one, in any order and
place, give the same estimate as all their samples at once.

Samples for training are parted in time-contiguous blocks, each with an R factor of its own, and
the gaps between blocks, as wide as the filter smears, have one too: a block that is left out to
validate has then nothing in common with those that remain. There is one factor a joint, so that
weights between joints can be chosen afterwards.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.exceptions import InvalidInputError

BLOCKS = 6
_ROUNDING = 1e-20


@dataclass(frozen=True, eq=False)
class QrInformation:
    """
    What recordings say: for each of 2 × BLOCKS − 1 slots and n joints an R factor (k, k).

    Even slots are blocks, odd ones the gaps after them. `factors` (slots, n, k, k), `rows`
    (slots,) the samples behind them; the last of k columns is the effort, those before are
    `columns`, by name, the same for every joint. `correlation` (n,) is the sum over the blocks'
    samples of how many samples count as one, and merges by adding.
    """

    joint_names: tuple[str, ...]
    columns: tuple[str, ...]
    factors: FloatArray
    rows: FloatArray
    correlation: FloatArray

    @property
    def sample_count(self) -> int:
        return int(self.rows.sum())

    @property
    def samples_per_independent_sample(self) -> FloatArray:
        """How many samples count as one independent one, (n,)."""
        return np.asarray(self.correlation / max(float(self.rows.sum()), 1.0))

    @property
    def is_measured(self) -> BoolArray:
        """For which joints (n,) there is any effort, beyond rounding."""
        power = np.sum(self.factors[..., -1]**2, axis=(0, 2))
        return np.asarray(power > _ROUNDING * max(float(power.max()), 1e-300))

    def all_but(self, block: int) -> FloatArray:
        """Return the factors (n, k, k) of all samples but a block and the gaps beside it."""
        kept = [i for i in range(len(self.factors)) if abs(i - 2 * block) > 1]
        return stack_factors(self.factors[kept])

    def block(self, block: int) -> FloatArray:
        """Return the factors (n, k, k) of one block."""
        return np.asarray(self.factors[2 * block])

    def together(self) -> FloatArray:
        """Return the factors (n, k, k) of all samples."""
        return stack_factors(self.factors)


def reduce_rows(
    joint_names: Sequence[str], columns: Sequence[str], X: FloatArray, y: FloatArray,
    gap: int, samples_per_independent_sample: FloatArray,
) -> QrInformation:
    """
    Return the information in a regression: X (m, n, p) and y (m, n), in the order of time.

    Between blocks are gaps of so many samples; `samples_per_independent_sample` (n,) says how many
    samples count as one. Raises InvalidInputError where there are too few samples for that.
    """
    m, n, p = X.shape
    edges = np.linspace(0, m, BLOCKS + 1).astype(int)
    if m < BLOCKS * 2 * (gap + 1):
        raise InvalidInputError(
            f'the recording has {m} samples to train with, expected at least '
            f'{BLOCKS * 2 * (gap + 1)}')
    bounds = [0]
    for edge in edges[1:-1]:
        bounds += [int(edge) - gap // 2, int(edge) - gap // 2 + gap]
    bounds.append(m)
    slots = list(zip(bounds, bounds[1:]))
    factors = np.zeros((len(slots), n, p + 1, p + 1))
    for i, (first, last) in enumerate(slots):
        for j in range(n):
            rows = np.concatenate([X[first:last, j], y[first:last, j, np.newaxis]], axis=1)
            factors[i, j] = _factor(rows)
    counts = np.array([float(last - first) for first, last in slots])
    return QrInformation(
        tuple(joint_names), tuple(columns), factors, counts, m * samples_per_independent_sample)


def merge(parts: Sequence[QrInformation]) -> QrInformation:
    """
    Return the information of several recordings together.

    Raises InvalidInputError where there are none, or their joints or columns differ.
    """
    if not parts:
        raise InvalidInputError('there is no recording to merge, expected at least one')
    first = parts[0]
    for other in parts[1:]:
        if (other.joint_names, other.columns) != (first.joint_names, first.columns):
            raise InvalidInputError(
                f'recordings of the joints {list(other.joint_names)} and '
                f'{list(first.joint_names)} cannot be merged, expected the same joints and '
                'columns')
    factors = np.stack([
        stack_factors(np.stack([part.factors[slot] for part in parts]))
        for slot in range(len(first.factors))])
    return QrInformation(
        first.joint_names, first.columns, factors, np.sum([part.rows for part in parts], axis=0),
        np.sum([part.correlation for part in parts], axis=0))


def stack_factors(factors: FloatArray) -> FloatArray:
    """Return the factors (n, k, k) of all the samples of several factors (s, n, k, k)."""
    s, n, k, _ = factors.shape
    return np.stack([_factor(factors[:, j].reshape(s * k, k)) for j in range(n)])


def _factor(rows: FloatArray) -> FloatArray:
    """Return R (k, k) of rows (m, k), with rows of zeros where m < k."""
    k = rows.shape[1]
    R = np.asarray(np.linalg.qr(rows, mode='r'))
    return np.vstack([R, np.zeros((k - len(R), k))]) if len(R) < k else R
