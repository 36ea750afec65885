# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Identification of arms whose parameters are known."""

from dataclasses import replace

from arm_motions import fourier_motion, moves_with_pauses
from identification_bench import (
    changed_arm,
    F_A,
    F_B,
    F_V,
    lugre_friction,
    recorded,
    rigid_effort,
    ROTORS,
    series_of,
    smooth_friction,
    WIDTH,
)
import numpy as np
import pytest
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import inertial_parameters
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.identification.drive_gains import drive_gains, GainEstimate
from robot_dynamics_tools.identification.friction_regressor import structure
from robot_dynamics_tools.identification.identified_arm import fitted_urdf, parameter_values
from robot_dynamics_tools.identification.pipeline import base_parameters_of, identify, prior_of
from robot_dynamics_tools.identification.qr_information import merge
from robot_dynamics_tools.identification.regression import (
    correlation_time,
    model_effort,
    reduce_motion,
)
from robot_dynamics_tools.identification.regularized_fit import Problem
from robot_dynamics_tools.identification.uncertainty import estimate_parameters
from robot_dynamics_tools.pseudo_inertia import is_consistent
from robots import robot_urdf

ARM = load_arm(default_arm_urdf())
BASE, PRIOR = base_parameters_of(ARM), prior_of(ARM)
SIGMOID = structure(f'sigmoid {WIDTH}')


def true_values(arm):
    """Return the expected parameters with the friction structure SIGMOID at each joint."""
    return np.concatenate([
        BASE.matrix @ np.concatenate([inertial_parameters(arm), ROTORS]),
        *np.column_stack([F_V, F_A, F_B])])


def estimate(*motions, reference=None):
    return estimate_parameters(
        merge([reduce_motion(ARM, motion, 1.0, reference) for motion in motions]), BASE,
        Problem((SIGMOID, SIGMOID), np.ones(2), PRIOR, 1.0))


@pytest.fixture(scope='module')
def planar():
    """Return states, effort and the true planar arm, whose inertias differ from its URDF's."""
    states = fourier_motion(ARM, 100.0, 30.0)
    true = changed_arm(ARM, 0.2)
    return states, rigid_effort(true, states, ROTORS) + smooth_friction(states.v), true


@pytest.fixture(scope='module')
def found(planar):
    states, effort, _ = planar
    return identify(ARM, [recorded(ARM, states, effort, noise=0.2)])


# --- known parameters ----------------------------------------------------------------------------

def test_intervals_cover_the_truth(planar):
    # 40 recordings of one motion, with white noise of 1 N·m and 0.5 N·m
    states, effort, true = planar
    z = []
    for seed in range(40):
        one = estimate(recorded(ARM, states, effort, np.array([1.0, 0.5]), seed))
        assert one.excited.all()
        z.append((one.values - true_values(true)) / one.deviations)
    z = np.array(z)
    assert 0.92 <= np.mean(np.abs(z) < 1.96) <= 0.985
    assert np.mean(np.abs(z) < 3.0) >= 0.99
    # and the error of each parameter is explained by noise
    assert np.abs(z.mean(axis=0)).max() < 0.6


def test_the_whole_way_predicts_new_samples(planar, found):
    tests, true = found.tests, planar[2]
    assert (tests['base'].relative() < 0.02).all()
    assert (tests['consistent'].relative() < 0.02).all()
    assert (tests['base'].relative() < 0.5 * tests['urdf and friction'].relative()).all()
    assert (tests['urdf and friction'].relative() < tests['urdf'].relative()).all()
    assert tests['base'].samples == (1800, 1200)
    r = BASE.rank
    off = (found.estimate.values[:r] - true_values(true)[:r]) / found.estimate.deviations[:r]
    assert np.abs(off).max() < 4.0
    fit = found.models.consistent
    assert all(is_consistent(phi) for phi in fit.parameters.reshape(-1, 10))
    assert (np.delete(fit.joint_values, 15, axis=1) >= 0.0).all()  # column 15 is the offset


def test_the_library_computes_what_was_reported(planar, found):
    motion = recorded(ARM, *planar[:2], noise=0.2)
    fit = found.models.consistent
    arm = arm_from_parameters(
        fitted_urdf(default_arm_urdf(), ARM, fit), parameter_values(ARM, fit))
    dynamics = ArmDynamics(arm)
    q, v, a = motion.position, motion.velocity, motion.acceleration
    load = dynamics.rigid_body.inverse_dynamics_batch(q, v, a)
    along = load + dynamics.friction_along(q, v, load)
    single = dynamics.inverse_dynamics_batch(q, v, a)
    for computed, reported in zip((along, single), model_effort(ARM, motion, fit)):
        effort = arm.given_report.effort(computed)
        assert effort == pytest.approx(reported, rel=1e-8, abs=1e-7)


def test_drives_stay_in_the_parameters_with_the_offset_of_the_fit(found):
    fit = found.models.consistent
    offset = fit.joint_values[:, 15]
    report = make_effort_calibration(ARM.joint_names, [0.7, 1.3], [2.0, -1.0], ARM.limits.effort)
    command = make_effort_calibration(ARM.joint_names, [-2.0], [0.5], ARM.limits.effort)
    arm = replace(ARM.with_drive(command), report=report)
    given = {'effort.report_scale': [0.7, 1.3, 1.0], 'effort.command_scale': [-2.0] * 3}  # a hand
    values = parameter_values(arm, fit, given=given)
    assert values['effort.command_scale'] == [-2.0, -2.0]
    assert values['effort.command_offset'] == [0.5, 0.5]  # the recording has not seen it
    assert values['effort.report_scale'] == [0.7, 1.3]
    assert values['effort.report_offset'] == pytest.approx([2.0, -1.0] + offset / [0.7, 1.3])
    # τ = G s (i − o): as joint effort, the offset of the current i is G o
    values = parameter_values(arm, fit, [10.0, -5.0])
    assert values['effort.report_scale'] == [0.7, -1.3]
    assert values['effort.report_offset'] == pytest.approx([20.0, -5.0] + offset / [0.7, -1.3])
    assert values['actuator.torque_constant'] == [10.0, 5.0]
    large = fit.joint_values.copy()
    large[:, 15] = 99.0, -1.0
    values = parameter_values(ARM, replace(fit, joint_values=large))
    assert values['effort.report_offset'] == [30.0, -1.0]
    assert values['effort.report_scale'] == [1.0, 1.0]
    assert 'effort.command_offset' not in values


def test_rotors_are_written_on_the_joint_side(found):
    """Motor data stay; inertias that were given do not."""
    fit = found.models.consistent
    inertia = parameter_values(ARM, fit)['actuator.reflected_inertia']
    values = {'joints': list(ARM.joint_names), 'actuator.torque_constant': [0.1],
              'actuator.gear_ratio': [50.0], 'actuator.rotor_inertia': [1e-4]}
    written = parameter_values(arm_from_parameters(default_arm_urdf(), values), fit, given=values)
    assert {name for name in written if name.startswith('actuator.')} == {
        'actuator.reflected_inertia', 'actuator.torque_constant', 'actuator.gear_ratio'}
    again = arm_from_parameters(default_arm_urdf(), written)
    assert again.reflected_inertia == pytest.approx(inertia, rel=1e-12)


def test_four_recordings_halve_the_deviations(planar):
    motions = [recorded(ARM, *planar[:2], 1.0, seed) for seed in range(4)]
    one, four = estimate(motions[0]), estimate(*motions)
    assert np.median(four.deviations / one.deviations) == pytest.approx(0.5, rel=0.15)


# --- bad or few data -----------------------------------------------------------------------------

def test_never_worse_than_the_urdf_with_friction():
    # 30 Hz, coarse positions, no velocity, pauses, and friction outside the available structures
    arm = load_arm(robot_urdf('ur5'), ['shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'])
    states = moves_with_pauses(arm, 30.0, 40.0)
    effort = rigid_effort(changed_arm(arm, 0.2), states) + lugre_friction(states)
    noise = 0.05 * np.sqrt(np.mean(effort**2, axis=0))
    motion = recorded(arm, states, effort, noise, quantum=1e-3, has_velocity=False)
    tests = identify(arm, [motion]).tests
    for model in ('base', 'consistent'):
        change = np.log(tests[model].relative() / tests['urdf and friction'].relative())
        assert change.mean() < 0.0
        assert change.max() < np.log(1.1)
    assert tests['consistent'].relative().mean() < 0.6 * tests['urdf'].relative().mean()


def test_a_contact_counts_little(planar):
    states, effort, true = planar
    pushed = effort.copy()
    pushed[600:700, 0] += 80.0
    motion = recorded(ARM, states, pushed, 0.2)
    reference = identify(ARM, [motion], 1.0).models.by_name['base']
    expected = true_values(true)[:BASE.rank]
    plain, weighted = (
        np.abs(estimate(motion, reference=each).values[:BASE.rank] / expected - 1.0)
        for each in (None, reference))
    assert weighted.mean() < 0.5 * plain.mean()


# --- payload and gains ---------------------------------------------------------------------------


def test_errors_of_the_masses_are_in_the_deviation_and_a_known_load_removes_them():
    """A UR10 whose bodies differ from its URDF; the second recording has a load of 5 kg."""
    arm = load_arm(robot_urdf('ur10'))
    K = np.array([13.0, 13.0, 13.0, 9.0, 9.0, 9.0])
    true, load = changed_arm(arm, 0.2), make_payload('wrist_3_link', 5.0, (0.1, 0.05, 0.1))
    parts = []
    for number, loads in enumerate(([], [load])):
        states = fourier_motion(arm, 100.0, 30.0, 5 * number)
        effort = rigid_effort(true.with_payloads(loads), states) + 5.0 * np.tanh(states.v / WIDTH)
        parts.append(reduce_motion(
            arm.with_payloads(loads), recorded(arm, states, effort / K, 0.3 / K), 1.0,
            keeps_payload=True))
    alone, pair = (drive_gains(some, prior_of(arm)) for some in (parts[0], merge(parts)))
    known = alone.is_known
    assert known.any()
    assert alone.is_confounded[known].all()
    assert (np.abs(alone.gain - K) < 5.0 * alone.deviation)[known].all()
    assert (np.abs(alone.gain - K) > 5.0 * alone.noise)[known].any()
    assert pair.is_known.all()
    assert pair.gain == pytest.approx(K, rel=0.01)
    assert pair.deviation.max() < 0.05


def test_a_gain_without_a_load_cannot_be_identified():
    # The last joint of the UR10 turns a rotationally symmetric body, without gravity torque.
    arm = load_arm(robot_urdf('ur10'))
    states = fourier_motion(arm, 100.0, 20.0)
    effort = rigid_effort(arm, states) + 5.0 * np.tanh(states.v / WIDTH)
    gains = drive_gains(reduce_motion(arm, recorded(arm, states, effort, 0.3), 1.0), prior_of(arm))
    assert gains.is_known[:3].all()
    assert not gains.is_known[5]


def test_gains_that_differ_are_no_torque():
    def gains(*values, known=True):
        size = np.array(values)
        return GainEstimate(
            size, 0.01 * size, np.full(len(size), known), 0.01 * size, np.ones(len(size)))

    assert gains(0.05, 0.3, 2.0, 5.0).differ
    assert gains(1.0, 1.0, 4.1, 4.1).differ  # the median of the ratios is more than 2
    assert not gains(1.0, 1.0, 3.9, 3.9).differ
    assert not gains(1.0, 0.9, 0.1, 1.2).differ  # one wrong mass
    assert not gains(8.0, 8.5, 7.0, 9.0).differ  # one factor for all
    assert not gains(0.05, 5.0).differ  # too few joints to decide
    assert not gains(0.05, 0.3, 2.0, 5.0, known=False).differ


# --- components ----------------------------------------------------------------------------------

def test_correlated_samples_count_less():
    white = np.random.default_rng(0).normal(size=20000)
    assert correlation_time(white) == pytest.approx(1.0, abs=0.2)
    slow = np.convolve(white, np.ones(10) / 10.0, 'valid')
    assert correlation_time(slow) == pytest.approx(10.0, rel=0.3)
    assert correlation_time(np.zeros(10)) == 1.0


def test_without_effort_there_is_nothing_to_identify():
    motion = filter_motion(series_of(ARM, fourier_motion(ARM, 100.0, 20.0), None))
    with pytest.raises(RecordingError, match='has no effort'):
        identify(ARM, [motion])


@pytest.mark.filterwarnings('error')
def test_a_joint_without_effort_gives_no_information():
    states = fourier_motion(ARM, 100.0, 20.0)
    effort = rigid_effort(changed_arm(ARM, 0.2), states) + smooth_friction(states.v)
    effort[:, 1] = 0.0
    motion = recorded(ARM, states, effort, noise=np.array([0.1, 0.0]))
    found = identify(ARM, [motion])
    assert found.tests['consistent'].relative()[0] < 0.05
    assert np.isnan(found.tests['consistent'].relative()[1])
    assert not found.models.consistent.joint_values[1].any()
    own = [name for name in found.estimate.names if name.endswith('(joint2)')]
    assert set(own) <= set(found.estimate.unexcited) | {'Ia(joint2)'}
    assert found.seeming_gains.is_known.tolist() == [True, False]
