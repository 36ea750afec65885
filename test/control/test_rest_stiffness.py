# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The stiffness at rest, and the error at which known friction holds a joint, against motion."""

from controller_bench import update
from lock_step_loop import FIRST_STAMP, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.rest import rest_stiffness
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm_dynamics import ArmDynamics

Q = np.array([0.8, 0.5])
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


def effort_at(loop: ControlLoop, error: np.ndarray, k: int, period_ms: int = 2) -> np.ndarray:
    """Return the effort of the law at a constant position error, at rest."""
    reference = loop.controller.reference
    output = update(
            loop.controller,
        FIRST_STAMP + k * period_ms * MS, reference.position - error, np.zeros(2))
    return output.law.effort


@pytest.mark.parametrize('compensation', ['reference', 'none'])
def test_the_law_has_this_stiffness_and_friction_holds_this_error(compensation):
    """The effort beyond gravity, at the stated error of one joint, is the static friction."""
    loop = held(friction_compensation=compensation)
    found = rest_stiffness(loop.controller)
    body = ArmDynamics(loop.controller.arm).rigid_body
    for j in range(2):
        e = np.zeros(2)
        e[j] = found.friction_error[j]
        pull = effort_at(loop, e, 200 + j)[j] - body.gravity(Q - e)[j]
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

