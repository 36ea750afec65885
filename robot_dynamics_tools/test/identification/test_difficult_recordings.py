# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""
Identification from recordings that do not determine all parameters; the arms are known.

Recordings of different arms, and of an arm with the URDF of another, are named. The verdict of
`identify` on a joint follows from the residuals of three models.
"""

from arm_motions import fourier_motion, moves_with_pauses, States
from identification_bench import (
    changed_arm,
    lugre_friction,
    one_way,
    recorded,
    rigid_effort,
    series_of,
)
import numpy as np
import pytest
from recordings import needs_ur10, UR10
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.regressor import inertial_parameters, random_states
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.gravity_ratio import far_from_urdf, gravity_ratios
from robot_dynamics_tools.analysis.motion_filter import filter_motion, FilteredMotion
from robot_dynamics_tools.identification.bag_identification import BagIdentification
from robot_dynamics_tools.identification.identified_arm import fitted_friction, fitted_offset
from robot_dynamics_tools.identification.page import in_other_poses, joint_verdict, joint_verdicts
from robot_dynamics_tools.identification.pipeline import Identification, identify
from robot_dynamics_tools.identification.report import as_data
from robot_dynamics_tools.identification.steps import evaluate_motion
from robot_dynamics_tools.identification.summary import bounds_by_joint, not_separable, warnings
from robot_dynamics_tools.reporting.text_table import percent
from robots import arm_without_gripper, robot_urdf
from scipy.signal import butter, sosfilt

UR5 = load_arm(robot_urdf('ur5'), ['shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'])
"""The wrists are locked: a joint costs time, and shows nothing new."""
PANDA = arm_without_gripper('panda')
FRICTION_FACTOR, MODEL_ERROR = 5.0, 0.03


def imperfect_effort(states, seed):
    """Return the effort of an arm with LuGre friction, and an error of 3 % that depends on q."""
    effort = rigid_effort(changed_arm(UR5, 0.3, seed), states)
    effort += FRICTION_FACTOR * lugre_friction(states, seed)
    return effort * (1.0 + MODEL_ERROR * np.sin(3.0 * states.q))


def noisy(states, effort, seed):
    noise = 0.02 * np.sqrt(np.mean(effort**2, axis=0))
    return recorded(UR5, states, effort, noise, seed)


# --- one direction of motion ---------------------------------------------------------------------

@pytest.mark.parametrize(('joint', 'seed'), [
    (2, 2), pytest.param(0, 0, marks=pytest.mark.soak),
    pytest.param(1, 0, marks=pytest.mark.soak)])
def test_a_joint_that_moves_in_one_direction(joint, seed):
    name = UR5.joint_names[joint]
    states = one_way(fourier_motion(UR5, 125.0, 30.0, seed), joint, seed)
    effort = imperfect_effort(states, seed)
    v = states.v[:, joint]
    assert np.mean(v < -1e-3) > 0.92
    assert not (v > 1e-3).any()
    found = identify(UR5, [noisy(states, effort, seed)])
    friction = fitted_friction(UR5, found.models.consistent)
    true = FRICTION_FACTOR * np.median(np.abs(lugre_friction(states, seed)[:, joint]))
    assert friction.counterpart('friction')[joint] == pytest.approx(true, rel=0.2)
    assert fitted_offset(found.models.consistent)[joint] == 0.0
    assert not_separable(found) == {name: ('offset',)}
    assert any(line.startswith(f'{name}: the joint moves in one direction only (0 % of its motion '
                               'forward, 100 % backward)') for line in warnings(found))
    # On a recording in which the joint moves in both directions, the model predicts more than
    # the URDF.
    other = fourier_motion(UR5, 125.0, 30.0, seed + 10)
    tests = evaluate_motion(UR5, noisy(
        other, imperfect_effort(other, seed), seed), 0.0, found.models.by_name)
    assert tests['consistent'].relative()[joint] < 0.7 * tests['urdf'].relative()[joint]
    assert tests['consistent'].relative().mean() < 0.2 * tests['urdf'].relative().mean()


def test_opposite_one_way_recordings_together_separate_the_offset():
    joint, seed = 2, 0
    motions = []
    for sign in (1.0, -1.0):
        states = one_way(fourier_motion(UR5, 125.0, 30.0, seed), joint, seed)
        for each in (states.q, states.v, states.a):
            each[:, joint] *= sign
        motions.append(noisy(states, imperfect_effort(states, seed), seed))
    assert not_separable(identify(UR5, motions)) == {}


def test_one_speed_does_not_separate_viscous_from_dry_friction():
    """A triangle wave at 0.2 rad/s: filtered slowly, so that only its corners are round."""
    joint, seed = 2, 0
    states = fourier_motion(UR5, 125.0, 60.0, seed)
    period = 24.0
    phase = np.mod(states.times / period, 1.0)
    states.q[:, joint] = 0.2 * period * np.abs(phase - 0.5)
    states.v[:, joint] = np.where(phase < 0.5, -0.2, 0.2)
    states.a[:, joint] = 0.0
    effort = imperfect_effort(states, seed)
    found = identify(UR5, [noisy(states, effort, seed)])
    assert not_separable(found) == {UR5.joint_names[joint]: ('viscous friction',)}
    friction = fitted_friction(UR5, found.models.consistent)
    assert friction.viscous[joint] == 0.0
    assert 0.0 < friction.counterpart('friction')[joint] < np.abs(effort[:, joint]).max()


def test_a_joint_at_rest_has_no_friction():
    joint, seed = 2, 0
    states = fourier_motion(UR5, 125.0, 30.0, seed)
    states.q[:, joint] = 0.5 + 1e-4 * np.sin(states.times)
    states.v[:, joint], states.a[:, joint] = 1e-4 * np.cos(states.times), 0.0
    found = identify(UR5, [noisy(states, imperfect_effort(states, seed), seed)])
    assert not_separable(found) == {UR5.joint_names[joint]: ('viscous friction', 'dry friction')}
    friction = fitted_friction(UR5, found.models.consistent)
    for values in (
            friction.viscous, friction.coulomb, friction.sigmoid, friction.load_coefficient):
        assert values[joint] == 0.0


# --- bounds --------------------------------------------------------------------------------------

def test_a_bound_that_acts_is_reported():
    """The effort of one joint lags its acceleration, as if its rotor had a negative inertia."""
    joint, seed = 1, 1
    states = fourier_motion(UR5, 125.0, 30.0, seed)
    effort = rigid_effort(changed_arm(UR5, 0.2, seed), states) + 2.0 * np.tanh(states.v / 0.1)
    effort[:, joint] -= 0.4 * states.a[:, joint]
    found = identify(UR5, [noisy(states, effort, seed)])
    assert found.models.consistent.joint_values[joint, 0] == 0.0
    bounds = {bound.parameter: bound for bound in bounds_by_joint(found)[joint]}
    assert bounds['reflected inertia'].value == 0.0
    assert bounds['reflected inertia'].unbounded == pytest.approx(-0.4, abs=0.1)
    base, unbounded = (found.tests[name].relative()[joint] for name in ('base', 'unbounded'))
    assert unbounded < 0.8 * base
    text = (f'{UR5.joint_names[joint]}: bounds act: reflected inertia 0 instead of '
            f'{bounds["reflected inertia"].unbounded:.3g} kg·m²')
    assert any(line.startswith(text) and percent(unbounded) in line for line in warnings(found))
    one, = as_data(BagIdentification(found, (), ()))['active_bounds']
    assert (one['joint'], one['parameter']) == ('shoulder_lift_joint', 'reflected inertia')


# --- a high rate ---------------------------------------------------------------------------------

def test_the_cutoff_of_a_short_motion_at_1_khz():
    """
    The cut-off of 4.7 s of moves of a Panda is near the band of the motion.

    The velocity noise of two joints is small, and its spectrum ends at 60 Hz, so that the power of
    acceleration has its global minimum far above the band of the motion.
    """
    rate = 1000.0
    states = moves_with_pauses(PANDA, rate, 4.7)
    rng = np.random.default_rng(0)
    velocity = states.v + 2e-5 * rng.normal(size=states.v.shape)
    sections = butter(6, 60.0, fs=rate, output='sos')
    for joint in (4, 6):
        noise = sosfilt(sections, rng.normal(size=len(velocity)))
        velocity[:, joint] = states.v[:, joint] + 2e-4 * noise / noise.std()
    q = states.q + 1e-6 * rng.normal(size=velocity.shape)
    series = series_of(PANDA, states._replace(q=q, v=velocity), None)
    assert 5.0 < filter_motion(series).cutoff_hz < 30.0


# --- short recordings ----------------------------------------------------------------------------

def test_ten_short_recordings_are_pooled():
    """Each has fewer samples than the six blocks of a long one; the arm is off by 20 %."""
    states = fourier_motion(UR5, 100.0, 40.0, 3)
    effort = rigid_effort(changed_arm(UR5, 0.2, 3), states) + lugre_friction(states, 3)
    motions = []
    for i in range(10):
        part = slice(400 * i, 400 * i + 200)
        noise = 0.05 * np.random.default_rng(i).normal(size=effort[part].shape)
        motions.append(filter_motion(series_of(
            UR5, States(*(each[part] for each in states)), effort[part] + noise), 5.0))
    with pytest.raises(InvalidInputError, match=r'have \d+ samples for training together'):
        identify(UR5, motions[:1])
    tests = identify(UR5, motions).tests
    assert tests['consistent'].samples == (1200, 800)
    assert (tests['consistent'].relative() < 0.6 * tests['urdf'].relative()).all()
    assert tests['consistent'].relative()[:3].max() < 0.1


RATE, DURATION = 125.0, 20.0


def shortened(name: str) -> ArmModel:
    """Return the arm with its first three joints; the others are locked."""
    return load_arm(robot_urdf(name), arm_without_gripper(name).joint_names[:3])


def recorded_arm(name: str, urdf: str, seed: int) -> FilteredMotion:
    """Return a motion of an arm whose masses differ from its URDF, read with another URDF."""
    arm = shortened(name)
    states, limit = fourier_motion(arm, RATE, DURATION, seed), arm.limits.effort
    effort = rigid_effort(changed_arm(arm, 0.15), states, 0.005 * limit) + 0.02 * limit * (
        0.5 * states.v + np.tanh(states.v / 0.03))
    noise = 0.004 * limit * np.random.default_rng(seed).normal(size=effort.shape)
    return filter_motion(series_of(shortened(urdf), states, effort + noise))


def identified(urdf: str, *names: str) -> Identification:
    recordings = [recorded_arm(name, urdf, k) for k, name in enumerate(names)]
    return identify(shortened(urdf), recordings)


def named(found: Identification) -> list[int]:
    """Return the numbers of the recordings that contradict the others."""
    return [k for k, each in enumerate(found.recordings)
            if any('contradicts the other' in cause for cause in each.contradictions)]


@pytest.mark.parametrize(('urdf', 'names', 'odd'), [
    ('ur10', ('ur10', 'ur10', 'ur10'), []), ('ur10', ('ur10', 'ur5', 'ur10'), [1]),
    ('ur10', ('ur5', 'ur10'), [0, 1])])
def test_the_recording_of_another_arm_is_named(urdf, names, odd):
    assert named(identified(urdf, *names)) == odd


@pytest.mark.parametrize(('urdf', 'name', 'is_far'), [
    ('ur5', 'ur10', True), ('ur10', 'ur5', True), ('default', 'default', False), *(
        pytest.param(name, name, False, marks=pytest.mark.soak) for name in ('ur10', 'panda'))])
def test_the_urdf_of_another_arm_is_named(urdf, name, is_far):
    (recording,) = identified(urdf, name).recordings
    causes = recording.contradictions
    assert ['another URDF' in cause for cause in causes] == [True] * is_far


@pytest.mark.soak
@needs_ur10
@pytest.mark.parametrize(('urdf', 'is_far'), [('ur10', False), ('ur5', True)])
def test_the_urdf_of_another_arm_is_named_for_a_real_arm(urdf, is_far):
    read = read_for_arm(UR10, AnalysisSettings(urdf=robot_urdf(urdf)))
    (recording,) = identify(read.arm, [filter_motion(read.series)]).recordings
    causes = recording.contradictions
    assert ['another URDF' in cause for cause in causes] == [True] * is_far


@pytest.mark.parametrize('factor', [0.3, 1.0, 1.9, 2.1])
def test_the_gravity_ratio_of_heavier_bodies_is_the_ratio_of_their_masses(factor):
    arm = arm_without_gripper('ur10')
    ratios = gravity_ratios(arm, factor * inertial_parameters(arm), random_states(arm, 20)[0])
    # shoulder_pan is vertical, and the last wrist bears nothing
    assert ratios == pytest.approx(np.array([1.0, factor, factor, 1.0, 1.0, 1.0]))
    assert bool(far_from_urdf(arm.joint_names, ratios)) == (not 0.5 <= factor <= 2.0)


@pytest.mark.parametrize(('residuals', 'grade', 'words', 'step'), [
    ((0.99, 0.08, 0.05), Grade.GOOD, 'friction dominates', 'identified.yaml'),
    ((0.30, 0.25, 0.05), Grade.GOOD, 'predicts the effort: residual 5.0 %', 'identified.yaml'),
    ((1.00, 0.247, 0.246), Grade.CHECK, 'identified masses do not improve', 'standstills'),
    ((1.00, 0.80, 0.30), Grade.CHECK, 'predicts most of the effort', 'longer motion'),
    ((0.50, 0.04, 0.08), Grade.CHECK, 'the URDF with friction predicts the effort better',
     'longer motion'),
    ((0.47, 0.90, 4.25), Grade.BAD, 'the URDF predicts the effort better', 'longer motion'),
    ((1.00, 0.95, 0.90), Grade.BAD, 'explains less than half', '--effort current'),
    ((float('nan'),) * 3, Grade.UNKNOWN, 'measured effort is zero', 'driver'),
])
def test_the_verdict(residuals, grade, words, step):
    found = joint_verdict('joint', *residuals)
    assert found.grade is grade
    assert words in found.text
    assert step in found.next_step


def test_friction_dominates_only_if_it_removes_half_of_the_mean_square():
    assert 'friction' in joint_verdict('joint', 0.4, 0.28, 0.05).text
    assert 'friction' not in joint_verdict('joint', 0.4, 0.29, 0.05).text


def test_a_good_joint_is_uncertain_if_its_effort_in_other_poses_is():
    good, bad = (joint_verdict('joint', 1.0, 0.95, one) for one in (0.05, 0.9))
    assert in_other_poses(good, 0.1) is good
    assert in_other_poses(bad, 9.9) is bad
    found = in_other_poses(good, 0.2)
    assert found.grade is Grade.CHECK
    assert found.text == (
        f'{good.text}; in other poses its effort at rest is known within ± 40.0 % of this effort')
    assert 'more poses' in found.next_step


@pytest.mark.parametrize(('size', 'names'), [(1.0, []), (0.08, ['shoulder_lift_joint'])])
def test_a_small_motion_leaves_other_poses_uncertain(size, names):
    """A recording of one pose says little about the others, however small its residuals are."""
    arm = shortened('ur10')
    states = fourier_motion(arm, RATE, 30.0, 0)
    centre = states.q.mean(axis=0)
    states = states._replace(
        q=centre + size * (states.q - centre), v=size * states.v, a=size * states.a)
    rng = np.random.default_rng(0)
    effort = rigid_effort(arm, states) + 0.004 * arm.limits.effort * rng.normal(
        size=states.q.shape)
    verdicts = joint_verdicts(identify(arm, [filter_motion(series_of(arm, states, effort))]))
    uncertain = [one.name for one in verdicts if 'in other poses' in one.text]
    assert set(names) <= set(uncertain)
    assert not names or all(one.grade is Grade.CHECK for one in verdicts if one.name in uncertain)
    assert bool(names) == bool(uncertain)
