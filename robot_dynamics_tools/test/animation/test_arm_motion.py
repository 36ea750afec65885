# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Motions with derived quantities: energy balance, sums of terms, the hanging pose."""

import numpy as np
import numpy.testing as npt
from planar_chains import on_a_turned_base, random_chain, urdf_of
import pytest
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.animation.arm_motion import lowest_position, motion_of, simulate_motion
from robots import robot_urdf

TERMS = ('inertial', 'coriolis', 'gravity', 'friction')


@pytest.fixture(scope='module')
def swing():
    return simulate_motion(load_arm(default_arm_urdf()), 4.0, 50.0)


@pytest.fixture(scope='module')
def driven():
    arm = load_arm(robot_urdf('ur10'), ('shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint'))
    return simulate_motion(arm, 2.0, 50.0)


def test_energy_is_what_was_put_in_less_what_became_heat(swing):
    npt.assert_allclose(
        swing.energy + swing.heat, swing.energy[0] + swing.work, rtol=0.0, atol=1e-4)
    assert swing.work[-1] > 20.0
    assert swing.heat[-1] > 5.0
    assert (np.diff(swing.heat) >= 0.0).all()
    assert (swing.potential >= 0.0).all()


def test_the_motors_lift_the_arm_and_are_then_off(swing):
    lift = swing.times < 0.35 * 4.0
    npt.assert_array_equal(swing.driven, lift)
    npt.assert_array_equal(swing.terms['effort'][~lift].round(9), 0.0)
    assert (np.abs(swing.terms['effort'][lift]).max(axis=0) > 1.0).all()
    assert np.ptp(swing.work[~lift]) == pytest.approx(0.0, abs=1e-9)
    assert swing.potential[lift][-1] > 0.9 * swing.work[lift][-1]


@pytest.mark.parametrize('name', ['swing', 'driven'])
def test_terms_add_up_and_are_those_of_the_model(name, request):
    motion = request.getfixturevalue(name)
    total = sum(motion.terms[term] for term in TERMS)
    npt.assert_allclose(total, motion.terms['effort'], rtol=0.0, atol=1e-8)
    dynamics = ArmDynamics(motion.arm)
    for k in range(0, len(motion.times), 7):
        state = motion.position[k], motion.velocity[k], motion.acceleration[k]
        npt.assert_allclose(
            motion.terms['effort'][k], dynamics.inverse_dynamics(*state), rtol=0.0, atol=1e-8)


def test_an_arm_with_limits_stays_within_them(driven):
    limits = driven.arm.limits
    assert driven.driven.all()
    assert (driven.position > limits.lower).all()
    assert (driven.position < limits.upper).all()
    assert np.ptp(driven.position, axis=0).min() > 0.05


def test_measured_efforts_are_split_into_the_model_and_the_rest(swing):
    rng = np.random.default_rng(1)
    measured = swing.terms['effort'] + rng.normal(0.0, 1.0, swing.position.shape)
    motion = motion_of(
        swing.arm, swing.times, swing.position, swing.velocity, swing.acceleration, measured,
        swing.driven)
    total = sum(motion.terms[term] for term in (*TERMS, 'residual'))
    npt.assert_allclose(total, measured, rtol=0.0, atol=1e-9)
    npt.assert_array_equal(motion.terms['effort'], measured)
    again = motion_of(
        swing.arm, swing.times, swing.position, swing.velocity, swing.acceleration, None,
        swing.driven)
    npt.assert_allclose(again.heat, swing.heat, rtol=0.02, atol=0.1)


def test_friction_of_the_description_is_kept():
    arm = load_arm(default_arm_urdf())
    arm = arm.with_friction(make_friction(arm.joint_names, [0.7]))
    npt.assert_array_equal(simulate_motion(arm, 0.5, 10.0).arm.friction.viscous, [0.7, 0.7])


@pytest.mark.parametrize(('seed', 'lean'), [(0, 0.0), (1, 1.0)])
def test_hanging_is_at_rest_and_nowhere_is_lower(seed, lean):
    arm = load_arm(on_a_turned_base(urdf_of(random_chain(seed, 3)), (0.0, lean, 0.0)))
    body = ArmDynamics(arm).rigid_body
    hanging = lowest_position(arm)
    npt.assert_allclose(body.gravity(hanging), 0.0, atol=1e-7)
    others = np.random.default_rng(seed).uniform(-np.pi, np.pi, (300, arm.joint_count))
    assert body.potential_energy(hanging) <= min(map(body.potential_energy, others))
