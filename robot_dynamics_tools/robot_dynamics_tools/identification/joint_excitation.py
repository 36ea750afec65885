# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""
Excitation of each joint by a motion: the friction parameters that the recording separates.

In one direction of motion, dry friction and the offset F_b are the same constant; at one speed,
viscous and dry friction are proportional. Near rest, dry friction has any value up to static
friction, so that samples near rest separate nothing. The separation therefore follows from the
moving samples only: from the smallest eigenvalue of the normalized Gram matrix of the columns
q̇, sgn q̇ and 1. A parameter that cannot be separated is left out of the model.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.friction_terms import DRY_FRICTION, VISCOUS_FRICTION
from robot_dynamics_tools.analysis.motion_filter import FilteredMotion
from robot_dynamics_tools.identification.friction_regressor import OFFSET_EFFORT, scales_of

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
            return VISCOUS_FRICTION, DRY_FRICTION
        kept = [_V, _SIGN, _ONE]
        if self.shares[joint].min() < LEAST_REVERSED:
            kept.remove(_ONE)
        if not _is_separable(G, kept):
            kept = [_V, _SIGN] if _is_separable(G, [_V, _SIGN]) else [
                column for column in kept if column != _V]
        return tuple(
            name for name, column in ((VISCOUS_FRICTION, _V), (OFFSET_EFFORT, _ONE))
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
