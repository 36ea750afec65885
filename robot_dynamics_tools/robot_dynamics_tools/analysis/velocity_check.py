# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Check that a recorded velocity is the derivative of the recorded position.

Some drivers publish zeros, other units, or a velocity with a large delay. The velocity, integrated
over windows of a few seconds in which noise is negligible, must agree with the change of position.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import BoolArray, FloatArray

WINDOW = 4.0
"""[s]"""
LARGEST_ERROR = 0.2
"""Largest RMS of the difference within windows, relative to that of the motion there."""
_LEAST_MOVE = 1e-3


def contradicts_position(
    times: FloatArray, position: FloatArray, velocity: FloatArray,
    stretches: Sequence[npt.NDArray[np.integer]],
) -> BoolArray:
    """
    Return the joints (n,) whose velocity is not the derivative of the position, both (m, n).

    `times` is (m,) [s]; `stretches` are the rows of samples without gaps between them. A joint
    that hardly moves, compared with the joint that moves most, is not checked.
    """
    error, moved = np.zeros(position.shape[1]), np.zeros(position.shape[1])
    for rows in stretches:
        t, q, v = times[rows], position[rows], velocity[rows]
        steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, np.newaxis]
        integral = np.concatenate([np.zeros((1, q.shape[1])), np.cumsum(steps, axis=0)])
        count = max(int((t[-1] - t[0]) / WINDOW), 1)
        edges = np.searchsorted(t, np.linspace(t[0], t[-1], count + 1)[1:-1])
        for q_window, x in zip(np.split(q, edges), np.split(integral, edges)):
            own = q_window - q_window.mean(axis=0)
            moved += np.sum(own**2, axis=0)
            error += np.sum((own - (x - x.mean(axis=0)))**2, axis=0)
    is_judged = moved > _LEAST_MOVE**2 * max(float(moved.max()), 1e-300)
    return np.asarray(is_judged & (error > LARGEST_ERROR**2 * moved))
