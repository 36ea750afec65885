# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The state of a motion of constant jerks at any time."""

from robot_dynamics.references.jerk_profile import Phases


def evaluate(phases: Phases, t: float, q: float, v: float, a: float) -> tuple[float, float, float]:
    """Return (q, v, a) at time t [s], with zero jerk after the end."""
    t = max(t, 0.0)
    for T, j in [*phases, (t, 0.0)]:
        h = min(t, T)
        q, v, a = q + h * (v + h * (a / 2.0 + h * j / 6.0)), v + h * (a + h * j / 2.0), a + h * j
        t -= h
    return q, v, a
