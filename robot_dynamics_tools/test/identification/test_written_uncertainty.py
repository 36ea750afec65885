# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The covariance that `identify` writes: deviations of efforts that agree with their errors."""

from arm_motions import fourier_motion, moves_with_pauses
from identification_bench import (
    changed_arm,
    lugre_friction,
    recorded,
    rigid_effort,
    ROTORS,
    smooth_friction,
)
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.model.regressor import random_states, TorqueRegressor
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.identification.identified_arm import (
    fitted_urdf,
    parameter_file,
    parameter_values,
)
from robot_dynamics_tools.identification.pipeline import base_parameters_of, identify
from robot_dynamics_tools.identification.written_uncertainty import uncertainty_values
from robots import robot_urdf

ARM = load_arm(default_arm_urdf())
TRUE = changed_arm(ARM, 0.3)
NOISE = np.array([1.0, 0.5])


def effort_of(states):
    return rigid_effort(TRUE, states, ROTORS) + smooth_friction(states.v)


def identified(seed, states, noise=NOISE):
    """Return the identification, and the values of its parameter file."""
    found = identify(ARM, [recorded(ARM, states, effort_of(states), noise, seed)])
    return found, {**parameter_values(ARM, found.models.consistent), **uncertainty_values(found)}


def loaded(found, values):
    urdf = fitted_urdf(default_arm_urdf(), ARM, found.models.consistent)
    return arm_from_parameters(urdf, values)


@pytest.fixture(scope='module')
def cases():
    states = fourier_motion(ARM, 100.0, 30.0)
    return [identified(seed, states) for seed in range(3)]


def test_errors_at_new_states_agree_with_the_deviations(cases):
    """At states of another motion; near rest, the selected width of the friction matters more."""
    new = fourier_motion(ARM, 5.0, 20.0, seed=7)
    true, z = effort_of(new), []
    for found, values in cases:
        arm = loaded(found, values)
        dynamics = ArmDynamics(arm)
        deviation = EffortDeviation(dynamics, arm.uncertainty)
        error = true - arm.given_report.effort(
            dynamics.inverse_dynamics_batch(new.q, new.v, new.a))
        z.append(error / [deviation(*state) for state in zip(new.q, new.v, new.a)])
    z = np.array(z)
    for joint in range(2):
        is_moving = np.abs(new.v[:, joint]) > 0.1
        assert 0.8 < np.sqrt(np.mean(z[:, is_moving, joint]**2)) < 1.25
        assert 0.8 < np.sqrt(np.mean(z[:, :, joint]**2)) < 1.5


def share_inside(arm, q, v, a, measured):
    """Return the shares of samples within 2 σ, (slow and fast, joints)."""
    dynamics = ArmDynamics(arm)
    deviation = EffortDeviation(dynamics, arm.uncertainty)
    sigma = np.array([deviation.prediction(*each) for each in zip(q, v, a)])
    effort = arm.given_report.effort(dynamics.inverse_dynamics_batch(q, v, a))
    is_inside = np.abs(measured - effort) <= 2.0 * sigma
    is_slow = np.abs(v) <= np.median(np.abs(v), axis=0)
    return np.array([(is_inside & part).sum(axis=0) / part.sum(axis=0)
                     for part in (is_slow, ~is_slow)])


@pytest.mark.parametrize(('motion', 'seeds'), [
    (fourier_motion, (1,)), (moves_with_pauses, (2, 3))])
def test_the_interval_contains_95_percent_of_the_recorded_and_of_other_samples(motion, seeds):
    """
    Slow and fast samples; some of the other motion are faster than the recorded ones.

    No model describes the friction of the arm, which has bristles.
    """
    motions = [motion(ARM, 100.0, 30.0, seed) for seed in seeds]
    found = identify(ARM, [recorded(
        ARM, states, effort_of(states) + lugre_friction(states), NOISE) for states in motions])
    arm = loaded(found, {
        **parameter_values(ARM, found.models.consistent), **uncertainty_values(found)})
    shown = [recording.motion for recording in found.recordings]
    share = share_inside(arm, *(
        np.concatenate([getattr(each, name) for each in shown])
        for name in ('position', 'velocity', 'acceleration', 'measured_effort')))
    assert (share > 0.9545 - 0.015).all()
    assert (share[1] < 0.98).all()
    states = motion(ARM, 100.0, 30.0, 20)
    new = recorded(ARM, states, effort_of(states) + lugre_friction(states), NOISE, 1)
    rows = np.flatnonzero(new.usable)[::5]
    shares = share_inside(arm, *(each[rows] for each in (
        new.position, new.velocity, new.acceleration, new.measured_effort)))
    assert shares.mean() == pytest.approx(0.94, abs=0.04)


def test_the_noise_is_that_of_the_recording_behind_and_before_its_filter(cases):
    for found, values in cases:
        noise = np.array(values['uncertainty.noise_deviation'])
        band = 0.898 * found.recordings[0].motion.cutoff_hz
        # white noise at 100 Hz has a band of 50 Hz; the errors of the model add to it
        ratio = noise / (NOISE * np.sqrt(band / 50.0))
        assert ((ratio > 0.9) & (ratio < 1.5)).all()
        assert noise * np.sqrt(50.0 / values['uncertainty.noise_bandwidth']) == pytest.approx(
            NOISE, rel=0.2)


def test_the_noise_of_a_short_recording_is_not_reduced_by_the_covariance():
    _, values = identified(0, fourier_motion(ARM, 100.0, 6.0))
    expected = NOISE * np.sqrt(values['uncertainty.noise_bandwidth'] / 50.0)
    assert (values['uncertainty.noise_deviation'] > 0.8 * expected).all()


def test_the_file_has_the_uncertainty_in_full(cases, tmp_path):
    found, values = cases[0]
    path = tmp_path / 'identified.yaml'
    path.write_text(parameter_file(values))
    assert max(map(len, path.read_text().splitlines())) < 100
    read = read_parameter_file(path)
    assert {name: list(value) if isinstance(value, (list, tuple)) else value
            for name, value in values.items()} == read
    a, b = (loaded(found, each).uncertainty for each in (values, read))
    assert a.root.tolist() == b.root.tolist()
    # the names are those of the joints' friction, and of base parameters
    assert {'viscous(joint1)', 'effort_offset(joint2)', 'sigmoid(joint2)'} <= set(
        read['uncertainty.parameters'])


def test_what_is_not_excited_has_the_deviation_of_the_urdf():
    # joint2 is at rest: its inertia and friction are unknown, its gravity is not
    states = fourier_motion(ARM, 100.0, 20.0)
    moves = np.array([1.0, 0.0])
    found, values = identified(0, states._replace(
        q=states.q * moves, v=states.v * moves, a=states.a * moves))
    assert 'Ia(joint2)' in found.estimate.unexcited
    assert found.estimate.condition > 1e3
    assert (found.tests['consistent'].relative() < 0.1).all()
    arm = loaded(found, values)
    deviation = EffortDeviation(ArmDynamics(arm), arm.uncertainty)
    q = np.array([0.5, 0.0])
    rest, fast = (deviation(q, np.zeros(2), a) for a in (np.zeros(2), np.array([0.0, 5.0])))
    assert fast[1] > 10.0 * rest[1]
    assert np.isfinite(fast).all()


def test_the_base_parameters_are_those_of_any_direction_of_gravity():
    arm = load_arm(robot_urdf('ur10'))
    tilted = arm.with_gravity((3.0, 4.0, -8.0))
    q, v, a = random_states(tilted, 5, seed=4)
    Y = np.concatenate([TorqueRegressor(tilted)(q, v, a), a[:, :, np.newaxis] * np.eye(6)], axis=2)

    def largest_error(base):
        return np.abs(Y - Y[:, :, base.columns] @ base.matrix).max()

    directions = ((0.0, 0.0, 0.0), *(9.81 * np.eye(3)).tolist())
    assert largest_error(base_parameters_of(arm, directions)) < 1e-3
    assert largest_error(base_parameters_of(arm)) > 1.0
