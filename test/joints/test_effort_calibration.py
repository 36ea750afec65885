# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""The effort of a drive: conversions in both directions, its limits, and mismatched inputs."""

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_calibration import EffortCalibration, make_effort_calibration
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics.planar.urdf import default_arm_urdf

NAMES = ('joint1', 'joint2', 'joint3')
LIMIT = np.array([10.0, 40.0, np.inf])
FAR = 1e6
"""A torque beyond all limits."""

laws = settings(deadline=None, derandomize=True, max_examples=50)
scales = st.lists(st.floats(0.2, 5.0), min_size=3, max_size=3)
fractions = st.floats(-0.2, 0.2)
offsets = st.tuples(
    fractions.map(lambda f: 10.0 * f), fractions.map(lambda f: 40.0 * f), st.floats(-1e3, 1e3))
torques = st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3).map(np.array)


def drive(scale: Any = (0.7, 1.3, 1.0), offset: Any = (1.0, -2.0, 0.0)) -> EffortCalibration:
    return make_effort_calibration(NAMES, scale, offset, LIMIT)


# --- conversions ---------------------------------------------------------------------------------

def test_an_effort_without_its_offset_times_the_scale_is_the_torque():
    assert drive().torque(np.array([11.0, 8.0, 5.0])) == pytest.approx([7.0, 13.0, 5.0])
    assert drive().effort(np.array([7.0, 13.0, 5.0])) == pytest.approx([11.0, 8.0, 5.0])


@laws
@given(scales, offsets, torques)
def test_the_conversions_are_inverse_for_one_and_many_samples(scale, offset, torque):
    some = EffortCalibration(np.array(scale), np.array(offset), LIMIT)
    for samples in (torque, np.tile(torque, (4, 2, 1))):
        there = some.effort(samples)
        assert there.shape == samples.shape
        assert some.torque(there) == pytest.approx(samples, abs=1e-9)


# --- limits --------------------------------------------------------------------------------------

@laws
@given(scales, offsets, st.sampled_from([1.0, -1.0]))
def test_no_command_is_beyond_the_limit(scale, offset, sign):
    some = EffortCalibration(np.array(scale), np.array(offset), LIMIT)
    command = some.command(np.full(3, sign * FAR))
    assert command[:2].tolist() == [sign * 10.0, sign * 40.0]
    assert np.isfinite(command[2])
    within = some.torque_limit()[:2]
    assert some.command(np.append(within, 0.0)) == pytest.approx(
        some.effort(np.append(within, 0.0)))


def test_a_reversed_drive_has_the_limits_of_the_other_direction():
    reverse = drive((-0.7, 1.3, -1.0), (1.0, -2.0, 0.0))
    assert reverse.torque_limit().tolist() == pytest.approx([0.7 * 9.0, 40.0, np.inf])
    assert reverse.command(np.array([7.0, 0.0, 3.0])) == pytest.approx([-9.0, -2.0, -3.0])
    assert reverse.command(np.array([90.0, 0.0, 0.0]))[0] == -10.0


def test_the_limit_of_the_torque():
    assert drive().torque_limit().tolist() == pytest.approx([0.7 * 9.0, 40.0, np.inf])
    assert drive().torque_limit(0.5).tolist() == pytest.approx([0.7 * 4.0, 20.0, np.inf])
    assert drive().torque_limit(0.0).tolist() == [0.0, 0.0, np.inf]
    assert LIMIT.tolist() == [10.0, 40.0, np.inf]  # unchanged
    assert np.isinf(make_effort_calibration(NAMES, [2.0]).limit).all()


# --- parameters ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('scale', 'offset'), [((), ()), ([1.0] * 3, [0.0])])
def test_drives_whose_effort_is_the_torque_cost_nothing(scale, offset):
    assert make_effort_calibration(NAMES, scale, offset, LIMIT) is None


@pytest.mark.parametrize(('scale', 'offset', 'words'), [
    ([1.0, 0.1, 1.0], (),
     r"effort.command_scale of 'joint2' is 0.1, expected a magnitude in \[0.2, 5\]"),
    ([-5.5], (), r"effort.command_scale of 'joint1' is -5.5, expected a magnitude in \[0.2, 5\]"),

    ((), [0.0, -8.5, 0.0],
     r"effort.command_offset of 'joint2' is -8.5, expected a number in \[-8, 8\], 20 % of the "
     'effort limit 40'),
    ((), [3.0], r"effort.command_offset of 'joint1' is 3, expected a number in \[-2, 2\], 20 %"),
])
def test_mismatched_values_are_rejected_by_name(scale, offset, words):
    with pytest.raises(InvalidInputError, match=words):
        make_effort_calibration(NAMES, scale, offset, LIMIT)


def test_the_arm_of_the_parameters_has_drives_and_limits_of_their_torque():
    values = {'joints': ['joint2', 'joint1'], 'effort.command_scale': [0.5, -2.0],
              'effort.command_offset': [4.0, -10.0], 'effort.report_scale': [3.0]}
    arm = arm_from_parameters(default_arm_urdf(), values, ('joint1', 'joint2'))
    assert arm.drive.scale.tolist() == [-2.0, 0.5]
    assert arm.drive.offset.tolist() == [-10.0, 4.0]
    limit = load_arm(default_arm_urdf()).limits.effort
    assert arm.drive.limit.tolist() == limit.tolist()
    assert arm.limits.effort.tolist() == [limit[0], 0.5 * (limit[1] - 4.0)]
    assert arm.with_payloads(()).with_gravity([0.0, 0.0, 0.0]).drive is arm.drive
    assert arm.report.scale.tolist() == [3.0, 3.0]
    assert arm.report.limit.tolist() == limit.tolist()
    only = arm_from_parameters(default_arm_urdf(), {
        'effort.command_scale': [1.0], 'effort.report_scale': [2.0]})
    assert (only.drive, only.limits.effort.tolist()) == (None, limit.tolist())
    assert only.report.scale.tolist() == [2.0, 2.0]


# --- covariance ----------------------------------------------------------------------------------

def covariance_of(deviations: list[float], seed: int = 0) -> np.ndarray:
    """Return a covariance with these deviations and random correlations."""
    k = len(deviations)
    A = np.random.default_rng(seed).normal(size=(k, 2 * k))
    C = A @ A.T
    size = np.array(deviations) / np.sqrt(np.diag(C))
    return np.asarray(C * np.outer(size, size))


def test_the_covariance_of_the_torque_is_that_of_drawn_drives():
    C = covariance_of([1e-3, 2e-3, 1e-3, 0.05, 0.1, 0.02])
    assert not drive().torque_error_covariance().any()
    known = make_effort_calibration(NAMES, [0.7, 1.3, 1.0], [1.0, -2.0, 0.0], LIMIT, C)
    drawn = np.random.default_rng(1).multivariate_normal([*known.scale, *known.offset], C, 20_000)
    effort = np.array([8.0, -20.0, 5.0])
    tau = known.torque(effort)
    errors = drawn[:, :3] * (effort - drawn[:, 3:]) - tau
    slope = np.hstack([np.diag(tau), np.eye(3)])
    expected = slope @ known.torque_error_covariance() @ slope.T
    deviation = np.sqrt(np.diag(expected))
    assert errors.std(axis=0) == pytest.approx(deviation, rel=0.03)
    assert np.corrcoef(errors.T) == pytest.approx(
        expected / np.outer(deviation, deviation), abs=0.03)


def test_the_covariance_of_the_parameters_is_in_the_order_of_the_joints():
    C = covariance_of([0.01, 0.02, 0.1, 0.2])
    values = {'joints': ['joint2', 'joint1'],
              'effort.report_covariance': C[np.tril_indices(4)].tolist()}
    swapped = arm_from_parameters(default_arm_urdf(), values, ('joint1', 'joint2')).report
    assert swapped.covariance == pytest.approx(C[np.ix_([1, 0, 3, 2], [1, 0, 3, 2])])
    single = arm_from_parameters(default_arm_urdf(), values, ('joint1',)).report
    assert single.covariance == pytest.approx(C[np.ix_([1, 3], [1, 3])])


@pytest.mark.parametrize(('covariance', 'words'), [
    ([1.0] * 9, r"effort.report_covariance has 9 values, expected 10: the lower triangle for "
     r"the 4 parameters \['scale\(joint1\)', 'scale\(joint2\)', 'offset\(joint1\)', "),
    ([1.0, 2.0, 1.0, *[0.0] * 7], 'effort.report_covariance has the eigenvalue -1 after scaling'),
])
def test_a_wrong_covariance_is_rejected(covariance, words):
    with pytest.raises(InvalidInputError, match=words):
        arm_from_parameters(default_arm_urdf(), {
            'joints': ['joint1', 'joint2'], 'effort.report_covariance': covariance})
