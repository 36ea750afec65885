# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Whether the measured velocity of a joint agrees with its positions.

d is the difference quotient of the positions (`gate`).

- A sample further than FAR velocity limits from d, or exactly 0 in motion, is missing: the last
  velocity is used and nothing is learned, for MISSED samples in a row. If the position has then
  moved by more than PLAY, it has jumped: the state is a first one at another place.
- The displacement lies between the integrals of the last velocity and of the present one. What is
  outside adds up, and is forgotten with the time constant MEMORY. If it is more than FLOOR + RATIO
  times the displacement (resolution of encoders, scale of the velocity), the velocity is not used
  until it has agreed in motion for AGREEMENT.
"""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, IntArray
from robot_dynamics.monitoring.state_plausibility import LARGEST_SPEED, PLAY

FAR, MISSED = 0.5, 2
"""Share of the velocity limit, which is at most LARGEST_SPEED, and samples."""
FLOOR, RATIO = 0.003, 0.3
"""[rad] or [m], and share of the displacement, that integral and displacement may differ: encoders
of 2000 steps per turn, and an error of the scale."""
MEMORY, AGREEMENT = 0.1, 1.0
"""[s] over which integral and displacement are compared, and of motion in which they agree until a
velocity is used again."""
MOVING = 0.1
"""[rad/s] or [m/s] above which a velocity of 0 is a missing sample."""


class VelocityAgreement:
    """Judges the measured velocities of n joints, state by state; for one thread."""

    def __init__(self, velocity_limit: FloatArray) -> None:
        """Take the velocity limits (n,), infinite for none."""
        self._far: list[float] = (FAR * np.minimum(velocity_limit, LARGEST_SPEED)).tolist()
        self._agreed = [AGREEMENT] * len(self._far)
        """[s] in motion for which the velocity of each joint has agreed with its positions."""
        self.restart()

    def restart(self) -> None:
        """Continue with a state at another place or time."""
        n = len(self._far)
        self._integral, self._moved, self._way = ([0.0] * n for _ in range(3))
        """Of each joint the excess of the displacement over the integral, and the displacement;
        and the way while samples of the velocity are missing."""
        self._missed = [0] * n
        """Samples in a row of each velocity that are missing."""
        self._before: list[float] | None = None
        """Velocities of the last state."""
        self.has_jumped = False
        """Whether a position has jumped by more than PLAY between velocities that agree."""

    @property
    def doubtful(self) -> BoolArray:
        """Whether the measured velocity of each joint is not used, because it is wrong, (n,)."""
        return np.array(self._agreed) < AGREEMENT

    def used(
        self, dt: float, d: FloatArray, v: FloatArray, step: FloatArray, last: FloatArray,
        missing_ns: IntArray,
    ) -> tuple[FloatArray, bool]:
        """
        Return the measured velocities v that agree, else d, (n,), and whether d is needed.

        The positions have changed by `step` (n,) since the last state, dt [s] ago, whose velocity
        `last` (n,) was used. Joints whose sample is missing have a time `missing_ns` (n,) > 0.
        """
        used, is_late, keep = v.tolist(), False, max(1.0 - dt / MEMORY, 0.0)
        integral, moved, agreed, missed = self._integral, self._moved, self._agreed, self._missed
        before = self._before or v.tolist()
        for j, (v_j, d_j, step_j, far, last_j, b_j, is_missing) in enumerate(zip(
                v.tolist(), d.tolist(), step.tolist(), self._far, last.tolist(), before,
                missing_ns.tolist())):
            if is_missing:
                v_j = d_j
            elif not -far <= v_j - d_j <= far or v_j == 0.0 and not -MOVING <= d_j <= MOVING:
                missed[j] += 1
                self._way[j] += step_j
                if missed[j] <= MISSED:
                    used[j] = last_j
                    continue
                v_j, agreed[j] = d_j, 0.0
            elif missed[j]:
                if missed[j] <= MISSED and not -PLAY <= self._way[j] + step_j <= PLAY:
                    self.has_jumped = True
                missed[j], self._way[j] = 0, 0.0
            low, high = (dt * b_j, dt * v_j) if b_j < v_j else (dt * v_j, dt * b_j)
            beyond = step_j - low if step_j < low else step_j - high if step_j > high else 0.0
            integral[j] = w = keep * integral[j] + beyond
            moved[j] = m = keep * moved[j] + step_j
            before[j] = v_j
            if not -FLOOR <= w <= FLOOR and not abs(w) <= FLOOR + RATIO * abs(m):
                agreed[j] = 0.0
            elif agreed[j] < AGREEMENT and not missed[j] and abs(m) > FLOOR:
                agreed[j] += dt
            if agreed[j] < AGREEMENT:
                is_late, v_j = True, d_j
            used[j] = v_j
        self._before = before
        return np.array(used), is_late
