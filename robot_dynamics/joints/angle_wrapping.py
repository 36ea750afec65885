# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Whole turns of continuous joints, which many drivers remove from the measured position.

A continuous joint reaches the same pose after a whole turn. A driver may therefore report its
position within ±π; the position then steps by 2π. The joint is assumed to turn by less than half a
turn between two samples. Other joints are never changed: the position limits of a revolute joint
distinguish whole turns, so that a step of 2π is a motion or a fault, and a prismatic joint has no
turns.
"""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray


def nearest_turn(
    position: FloatArray, near: FloatArray, is_continuous: BoolArray,
) -> FloatArray:
    """
    Return positions (..., n) [rad or m], with those of continuous joints moved by whole turns.

    The positions are then within half a turn of `near` (..., n); `is_continuous` is (n,).
    """
    turn = 2.0 * np.pi
    turns = turn * np.rint((position - near) / turn)
    return np.where(is_continuous, position - turns, position)
