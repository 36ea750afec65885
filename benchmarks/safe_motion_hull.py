# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The positions that a reference may have in a run of `safe_motion`."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.jerk_profile import Bounds, extremes, stop
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.trajectories.interpolation import Reference


class Hull:
    """
    The positions (n,) that a reference may have: those of start, earliest stop and goals.

    `lowest` and `highest` are those of all references so far.
    """

    def __init__(self, q: FloatArray) -> None:
        self.lower = self.upper = self.lowest = self.highest = q

    def begin(self, state: Reference, limits: MotionLimits) -> None:
        """Begin with the path of the earliest stop from a state."""
        self.lower = self.upper = state.position
        self.include(*stop_path(state, limits))

    def include(self, *positions: FloatArray) -> None:
        """Include positions (n,)."""
        self.lower = np.min([self.lower, *positions], axis=0)
        self.upper = np.max([self.upper, *positions], axis=0)
        self.lowest = np.minimum(self.lowest, self.lower)
        self.highest = np.maximum(self.highest, self.upper)

    def excess(self, q: FloatArray) -> float:
        """Return the largest distance of q from the hull."""
        return float(np.max(np.maximum(q - self.upper, self.lower - q)))


def stop_path(state: Reference, limits: MotionLimits) -> tuple[FloatArray, FloatArray]:
    """
    Return lowest and highest position (n,) on the earliest stop from a state.

    A joint that would pass a position limit brakes with the limits without reserve.
    """
    found = []
    for j, joint in enumerate(zip(*(x.tolist() for x in state))):
        least, most = min(joint[0], limits.lower[j]), max(joint[0], limits.upper[j])
        for each in (limits, limits.whole):
            a = float(each.acceleration[j])
            path = extremes(
                stop(joint[1], joint[2], Bounds(-1.0, 1.0, -a, a, float(each.jerk[j]))), *joint)
            if least <= path.q_min and path.q_max <= most:
                break
        found.append((path.q_min, path.q_max))
    lowest, highest = np.array(found).T
    return lowest, highest
