# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The standard deviation of efforts by the covariance of the parameters, and of their noise.

The torque regressor times the parameters is inverse dynamics.
"""

from dataclasses import replace

from arm_motions import with_inertial_parameters
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model import regressor
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.effort_deviation import (
    EffortDeviation,
    make_uncertainty,
    uncertain_names,
)
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import inertial_parameters, random_states
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf

ARM = load_arm(default_arm_urdf())
NAMES = ('mz(link2)', 'viscous(joint1)', 'coulomb(joint2)')
COVARIANCE = (0.04, 0.003, 0.01, 0.0, 0.0, 0.09)
"""The lower triangle for NAMES."""
FRICTION = {'viscous': 1.5, 'sigmoid': 2.0, 'sigmoid_velocity': 0.1, 'load_coefficient': 0.1,
            'coulomb': 0.7}


def arm_with(bare, phi, rotors, friction):
    """Return an arm with these bodies, rotors (n,) and friction, each (n,)."""
    arm = with_inertial_parameters(bare, phi)
    arm = arm.with_friction(make_friction(arm.joint_names, **friction))
    return arm.with_actuators(make_actuators(arm.joint_names, [1.0], [1.0], rotor_inertia=rotors))


def test_the_derivatives_are_differences_of_efforts():
    bare = load_arm(robot_urdf('kinova'))
    phi, n = inertial_parameters(bare), bare.joint_count
    friction = {key: np.full(n, value) for key, value in FRICTION.items()}
    rotors = np.full(n, 0.2)
    arm = arm_with(bare, phi, rotors, friction)
    names = uncertain_names(arm)
    k = len(names)
    found = EffortDeviation(ArmDynamics(arm), make_uncertainty(
        arm, names, np.eye(k)[np.tril_indices(k)]))
    q, v, a = (each[0] for each in random_states(arm, 1, seed=2))
    X = found.derivatives(q[None], v[None], a[None])[0]

    def effort(i, step):
        """Return the effort after a change of one parameter."""
        changed = phi.copy(), rotors.copy(), {key: each.copy() for key, each in friction.items()}
        offset = np.zeros(n)
        field, _, joint = names[i].partition('(')
        if i < len(phi):
            changed[0][i] += step
        else:
            of_joints = {'Ia': changed[1], 'effort_offset': offset, **changed[2]}[field]
            of_joints[arm.joint_names.index(joint[:-1])] += step
        return ArmDynamics(arm_with(bare, *changed)).inverse_dynamics(q, v, a) + offset

    step = 1e-4
    differences = np.stack([
        (effort(i, step) - effort(i, -step)) / (2.0 * step) for i in range(k)], axis=1)
    assert pytest.approx(differences, rel=1e-5, abs=1e-6) == X
    assert found(q, v, a) == pytest.approx(np.linalg.norm(differences, axis=1), rel=1e-5)


def test_a_covariance_of_a_few_parameters():
    deviation = EffortDeviation(ArmDynamics(ARM), make_uncertainty(ARM, NAMES, COVARIANCE))
    q, v, a = np.array([0.3, 0.4]), np.array([-0.5, 0.8]), np.array([0.1, 0.2])
    X = deviation.derivatives(q[None], v[None], a[None])[0]
    C = np.array([[0.04, 0.003, 0.0], [0.003, 0.01, 0.0], [0.0, 0.0, 0.09]])
    assert deviation(q, v, a) == pytest.approx(np.sqrt(np.diag(X @ C @ X.T)), rel=1e-12)
    assert X[0, 1] == -0.5
    assert X[1, 2] == 1.0
    # around rest, the sign of a measured velocity is smooth
    slow = np.array([0.0, 0.005])
    assert 0.4 < deviation.derivatives(q[None], slow[None], a[None], smooth=True)[0, 1, 2] < 0.5
    assert deviation.derivatives(q[None], slow[None], a[None])[0, 1, 2] == 1.0


@pytest.mark.parametrize('sign', [-1.0, 1.0])
def test_the_deviation_of_friction_near_rest_and_beyond_the_recorded_speeds(sign):
    """Within 2 σ, the viscous friction of faster motion grows by 0 to 2 F_v."""
    F_v = np.array([2.0, 4.0])
    arm = ARM.with_friction(make_friction(ARM.joint_names, viscous=F_v))
    deviation = EffortDeviation(ArmDynamics(arm), make_uncertainty(
        arm, friction_deviation=[3.0, 1.0], friction_velocity=[0.1, 0.2],
        largest_velocity=[1.0, 2.0]))
    zero = np.zeros(2)
    for speed, expected in (
            ([0.0, 0.0], [3.0, 1.0]), ([0.05, 0.1], [1.5, 0.5]), ([0.1, 0.2], [0.0, 0.0]),
            ([1.0, 2.0], [0.0, 0.0]), ([1.5, 3.0], 0.5 * F_v * [0.5, 1.0])):
        assert deviation(zero, sign * np.array(speed), zero) == pytest.approx(expected)


def test_without_parameters_an_arm_has_no_uncertainty():
    urdf = default_arm_urdf()
    assert arm_from_parameters(urdf, {}).uncertainty is None
    values = {'uncertainty.parameters': NAMES, 'uncertainty.covariance': COVARIANCE}
    uncertainty = arm_from_parameters(urdf, values).uncertainty
    assert uncertainty.root @ uncertainty.root.T == pytest.approx(np.array(
        [[0.04, 0.003, 0.0], [0.003, 0.01, 0.0], [0.0, 0.0, 0.09]]), abs=1e-15)
    assert not uncertainty.noise_deviation.any()
    # names of joints that are locked have no meaning
    assert arm_from_parameters(urdf, values, ['joint1']).uncertainty is None
    noise = {'uncertainty.noise_deviation': [0.3], 'uncertainty.noise_bandwidth': 5.0}
    only_noise = arm_from_parameters(urdf, noise).uncertainty
    assert only_noise.noise_deviation.tolist() == [0.3, 0.3]
    assert not only_noise.has_covariance


@pytest.mark.parametrize(('changes', 'words'), [
    ({'parameters': ['mz(link3)']},
     "uncertainty.parameters has 'mz(link3)', expected names such as 'm(link1)' or "
     "'effort_offset(joint2)'"),
    ({'parameters': ['mz(link2)'] * 3}, "uncertainty.parameters has 'mz(link2)' twice"),
    ({'covariance': (-0.04, *COVARIANCE[1:])},
     "uncertainty.covariance of 'mz(link2)' with itself is -0.04, expected a number >= 0"),
    ({'covariance': (0.04, 0.03, *COVARIANCE[2:])},
     'uncertainty.covariance has the eigenvalue -0.5 after scaling to unit variances, expected a '
     'positive semidefinite matrix'),

    ({'noise_deviation': [0.1, -0.1]},
     "uncertainty.noise_deviation of 'joint2' is -0.1, expected"),
    ({'noise_deviation': [0.1], 'noise_bandwidth': 0.0},
     'uncertainty.noise_bandwidth is 0, expected a number > 0'),
])
def test_a_bad_uncertainty_is_rejected(changes, words):
    values = {'parameters': NAMES, 'covariance': COVARIANCE, **changes}
    with pytest.raises(InvalidInputError) as caught:
        arm_from_parameters(default_arm_urdf(), {
            'joints': ARM.joint_names,
            **{f'uncertainty.{name}': value for name, value in values.items()}})
    assert words in str(caught.value)


def test_the_state_of_the_external_effort_has_the_filtered_acceleration():
    uncertainty = make_uncertainty(ARM, NAMES, COVARIANCE)
    estimate = ExternalEffort(ArmDynamics(replace(ARM, uncertainty=uncertainty)), 10.0)
    assert estimate.state is None
    a = np.array([2.0, -1.0])
    for i in range(200):
        estimate.update(0.002, np.zeros(2), 0.002 * i * a, np.zeros(2))
    assert estimate.state[1] == pytest.approx(0.002 * 199 * a)
    assert estimate.state[2] == pytest.approx(a, rel=1e-6)


@pytest.mark.parametrize('name', ['kinova', 'tiago_pro'])
def test_the_regressor_times_the_parameters_is_inverse_dynamics(name):
    # among them continuous, prismatic and mimic joints
    arm = load_arm(robot_urdf(name))
    q, v, a = regressor.random_states(arm, 20)
    Y = regressor.TorqueRegressor(arm)(q, v, a)
    expected = RigidBody(arm).inverse_dynamics_batch(q, v, a)
    assert Y @ regressor.inertial_parameters(arm) == pytest.approx(
        expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(('name', 'link'), [
    ('panda', 'panda_leftfinger'), ('kinova', 'j2s6s200_end_effector')])
def test_the_regressor_of_a_load_times_its_parameters_is_its_effort(name, link):
    """Among them continuous, prismatic and mimic joints."""
    arm = load_arm(robot_urdf(name))
    load = make_payload(link, 2.5, (0.1, -0.05, 0.2), np.diag([0.02, 0.03, 0.04]))
    states = regressor.random_states(arm, 20)
    expected = ArmDynamics(arm.with_payloads([load])).inverse_dynamics_batch(*states) - (
        ArmDynamics(arm).inverse_dynamics_batch(*states))
    effort = regressor.LoadRegressor(arm, link)(*states) @ load.body.toDynamicParameters()
    assert effort == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
