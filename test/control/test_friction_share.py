# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Compensation of friction that drives a light joint away: when its share is lowered."""

from lock_step_loop import FIRST_STAMP, MS, STEP
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.friction_share import FrictionShare
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
Q, LIMIT, ZERO = np.array([0.8, 0.5]), np.array([2.0, 10.0]), np.zeros(2)
FAST = np.array([0.8, 1.6])
"""[rad/s], 0.4 of the limits, beyond which the joints run away: 10 rad/s counts as 4."""
DT = 0.03
"""[s]"""


def dynamics(coulomb: float) -> UncheckedArmDynamics:
    """Return the default arm, whose joints are light or heavy by their friction [N·m]."""
    return UncheckedArmDynamics(
        ARM.with_friction(make_friction(ARM.joint_names, coulomb=[coulomb] * 2)))


LIGHT, HEAVY = dynamics(1e4), dynamics(1e-3)


def take(
    share: FrictionShare, now: float, v: FloatArray, friction: float = 1.0,
    arm: UncheckedArmDynamics = LIGHT, e: FloatArray | float = 0.0,
) -> bool:
    return share.take(now, DT, arm, Q, np.full(2, e), v, ZERO, ZERO, np.full(2, friction))


@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_a_light_joint_that_its_compensation_drives_away_keeps_three_quarters(sign):
    share, ahead = FrictionShare(LIMIT), np.zeros(2)
    ahead[1] = sign * 0.99 * FAST[1]
    assert not take(share, 1.0, ahead, friction=sign)
    ahead[1] = sign * 1.01 * FAST[1]
    assert take(share, 1.0, ahead, friction=sign)
    assert share.share == pytest.approx([1.0, 0.75])
    ahead /= 0.75**2
    assert not take(share, 1.18, ahead, friction=sign)  # its effect is awaited
    assert take(share, 1.22, ahead, friction=sign)
    assert share.share[1] == pytest.approx(0.75**2)


def test_a_heavy_joint_or_one_that_its_compensation_brakes_keeps_all_of_it():
    share = FrictionShare(LIMIT)
    assert not take(share, 1.0, 3.0 * FAST, friction=-1.0)
    assert not take(share, 1.0, 10.0 * FAST, arm=HEAVY)
    assert share.share.tolist() == [1.0, 1.0]


ROTOR, MASS, TRUE = 0.0158, 5e-4, 0.39
"""[kg·m²], [kg·m²] and [N·m] of a wrist of which the loop does not know the rotor."""


def test_the_speed_of_a_joint_that_catches_up_is_bounded_although_its_rotor_is_unknown():
    """With friction given 1.3 times too large a Kinova wrist reached 1.2 times its limit."""
    arm = load_arm(planar_arm_urdf(
        [0.1], [0.1], [0.0], [MASS], coulomb_friction=1.3 * TRUE, velocity_limits=0.84))
    loop, q, v, fastest = ControlLoop.of_arm(arm), 0.0, 0.0, 0.0
    for k in range(2000):
        effort = loop.answer(FIRST_STAMP + k * MS, np.array([q]), np.array([v])).effort
        if k == 10:
            loop.follow(make_trajectory(arm.joint_names, [0.0], [[1.5]]))
        v += STEP * float(effort[0]) / (MASS + ROTOR)
        v = np.sign(v) * max(abs(v) - STEP * TRUE / (MASS + ROTOR), 0.0)
        v = 0.0 if k < 500 else v  # something holds the joint until it is behind
        q += STEP * v
        fastest = max(fastest, abs(v))
    assert 0.6 < fastest / 0.84 < 0.95
    assert loop.supervisor.fault_count == 0
