# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What is attached to a link: recovery of hidden loads, coverage, verdicts."""

from dataclasses import replace

import numpy as np
from payload_bench import (
    Case,
    CUTOFF,
    errors_in_deviations,
    estimated,
    hidden_load,
    holds,
    measured,
    motion,
    sagging,
    Samples,
    samples_of,
    with_compensated_friction,
)
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_calibration import make_effort_calibration
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.effort_deviation import EffortDeviation, make_uncertainty
from robot_dynamics.model.payload import make_payload
from robot_dynamics.model.regressor import parameter_names
from robot_dynamics_tools.payload_estimation import PayloadEstimate, PayloadEstimator
from robot_dynamics_tools.payload_estimation.advice import advise, Knowledge
from robots import robot_urdf

# --- recovery ------------------------------------------------------------------------------------

@pytest.mark.parametrize(('name', 'kind'), [
    ('ur10', 'singles'), ('panda', 'pairs'), ('xarm7', 'motion'), ('default', 'pairs'),
    ('default', 'motion')])
def test_a_hidden_load_is_recovered(name, kind):
    """Mass within 2 % or 20 g, moments within 1 cm × mass; small deviations."""
    case = hidden_load(name, seed=1)
    samples = samples_of(case, kind)
    estimate = estimated(case, samples, measured(case, samples))
    truth = case.load.body.toDynamicParameters()
    values, deviations = estimate.values, estimate.deviations
    assert abs(values[0] - truth[0]) <= max(0.02 * truth[0], 0.02)
    assert (np.abs(values[1:4] - truth[1:4]) <= 0.01 * truth[0]).all()
    assert all(deviation < 0.05 for deviation, verdict in zip(deviations[:4], estimate.verdicts)
               if verdict == 'observable')
    assert estimate.is_observable
    assert (estimate.pairs > estimate.singles) == (kind == 'pairs')


def test_holds_from_both_directions_are_free_of_friction():
    # friction five times as large, and unknown to the model
    case = hidden_load('ur10', seed=2, friction=0.05)
    samples = holds(case, 6, both_sides=True)
    effort = measured(case, samples)
    known = estimated(case, samples, effort)
    assert 'averaged' in known.friction
    ignorant = case._replace(arm=case.arm.with_friction(load_arm(robot_urdf('ur10')).friction))
    unknown = estimated(ignorant, samples, effort)
    assert unknown.friction.endswith('has no dry friction') or unknown.singles == 0
    for estimate in (known, unknown):
        assert estimate.mass == pytest.approx(case.load.mass, abs=4.0 * estimate.deviations[0])
        assert estimate.deviations[0] < 0.2


@pytest.mark.parametrize(('name', 'kind', 'count'), [
    ('ur10', 'pairs', 3), ('panda', 'motion', 5)])
def test_the_uncertainty_of_the_model_is_in_the_deviations(name, kind, count):
    """Errors of 0.1 kg and 0.02 kg·m of each link, with the covariance as `identify` writes it."""
    known, ignored = list[float](), list[float]()
    for seed in range(count):
        case = hidden_load(name, seed)
        samples = samples_of(case, kind)
        names = [one for one in parameter_names(case.arm) if one.startswith('m')]
        deviations = np.where([one.startswith('m(') for one in names], 0.1, 0.02)
        uncertainty = make_uncertainty(
            case.arm, names, np.diag(deviations**2)[np.tril_indices(len(names))].tolist())
        arm = replace(case.arm, uncertainty=uncertainty)
        errors = EffortDeviation(ArmDynamics(arm), uncertainty).errors(
            samples.q, samples.v, samples.a)
        effort = measured(case, samples) + errors @ np.random.default_rng(seed).normal(
            size=errors.shape[2])
        for squares, one in ((known, case._replace(arm=arm)), (ignored, case)):
            estimate = estimated(one, samples, effort)
            squares += [
                error**2 for i, error in errors_in_deviations(one, estimate).items() if i < 4]
            assert any('mass of the arm' in remark for remark in estimate.remarks) == (
                squares is ignored)
    assert 0.3 < np.mean(known) < 2.0
    assert np.mean(ignored) > 3.0


def test_friction_that_the_controller_compensates_is_in_the_deviations():
    squares = list[float]()
    for seed in range(5):
        case = hidden_load('ur10', seed)
        samples = with_compensated_friction(case, holds(case, 8, both_sides=True))
        estimate = estimated(case, samples, measured(case, samples))
        assert estimate.pairs > 0
        squares += [error**2 for i, error in errors_in_deviations(case, estimate).items() if i < 4]
    assert 0.4 < np.mean(squares) < 2.0


def test_friction_that_supports_the_load_of_a_sagging_arm_is_in_the_deviations():
    load = make_payload('tool0', 3.0, (0.05, 0.0, 0.1))
    case = hidden_load('ur10', seed=3)._replace(load=load)
    samples = sagging(case, holds(case, 8, both_sides=True))
    estimate = estimated(case, samples, measured(case, samples))
    assert estimate.pairs < 3  # a joint that yields from both sides ends in one direction
    assert estimate.singles > 90
    errors = errors_in_deviations(case, estimate)
    assert max(abs(errors.get(i, 0.0)) for i in range(4)) < 3.0
    assert abs(estimate.mass - 3.0) < 3.0 * estimate.deviations[0]


# --- verdict and advice --------------------------------------------------------------------------

POSE = np.array([0.3, -1.2, 1.0, -0.9, 0.0, 0.4])


def at_rest(case: Case, position: np.ndarray = POSE) -> PayloadEstimate:
    """Return the estimate of one hold of a pose, with its advice."""
    samples = one_hold(case, position)
    return estimated(case, samples, measured(case, samples), with_advice=True)


def one_hold(case: Case, position: np.ndarray, seconds: float = 2.0) -> Samples:
    t = np.arange(0.0, seconds, 0.04)
    zero = np.zeros((len(t), case.arm.joint_count))
    return Samples(t, zero + position, zero, zero, zero)


def test_one_hold_leaves_moments_open_and_the_advice_closes_them():
    case = hidden_load('ur10', seed=3, friction=0.0005)._replace(
        load=make_payload('tool0', 2.0, (0.05, -0.03, 0.1)))
    samples, first = one_hold(case, POSE), at_rest(case)
    assert not first.is_observable
    assert set(first.verdicts[4:]) == {'not observable'}  # the inertia
    assert any('accelerate' in one and 'Izz' in one for one in first.advice)
    assert first.deviations[4] > 50.0
    with pytest.raises(InvalidInputError, match='expected mass and first moments to be obser'):
        first.payload()
    assert first.advice
    assert all('move ' in one or 'hold the poses' in one for one in first.advice[:1])
    # the advice of a single joint: the same estimator, after that joint has moved
    estimator = PayloadEstimator(case.arm, case.link, CUTOFF, 0.0)
    estimator.add(*samples[:4], measured(case, samples))
    position, t = POSE, samples.t
    for i in range(6):
        estimate = estimator.estimate()
        if estimate.is_observable:
            break
        position = followed(case, estimate.advice[0], position)
        t = t + 100.0
        more = one_hold(case, position)
        estimator.add(t, *more[1:4], measured(case._replace(seed=i), more))
    assert 0 < i < 6
    final = estimator.estimate()
    assert final.is_observable
    assert (final.deviations[:4] < 0.1 * first.deviations[:4]).sum() >= 2
    errors = errors_in_deviations(case, final)
    assert max(abs(errors[k]) for k in range(4)) < 4.0


def followed(case: Case, advice: str, position: np.ndarray) -> np.ndarray:
    """Return the pose that an advice names first."""
    if 'hold the poses (' in advice:
        return np.array([float(one) for one in advice.split('(')[1].split(')')[0].split(',')])
    if 'present pose' in advice:
        return position
    joint = case.arm.joint_names.index(advice.split("'")[1])
    changed = position.copy()
    changed[joint] = float(advice.split('(to ')[1].split(')')[0])
    return changed


def test_advised_poses_and_accelerations_are_within_the_limits():
    # dry friction of a tenth of the limits: one joint does not suffice
    case = hidden_load('ur10', seed=3, friction=0.1)
    limits, advice = case.arm.limits, at_rest(case).advice
    poses = [one for one in advice if 'hold the poses (' in one]
    accelerations = [one for one in advice if 'accelerate' in one]
    assert poses
    assert accelerations
    for one in poses:
        pose = followed(case, one, POSE)
        assert (np.abs(pose) <= limits.upper).all()
        assert (np.abs(RigidBody(case.arm).gravity(pose)) <= limits.effort).all()
    for one in accelerations:
        amplitude = float(one.split('amplitude of ')[1].split()[0])
        for name in one.split("'")[1::2]:
            joint = case.arm.joint_names.index(name)
            assert amplitude / (2.0 * np.pi) <= limits.velocity[joint]


def test_the_arm_can_hold_advised_poses_with_the_estimated_load():
    """The last joints have 5 N·m, and the load up to 8 N·m."""
    case = hidden_load('ur10', seed=3)
    limits = case.arm.limits
    weak = replace(case.arm, limits=replace(
        limits, effort=np.minimum(limits.effort, [330.0, 330.0, 150.0, 5.0, 5.0, 5.0])))
    load = make_payload(case.link, 2.5, [0.0, 0.2, 0.25])
    position = np.array([0.3, -1.2, 1.0, -1.4, 0.0, 0.4])
    variances = {kind: np.full(6, 100.0) for kind in ('single', 'paired', 'motion')}
    advice = advise(weak, case.link, range(4), Knowledge(
        load.body.toDynamicParameters(), 1e-6 * np.eye(10), np.full(10, 0.05), position,
        variances, 0.2))
    loaded = RigidBody(weak.with_payloads([load]))
    case = case._replace(arm=weak)
    poses = [followed(case, one, position) for one in advice]
    assert poses
    for pose in poses:
        assert (np.abs(loaded.gravity(pose)) <= weak.limits.effort + 0.1).all()


def test_a_planar_arm_has_parameters_without_effect():
    case = hidden_load('default', seed=0)
    samples = motion(case, 20.0)
    estimate = estimated(case, samples, measured(case, samples, noise=0.001))
    assert estimate.verdicts == (
        'observable', 'observable', 'no effect', 'observable', 'no effect', 'no effect',
        'observable', 'no effect', 'no effect', 'no effect')
    assert estimate.payload().mass == pytest.approx(case.load.mass, rel=0.02)


def test_the_payload_of_an_estimate_has_the_efforts_of_the_load():
    case = hidden_load('xarm7', seed=5)
    samples = motion(case, 30.0)
    estimate = estimated(case, samples, measured(case, samples, noise=1e-5))
    assert estimate.has_inertia
    assert estimate.payload().inertia == pytest.approx(case.load.inertia, abs=1e-3)
    assert estimate.com == pytest.approx(case.load.com, abs=1e-3)


def test_too_large_efforts_change_the_mass_as_stated():
    case = hidden_load('ur10', seed=6)
    samples = holds(case, 6, both_sides=True)
    right = estimated(case, samples, measured(case, samples, noise=0.0))
    wrong = estimated(case, samples, measured(case, samples, noise=0.0, gain=1.02))
    change = wrong.values[:4] - right.values[:4]
    assert change == pytest.approx(2.0 * right.per_percent[:4], abs=0.02)
    assert abs(change[0]) > 0.1  # 2 % of the efforts of the arm itself
    assert any('torque constant' in remark for remark in wrong.remarks)


@pytest.mark.parametrize('name', ['ur10', 'panda'])
def test_drives_that_were_not_calibrated_are_in_the_deviations(name):
    """Scales up to 30 % and offsets up to 3 % of the limit off; one hold does not suffice."""
    squares = list[float]()
    for seed in range(4):
        case = hidden_load(name, seed)
        rng, samples = np.random.default_rng(seed), holds(case, 8, both_sides=True)
        n, limit = case.arm.joint_count, case.arm.limits.effort
        scale, offset = rng.uniform(0.7, 1.3, n), rng.uniform(-0.03, 0.03, n) * limit
        found = estimated(
            case, samples, measured(case, samples) / scale + offset, scale_deviation=0.3)
        squares += [error**2 for i, error in errors_in_deviations(case, found).items() if i < 4]
    assert any('torque constant' in remark for remark in found.remarks)
    assert 0.2 < np.mean(squares) < 2.0
    short = one_hold(case, np.zeros(n))
    alone = estimated(case, short, measured(case, short), True, scale_deviation=0.3)
    assert alone.verdicts[0] == 'not observable'
    assert 'calibrate_gravity' in alone.advice[0]


def test_impossible_estimates_are_reported_and_not_clipped():
    case = hidden_load('ur10', seed=7)
    heavy = case._replace(arm=case.arm.with_payloads([replace(case.load, mass=2.0)]))
    samples = holds(case, 6, both_sides=False)
    bare = case._replace(load=make_payload('tool0', 0.0))
    estimate = estimated(heavy, samples, measured(bare, samples))
    assert estimate.mass == pytest.approx(-2.0, abs=0.1)
    assert 'expected a mass > 0' in estimate.implausible[0]
    with pytest.raises(InvalidInputError, match='the estimate is implausible: m is -'):
        estimate.payload()


def test_samples_beyond_all_bounds_are_rejected_and_change_nothing():
    case = hidden_load('ur10', seed=1)
    samples = one_hold(case, np.zeros(6))
    effort = measured(case, samples)
    estimator = PayloadEstimator(case.arm, case.link, CUTOFF)
    estimator.add(*samples[:4], effort)
    before = estimator.estimate().values
    for value in (np.nan, np.inf, 1e200):
        v = samples.v.copy()
        v[-1, 2] = value
        with pytest.raises(InvalidInputError, match='beyond all bounds'):
            estimator.add(samples.t + 10.0, samples.q, v, samples.a, effort)
    assert estimator.estimate().values.tolist() == before.tolist()


def test_samples_in_parts_give_the_estimate_of_all_samples():
    """Without samples nothing is observable."""
    case = hidden_load('panda', seed=1)
    samples = holds(case, 3, both_sides=True)
    effort = measured(case, samples)
    estimator = PayloadEstimator(case.arm, case.link, CUTOFF, 0.0)
    empty = estimator.estimate()
    assert set(empty.verdicts) == {'not observable'}
    assert empty.duration == 0.0
    for i in range(0, len(effort), 7):
        part = slice(i, i + 7)
        estimator.add(*(one[part] for one in samples[:4]), effort[part])
    whole = estimated(case, samples, effort)
    assert estimator.estimate().values == pytest.approx(whole.values, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(('kind', 'name'), [('pairs', 'ur10'), ('motion', 'panda')])
def test_the_deviations_contain_the_errors_of_a_calibration(kind, name):
    """Those of drives that are taken as exact do not."""
    known, ignored = list[float](), list[float]()
    for seed in range(3):
        exact = hidden_load(name, seed)
        samples, n, limit = samples_of(exact, kind), exact.arm.joint_count, exact.arm.limits.effort
        C = np.zeros((2 * n, 2 * n))  # a part of the error is that of the weight, common to all
        C[:n, :n] = 0.003**2 * (0.5 * np.ones((n, n)) + 0.5 * np.eye(n))
        C[n:, n:] = np.diag((0.0005 * limit)**2)
        drive = make_effort_calibration(exact.arm.joint_names, [1.0], [0.0], limit, C)
        error = np.random.default_rng(seed + 40_000).multivariate_normal(np.zeros(2 * n), C)
        effort = measured(exact, samples) * (1.0 + error[:n]) - error[n:]
        calibrated = exact._replace(arm=replace(exact.arm, report=drive))
        for squares, case in ((known, calibrated), (ignored, exact)):
            estimate = estimated(case, samples, effort)
            squares += [
                error**2 for i, error in errors_in_deviations(case, estimate).items() if i < 4]
            assert squares is ignored or not any(
                'torque constant' in remark for remark in estimate.remarks)
    assert 0.4 < np.mean(known) < 2.0
    assert np.mean(ignored) > 2.0
