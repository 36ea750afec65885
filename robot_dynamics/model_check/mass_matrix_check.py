# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Invertibility of M(q): joints that move no mass, and the condition number.

Definiteness is checked for D^(−1/2) M D^(−1/2) with the diagonal D of M. This matrix has no units,
and its condition number is within a factor n of the best scaling (A. van der Sluis, *Condition
numbers and equilibration of matrices*, Numerische Mathematik 14, 1969).
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.worst_gravity import sample_positions

SMALLEST_EIGENVALUE = 1e-10
"""Eigenvalue of the scaled M(q) below which it is singular to working precision."""
SMALLEST_INERTIA = 1e-12
"""Inertia [kg·m²] or [kg] at a joint up to which the joint moves no mass."""


class InertiaMatrix(NamedTuple):
    """
    M(q) over many positions.

    `idle` (n,) marks the joints that move no mass in any position; the other fields exclude them,
    except `diagonal` (n,) [kg·m²] or [kg], the smallest M_jj of each joint over all positions.
    `smallest` is the smallest eigenvalue of the scaled matrix, at the position `singular_at` (n,),
    `condition` is the largest condition number, at the position `worst_at` (n,).
    """

    idle: BoolArray
    smallest: float
    singular_at: FloatArray
    condition: float
    worst_at: FloatArray
    diagonal: FloatArray

    @property
    def is_definite(self) -> bool:
        return self.smallest > SMALLEST_EIGENVALUE


def survey_inertia(arm: ArmModel, samples: int) -> InertiaMatrix:
    """Return properties of M over the workspace and at position 0, or the nearest limits."""
    home = np.clip(0.0, arm.limits.lower, arm.limits.upper)
    q = np.vstack([home, sample_positions(arm, samples)])
    body = RigidBody(arm)
    M = np.array([body.mass_matrix(row) for row in q])
    diagonal = np.diagonal(M, axis1=1, axis2=2)
    least_diagonal = np.asarray(diagonal.min(axis=0))
    idle = np.asarray(np.abs(diagonal).max(axis=0) <= SMALLEST_INERTIA)
    if idle.all():
        return InertiaMatrix(idle, 1.0, q[0], 1.0, q[0], least_diagonal)
    M, diagonal = M[:, ~idle][:, :, ~idle], diagonal[:, ~idle]
    if np.any(diagonal <= 0.0):
        lowest = int(diagonal.min(axis=1).argmin())
        return InertiaMatrix(
            idle, min(0.0, float(diagonal.min())), q[lowest], np.inf, q[lowest], least_diagonal)
    scale = 1.0 / np.sqrt(diagonal)
    smallest = np.asarray(np.linalg.eigvalsh(M * scale[:, :, None] * scale[:, None, :]))[:, 0]
    values = np.abs(np.asarray(np.linalg.eigvalsh(M)))
    least = values.min(axis=1)
    condition = np.divide(
        values.max(axis=1), least, out=np.full(len(q), np.inf), where=least > 0.0)
    lowest, worst = int(smallest.argmin()), int(condition.argmax())
    return InertiaMatrix(
        idle, float(smallest[lowest]), q[lowest], float(condition[worst]), q[worst],
        least_diagonal)
