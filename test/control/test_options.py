# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The defaults of the control loop: limits of errors, efforts and ages of states.

The stiffness at rest, and the error at which known friction holds a joint, against motion.
"""

import re

from controller_bench import update
from lock_step_loop import FIRST_STAMP, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.options import ControllerOptions, default_limits, default_options
from robot_dynamics.control.rest import is_held, rest_stiffness
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf

Q = np.array([0.8, 0.5])


def test_the_following_error_is_limited_to_the_way_at_full_speed_in_three_tenths_of_a_second():
    options, limits = ControllerOptions(make_gains(['a', 'b'])), np.array([2.0, np.inf])
    assert options.largest_error(limits) == pytest.approx([0.6, 0.3])
    given = ControllerOptions(options.gains, following_error=[0.0, 0.1])
    assert given.largest_error(limits).tolist() == [np.inf, 0.1]


def test_an_effort_may_reach_its_limit_in_a_tenth_of_a_second():
    """A joint without a limit has 1000 N·m/s."""
    assert default_limits(smooth_arm('default')).rate.tolist() == [1500.0, 600.0]
    unlimited = load_arm(re.sub('<limit[^>]*/>', '', planar_arm_urdf([1.0], [1.0], [0.5], [0.1])))
    assert default_limits(unlimited).rate.tolist() == [1000.0]
    assert default_options(unlimited).effort_rate.tolist() == [1000.0]


@pytest.mark.parametrize(('coulomb', 'friction'), [(0.0, [7.5, 3.0]), (40.0, [16.0, 16.0])])
def test_dry_friction_holds_a_share_of_the_known_or_of_the_limit_and_30_mrad(coulomb, friction):
    """The stiffness is M(q) K_p, and the effort limits are 150 and 60 N·m."""
    arm = smooth_arm('default')
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=[coulomb]))
    controller = Controller(arm, ControllerOptions(make_gains(arm.joint_names)))
    K = 400.0 * ArmDynamics(arm).rigid_body.mass_matrix(Q)
    effort = np.array(friction) + 0.03 * np.diagonal(K)
    assert is_held(controller, Q, np.linalg.solve(K, 0.999 * effort)).all()
    assert not is_held(controller, Q, np.linalg.solve(K, 1.001 * effort)).any()


FRICTION = {'coulomb': [2.0, 1.0], 'static': [3.0, 1.5]}


def held(period_ms: int = 2, rotors: float = 0.0, friction: bool = True, **options) -> ControlLoop:
    """Return a loop that holds an arm at Q."""
    arm = smooth_arm('default').with_reflected_inertia([rotors])
    arm = arm.with_friction(make_friction(
        arm.joint_names, **(FRICTION if friction else {'coulomb': [0.0]})))
    loop = ControlLoop.of_arm(arm, **options)
    for k in range(200):
        loop.answer(FIRST_STAMP + k * period_ms * MS, Q, np.zeros(2))
    return loop


@pytest.mark.parametrize('compensation', ['reference', 'none'])
def test_the_law_has_this_stiffness_and_friction_holds_this_error(compensation):
    """The effort beyond gravity, at the stated error of one joint, is the static friction."""
    loop = held(friction_compensation=compensation)
    found = rest_stiffness(loop.controller)
    body = ArmDynamics(loop.controller.arm).rigid_body
    for j in range(2):
        e = np.zeros(2)
        e[j] = found.friction_error[j]
        output = update(loop.controller, FIRST_STAMP + 2 * (200 + j) * MS,
                        loop.controller.reference.position - e, np.zeros(2))
        pull = output.law.effort[j] - body.gravity(Q - e)[j]
        assert pull == pytest.approx(FRICTION['static'][j], rel=0.02)
        if compensation == 'none':
            assert pull / e[j] == pytest.approx(found.stiffness[j], rel=0.02)


def test_rotors_and_scaled_gains_are_part_of_the_stiffness():
    bare, geared, slow = (
        rest_stiffness(loop.controller) for loop in (held(), held(rotors=0.5), held(33)))
    M = ArmDynamics(smooth_arm('default')).rigid_body.mass_matrix(Q)
    assert bare.stiffness == pytest.approx(400.0 * np.diagonal(M))
    assert geared.stiffness == pytest.approx(400.0 * (np.diagonal(M) + 0.5))
    assert (slow.stiffness < 0.5 * bare.stiffness).all()


def test_without_friction_no_error_is_known_and_without_computed_torque_nothing_is_known():
    assert np.isnan(rest_stiffness(held(friction=False).controller).friction_error).all()
    assert rest_stiffness(held(command='gravity_compensation').controller) is None
    assert rest_stiffness(ControlLoop.of_arm(smooth_arm('default')).controller) is None
