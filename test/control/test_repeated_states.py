# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A state that arrives again, as from a simulation in lock-step that waits, changes nothing."""

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import FIRST_STAMP, MS, smooth_arm
import numpy as np
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.trajectories.quintics import quintic_point_to_point

ARM = smooth_arm('default')
PERIOD = 10
"""[ms]"""


def efforts(
    seed: int, count: int, repeats: dict[int, int], goal_at: int, moves: bool,
) -> list[tuple[float, ...] | None]:
    """
    Return the efforts for `count` noisy states; state k arrives 1 + repeats[k] times.

    The steady clock and that of the computer pass at random between two arrivals, the stamps are
    those of simulated time.
    """
    rng, clock = np.random.default_rng(seed), np.random.default_rng(seed + len(repeats))
    loop, steady, found = ControlLoop.of_arm(ARM), 0, []
    loop.is_heard = False  # these states do not follow the commands
    q, v = np.array([0.8, 0.5]), np.array([0.3, -0.2]) if moves else np.zeros(2)
    for k in range(count):
        if k == goal_at:
            loop.follow(quintic_point_to_point(ARM.joint_names, [0.8, 0.5], [1.0, 0.7], 1.0))
        q = q + 1e-3 * PERIOD * v
        noise = rng.normal(0.0, 1e-4, 2), rng.normal(0.0, 1e-3, 2)
        for _ in range(1 + repeats.get(k, 0)):
            steady += int(clock.integers(1, 10)) * MS
            effort = loop.answer(
                (k + 1) * PERIOD * MS, q + noise[0], v + noise[1],
                FIRST_STAMP + steady, steady).effort
        found.append(None if effort is None else tuple(effort.tolist()))
    return found


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**31), repeats=st.dictionaries(
        st.integers(0, 14), st.integers(1, 3), max_size=4),
    goal_at=st.integers(1, 20), moves=st.booleans())
def test_repeated_states_change_no_effort(seed, repeats, goal_at, moves):
    assert efforts(seed, 15, repeats, goal_at, moves) == efforts(seed, 15, {}, goal_at, moves)
