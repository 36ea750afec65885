# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Compensation of friction that drives a light joint away: when its share is lowered."""

from lock_step_loop import FIRST_STAMP, MS, STEP
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.friction_share import (
    CATCH_UP,
    FrictionShare,
    LARGEST_SPEED,
    MARGIN,
    PACE,
    PAUSE,
    RATE,
    REACTION_TIME,
    SHARE,
    SLOW,
    SPEED_FRACTION,
    SURPLUS,
)
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.joints.friction import make_friction, UNKNOWN_WIDTH
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
Q, LIMIT = np.array([0.8, 0.5]), np.array([2.0, 10.0])
FAST = SPEED_FRACTION * np.array([2.0, 4.0])
"""Speeds beyond which the joints run away: 10 rad/s counts as 4."""


def dynamics(coulomb: float) -> UncheckedArmDynamics:
    """Return the default arm, whose joints are light or heavy by their friction [N·m]."""
    return UncheckedArmDynamics(
        ARM.with_friction(make_friction(ARM.joint_names, coulomb=[coulomb] * 2)))


DT = 0.03
"""[s]; the share exceeds 1 within one of these steps."""
REST = np.zeros(2)
LIGHT, HEAVY = dynamics(1e4), dynamics(1e-3)


def take(
    share: FrictionShare, now: float, v: FloatArray, expected: FloatArray | float = 0.0,
    friction: float = 1.0, arm: UncheckedArmDynamics = LIGHT, e: FloatArray | float = 0.0,
    v_ref: FloatArray = REST,
) -> bool:
    return share.take(
        now, DT, arm, Q, np.full(2, e), v, v_ref, np.full(2, expected), np.full(2, friction))


@pytest.mark.parametrize('sign', [-1.0, 1.0])
@pytest.mark.parametrize('j', [0, 1])
def test_a_joint_that_its_compensation_drives_away_keeps_a_share(sign, j):
    share, ahead = FrictionShare(LIMIT), np.zeros(2)
    assert share.least == FAST.min()
    ahead[j] = sign * 0.99 * FAST[j]
    assert not take(share, 1.0, ahead, friction=sign)
    ahead[j] = sign * 1.01 * FAST[j]
    assert take(share, 1.0, ahead, friction=sign)
    expected = np.ones(2)
    expected[j] = SHARE
    assert share.share == pytest.approx(expected)
    assert not take(share, 1.0 + 1.1 * PAUSE, ahead, friction=sign)  # the next one is larger
    ahead /= SHARE**2
    assert not take(share, 1.0 + 0.9 * PAUSE, ahead, friction=sign)
    assert take(share, 1.0 + 1.1 * PAUSE, ahead, friction=sign)
    assert share.share[j] == pytest.approx(SHARE**2)


@pytest.mark.parametrize('friction', [-1.0, 0.0])
def test_a_joint_that_its_compensation_does_not_drive_keeps_all_of_it(friction):
    share = FrictionShare(LIMIT)
    assert not take(share, 1.0, 3.0 * FAST, friction=friction)
    assert share.share.tolist() == [1.0, 1.0]


def test_what_the_position_error_explains_does_not_count_up_to_a_bound():
    share = FrictionShare(LIMIT)
    assert not take(share, 1.0, 1.5 * FAST, expected=100.0)
    assert take(share, 1.0, 1.05 * (1.0 + CATCH_UP) * FAST, expected=100.0)


def test_a_joint_that_the_surplus_cannot_accelerate_so_much_keeps_all_of_it():
    share = FrictionShare(LIMIT)
    assert not take(share, 1.0, 10.0 * FAST, arm=HEAVY)
    assert share.share.tolist() == [1.0, 1.0]


@pytest.mark.parametrize('j', [0, 1])
@pytest.mark.parametrize('factor', [0.99, 1.01])
def test_a_light_joint_is_one_that_the_surplus_accelerates_past_the_bound(j, factor):
    """With the mass that remains when the other joint is free, 1 / (M⁻¹)_jj."""
    m = 1.0 / np.diagonal(np.linalg.inv(LIGHT.rigid_body.mass_matrix(Q)))
    bound = FAST * m / (SURPLUS * REACTION_TIME)
    share, ahead = FrictionShare(LIMIT), np.zeros(2)
    ahead[j] = 1.01 * FAST[j]
    arm = UncheckedArmDynamics(ARM.with_friction(make_friction(
        ARM.joint_names, coulomb=[factor * float(bound[j])] * 2)))
    assert take(share, 1.0, ahead, arm=arm) == (factor > 1.0)
    expected = np.ones(2)
    expected[j] = SHARE if factor > 1.0 else 1.0
    assert share.share == pytest.approx(expected)


@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_the_share_of_a_joint_that_stays_behind_grows_again(sign):
    share, e = FrictionShare(LIMIT), sign * np.array([1.1, 0.9]) * UNKNOWN_WIDTH
    assert not take(share, 1.0, np.zeros(2), e=e)
    assert share.share.tolist() == [1.0, 1.0]
    take(share, 1.0, sign * 1.1 * FAST, friction=sign)
    assert share.share == pytest.approx([SHARE, SHARE])
    assert not take(share, 1.1, np.zeros(2), e=e)
    assert share.share == pytest.approx([SHARE + RATE * DT, SHARE])
    take(share, 1.2, 1.1 * SLOW * np.sign(e), e=e)  # it catches up
    assert share.share == pytest.approx([SHARE + RATE * DT, SHARE])
    for _ in range(1000):
        take(share, 1.3, -SLOW * np.sign(e), e=e)
    assert share.share == pytest.approx([1.0, SHARE])


@pytest.mark.parametrize('sign', [-1.0, 1.0])
@pytest.mark.parametrize('v_ref', [0.0, 0.4, 0.6])
def test_a_joint_that_is_too_fast_while_it_catches_up_has_run_away(sign, v_ref):
    """Also if the position error and the reference explain its velocity."""
    limit = np.minimum(LIMIT, LARGEST_SPEED)
    pace = max(v_ref + MARGIN, PACE) * sign * limit
    for factor, friction, runs in (
            (1.01, sign, True), (0.99, sign, v_ref == 0.0), (1.01, -sign, False)):
        share = FrictionShare(LIMIT)
        assert runs == take(
            share, 1.0, factor * pace, 100.0 * sign, friction, v_ref=sign * v_ref * limit)
        assert share.share == pytest.approx([SHARE if runs else 1.0] * 2)


ROTOR, MASS, TRUE = 0.0158, 5e-4, 0.39
"""[kg·m²], [kg·m²] and [N·m] of a wrist of which the loop does not know the rotor."""
ONE = load_arm(planar_arm_urdf(
    [0.1], [0.1], [0.0], [MASS], coulomb_friction=1.3 * TRUE, velocity_limits=0.84))


def test_the_speed_of_a_joint_that_catches_up_is_bounded_although_its_rotor_is_unknown():
    """With friction given 1.3 times too large a Kinova wrist reached 1.2 times its limit."""
    loop, q, v, fastest = ControlLoop.of_arm(ONE), 0.0, 0.0, 0.0
    for k in range(2000):
        effort = loop.answer(FIRST_STAMP + k * MS, np.array([q]), np.array([v])).effort
        if k == 10:
            loop.follow(make_trajectory(ONE.joint_names, [0.0], [[1.5]]))
        v += STEP * float(effort[0]) / (MASS + ROTOR)
        v = np.sign(v) * max(abs(v) - STEP * TRUE / (MASS + ROTOR), 0.0)
        v = 0.0 if k < 500 else v  # something holds the joint until it is behind
        q += STEP * v
        fastest = max(fastest, abs(v))
    assert 0.6 < fastest / 0.84 < 0.95
    assert loop.supervisor.fault_count == 0
