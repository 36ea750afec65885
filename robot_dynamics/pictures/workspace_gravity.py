# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Gravity torques relative to the effort limits over the workspace of an arm.

Positions are sampled over all joints; each position is assigned to the cell that contains a given
link. The cells of a planar arm are in its plane; those of any other arm are in the plane of the
height and the distance from the vertical through the base.
"""

from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.rigid_body import RigidBody
from robot_dynamics.model.worst_gravity import sample_positions
from robot_dynamics.pictures.planar_view import PlanarView
from robot_dynamics.pictures.stick_figure import side_view, StickFigure

POSITIONS = 60000
CELLS = 56
"""Number of cells along the longer side of the workspace."""


class WorkspaceGravity(NamedTuple):
    """
    Gravity torques as fractions of the effort limits, per cell of the link; NaN if unreachable.

    `across` (k + 1,) and `up` (l + 1,) [m] are the edges of the cells; `most` and `least` (l, k)
    are the largest fraction of any joint, in the worst and in the best pose that reaches the cell.
    `is_plane` is true if `across` is x in the plane of the arm, and false if it is the distance
    from the vertical. `held` is the fraction of all sampled positions that the arm can hold.
    """

    across: FloatArray
    up: FloatArray
    most: FloatArray
    least: FloatArray
    is_plane: bool
    held: float


def limit_ratios(arm: ArmModel, efforts: FloatArray) -> FloatArray:
    """Return the largest |effort| / limit of any joint, (m,) of efforts (m, n); 0 without any."""
    return np.asarray((np.abs(efforts) / arm.limits.effort).max(axis=-1))


def map_gravity(
    arm: ArmModel, link: str, positions: int = POSITIONS, cells: int = CELLS,
) -> WorkspaceGravity:
    """
    Return the map for a link of the arm.

    Raises InvalidInputError for an unknown link, or an arm without any effort limit.
    """
    figure = StickFigure(arm, link)
    if not np.isfinite(arm.limits.effort).any():
        raise InvalidInputError(
            f'robot {arm.name!r} has no effort limit at any of the joints '
            f'{list(arm.joint_names)}, expected at least one in its <limit effort="…">')
    q = sample_positions(arm, positions)
    zero = np.zeros_like(q)
    ratios = limit_ratios(arm, RigidBody(arm).inverse_dynamics_batch(q, zero, zero))
    places, is_plane = _places(arm, figure.tip(q))
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float((high - low).max()) / cells, 1e-9)
    counts = np.maximum(np.ceil((high - low) / size - 1e-9).astype(np.intp), 1)
    columns, rows = np.clip(((places - low) / size).astype(np.intp), 0, counts - 1).T
    most = np.full((counts[1], counts[0]), -np.inf)
    least = np.full_like(most, np.inf)
    np.maximum.at(most, (rows, columns), ratios)
    np.minimum.at(least, (rows, columns), ratios)
    empty = np.isneginf(most)
    most[empty] = least[empty] = np.nan
    return WorkspaceGravity(
        low[0] + size * np.arange(counts[0] + 1), low[1] + size * np.arange(counts[1] + 1),
        most, least, is_plane, float((ratios <= 1.0).mean()))


def _places(arm: ArmModel, points: FloatArray) -> tuple[FloatArray, bool]:
    """Return the points (m, 3) in the map, (m, 2) [m], and whether it is the plane of the arm."""
    side, up = side_view(arm, points)
    try:
        plane = PlanarView(arm).plane
        is_plane = bool(abs(plane.normal @ up) < 1e-6)
    except ModelError:
        is_plane = False
    height = points @ up
    if is_plane:
        return np.column_stack([points @ plane.side, height]), True
    away = points - np.outer(height, up)
    return np.column_stack([np.linalg.norm(away, axis=1), height]), False
