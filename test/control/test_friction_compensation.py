# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The velocity at which computed torque compensates friction: of the reference, or measured."""

from controller_bench import update
import numpy as np
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
GAINS = make_gains(NAMES)
COULOMB = 4.0
STILL = np.array([1.0, -1.0])
SECOND = 1_000_000_000


def compensated(mode: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the friction (2,) that is compensated while a reference rests at (1, −1)."""
    friction = make_friction(NAMES, viscous=2.0, coulomb=COULOMB, load_coefficient=0.1)
    one = Controller(
        ARM.with_friction(friction), ControllerOptions(GAINS, friction_compensation=mode))
    update(one, SECOND, np.zeros(2), np.zeros(2))
    one.follow(make_trajectory(NAMES, (0.001,), [STILL], [[0.0, 0.0]], [[0.0, 0.0]]), 0)
    return update(one, 2 * SECOND, q, v).terms.friction


def test_around_rest_friction_of_the_reference_has_no_step():
    speed = 1e-5
    q = STILL - speed * GAINS.kd / GAINS.kp  # the velocity v_r at which it is compensated
    reference, measured, none = (
        np.abs(compensated(mode, q, np.full(2, speed)))
        for mode in ('reference', 'measured', 'none'))
    assert (reference < 0.01 * COULOMB).all()
    assert (measured >= COULOMB).all()
    assert none.tolist() == [0.0, 0.0]
