# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Rests that were approached from both directions, averaged in pairs.

A joint that stops while it moves in the positive direction keeps friction of one sign, and one
that stops from the other side keeps friction of the other sign. The average of both does not
depend on dry friction of equal size. A rest without a partner has the whole band of friction, of
the sign of its approach.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics_tools.payload_estimation.rows import COLUMNS, Rest

PAIR_DISTANCE = 0.5
"""Largest distance [rad] or [m] of every joint between the two rests of a pair."""


@dataclass(frozen=True, eq=False)
class RestRows:
    """
    The observations at rest, k of them.

    `joint` (k,), `row` (k, c), whose SIGN is the direction of approach, `paired` (k,),
    `weight` (k,) in (0, 1]: parts of one uninterrupted rest share the weight of one observation,
    because friction may be the same.
    `noise` (k,) is the variance of the average due to noise between samples.
    """

    joint: IntArray
    row: FloatArray
    paired: BoolArray
    weight: FloatArray
    noise: FloatArray


def pair_rests(rests: Sequence[Rest], independent_interval: float) -> RestRows:
    """
    Return the observations at rest, each rest in at most one pair.

    Samples `independent_interval` [s] apart are independent.
    """
    groups: list[tuple[Rest, ...]] = []
    for joint in sorted({rest.joint for rest in rests}):
        groups += _pairs_and_others([rest for rest in rests if rest.joint == joint])
    stays = Counter((rest.joint, rest.stay) for rest in rests)

    def noise(group: tuple[Rest, ...]) -> float:
        return float(np.mean([
            rest.variance / max(rest.duration / independent_interval, 1.0)
            for rest in group])) / len(group)

    return RestRows(
        np.array([group[0].joint for group in groups], dtype=np.intp),
        np.array([np.mean([rest.row for rest in group], axis=0) for group in groups])
        if groups else np.zeros((0, COLUMNS)),
        np.array([len(group) == 2 for group in groups], dtype=np.bool_),
        np.array([1.0 / max(stays[rest.joint, rest.stay] for rest in group)
                  for group in groups]),
        np.array([noise(group) for group in groups]))


def _pairs_and_others(rests: Sequence[Rest]) -> list[tuple[Rest, ...]]:
    """Return pairs of opposite approaches, nearest first, and the rests without a partner."""
    ups, downs = ([i for i, rest in enumerate(rests) if rest.approach == side] for side in (1, -1))
    position = np.array([rest.position for rest in rests])
    distance = np.abs(position[ups, None] - position[None, downs]).max(axis=2)
    near = sorted((float(distance[i, k]), ups[i], downs[k])
                  for i, k in np.argwhere(distance <= PAIR_DISTANCE).tolist())
    used: set[int] = set()
    groups: list[tuple[Rest, ...]] = []
    for _, i, k in near:
        if not {i, k} & used:
            used |= {i, k}
            groups.append((rests[i], rests[k]))
    return groups + [(rest,) for i, rest in enumerate(rests) if i not in used]
