# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Feedback of large errors under a rate limit of the effort.

PD feedback of a fast error computes a large effort, and soon after an effort of opposite sign. If
the rate limit τ̇ of the effort delays it, the effort excites an oscillation instead of damping it.
Let p and d be the efforts of the errors of position and velocity. The feedback s² p + s d has the
same damping ratio. With ë ≈ −s M⁻¹ D ė its effort changes by s² times the rate of s = 1. The
largest factor s for which this is at most 0.3 τ̇ is used, or the larger one for which s (p + d) is
at most τ̇ 60 ms, an effort that the rate limit reverses in 120 ms. The effort p of the position
error alone is in any case lowered to no less than this: it holds a load that falls. While a joint
returns to its reference, p is lowered by a further s, so that the rate limit can brake the joint
there. A steady error, such as that under an unknown load, has s = 1.
"""

import math

import numpy as np
from robot_dynamics.arrays import FloatArray

CHANGE_FRACTION = 0.3
"""Fraction of the rate limit of the effort that the feedback may take."""
REVERSAL_TIME = 0.12
"""[s] in which the rate limit reverses an effort of the feedback that is not limited."""


def feedback_shares(
    position: FloatArray, velocity: FloatArray, change: FloatArray, rate: FloatArray,
    returns: FloatArray,
) -> tuple[FloatArray, float]:
    """
    Return the shares (n,) of the effort `position`, and the factor s of the effort `velocity`.

    Both efforts are (n,) [N·m] or [N]; `change` (n,) is the rate of their sum, and `rate` (n,) its
    limit [N·m/s] or [N/s]. A joint whose `returns` (n,) is not positive returns to its reference.
    """
    reversible = 0.5 * REVERSAL_TIME * rate
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        of_change, of_size, of_position = (
            float(np.min(most / np.abs(effort), initial=1.0)) for most, effort in (
                (CHANGE_FRACTION * rate, change), (reversible, position + velocity),
                (reversible, position)))
    s = max(math.sqrt(of_change), of_size)
    return max(s * s, of_position) * np.where(returns > 0.0, 1.0, s), s
