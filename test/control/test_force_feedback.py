# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The force of a follower at its leader: the energy that it gives, and its limit."""

import numpy as np
import pytest
from robot_dynamics.control.laws.force_feedback import ForceFeedback

DT = 0.002


def feedback() -> ForceFeedback:
    """Return the feedback of one joint with a gain of 0.5 and at most 10 N·m."""
    return ForceFeedback(np.array([0.5]), np.array([40.0]))


def force(
    one: ForceFeedback, external: float, moved: float = 0.0, v: float = 0.0,
    friction: float = 0.0,
) -> float:
    return float(one.effort(
        np.array([external]), np.array([moved]), np.array([v]), DT, np.array([friction]))[0])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_force_at_rest_or_against_the_motion_is_the_scaled_effort_within_its_limit(sign):
    one = feedback()
    assert force(one, 6.0 * sign) == 3.0 * sign
    assert force(one, 6.0 * sign, -0.001 * sign, -0.5 * sign) == 3.0 * sign
    assert force(one, 30.0 * sign) == 10.0 * sign


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_force_along_the_motion_gives_half_of_the_energy_that_it_has_received(sign):
    """It may act for a period and 16 ms until it ends; then the tank is empty."""
    one = feedback()
    assert force(one, 8.0 * sign) == 4.0 * sign
    assert force(one, 8.0 * sign, -0.01 * sign, -5.0 * sign) == 4.0 * sign  # receives 0.04 J
    speed = 2.0
    found = force(one, 8.0 * sign, 0.0, speed * sign)
    assert found * sign * speed * (DT + 0.016) == pytest.approx(0.02)
    given = 0.0
    for _ in range(1000):
        moved = DT * speed * sign
        given += found * moved
        found = force(one, 8.0 * sign, moved, speed * sign)
    assert given == pytest.approx(0.02, rel=1e-3)
    assert abs(found) < 1e-6


def test_dry_friction_that_remains_may_be_overcome_and_an_empty_tank_gives_nothing_else():
    one = feedback()
    assert force(one, 8.0, 0.0, 1.0) == 0.0
    assert force(one, 8.0, 0.0, 1.0, friction=1.5) == pytest.approx(1.5)
    one.restart()
    assert force(one, 8.0, 0.0, 1.0) == 0.0


def test_a_tank_holds_the_energy_of_the_largest_force_over_a_twentieth_of_a_radian():
    one = feedback()
    force(one, 40.0)
    for _ in range(100):
        force(one, 40.0, -0.01, -1.0)
    speed = 50.0
    assert force(one, 40.0, 0.0, speed) * speed * (DT + 0.016) == pytest.approx(0.5)
    one.restart()
    assert force(one, 40.0, 0.0, speed) == 0.0
