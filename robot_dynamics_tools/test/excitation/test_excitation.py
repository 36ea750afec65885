# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Exciting motions: at rest at both ends, within every limit, better than random motions."""

import json
import math
import sys

from blas import blas_environments
from builtin_interfaces.msg import Duration
import children
from children import LONG
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import trajectory_from_ros
from robot_dynamics.trajectories.files import read_trajectory, write_trajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics_tools.commands.excite import main
from robot_dynamics_tools.excitation.demo_motion import sample_trajectory
from robot_dynamics_tools.excitation.evolution_strategy import minimize_by_rank
from robot_dynamics_tools.excitation.excitation import ConditionNumber, Excitation, find_excitation
from robot_dynamics_tools.excitation.excitation_limits import motion_limits
from robot_dynamics_tools.excitation.excitation_trajectory import exciting_trajectory
from robot_dynamics_tools.excitation.fourier_series import series_basis
from robots import robot_path, robot_urdf
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

DURATION, HARMONICS = 8.0, 4


# ------------------------------------------------------------------------------ the series

@pytest.mark.parametrize('harmonics', [2, 5])
def test_a_series_is_at_rest_at_both_ends_and_its_derivatives_are_its_own(harmonics):
    times = np.linspace(0.0, DURATION, 4001)
    basis = series_basis(harmonics, DURATION, times)
    assert basis[0].shape == (4001, 2 * harmonics - 2)
    assert np.linalg.matrix_rank(basis[0]) == 2 * harmonics - 2
    for values in basis:
        assert values[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    for values, rates in zip(basis, basis[1:]):
        assert np.gradient(values, times, axis=0)[1:-1] == pytest.approx(rates[1:-1], abs=1e-4)


# ------------------------------------------------------------------------------ the motion

DYNAMICS = ArmDynamics(load_arm(default_arm_urdf()))


@pytest.fixture(scope='module')
def excitation() -> Excitation:
    """Return a motion that is also limited by efforts, as the arm may use few of them."""
    limits = motion_limits(DYNAMICS, velocity_scale=0.5, effort_scale=0.4, acceleration=20.0)
    return find_excitation(DYNAMICS, limits, HARMONICS, DURATION)


def test_no_limit_is_passed_anywhere(excitation):
    """With the interpolation of the node, at ten times as many instants as in the search."""
    found = exciting_trajectory(excitation, DYNAMICS)
    trajectory = found.trajectory
    q, v, a = sample_trajectory(trajectory, np.linspace(0.0, DURATION, 9973))
    limits, arm = excitation.limits, DYNAMICS.arm
    assert (np.abs(q - limits.start) <= math.pi).all()
    assert (np.abs(v).max(axis=0) <= 0.5 * arm.limits.velocity).all()
    assert (np.abs(a).max(axis=0) <= 20.0).all()
    used = np.abs(DYNAMICS.inverse_dynamics_batch(q, v, a)).max(axis=0) / arm.limits.effort
    assert 0.36 < used.max() <= 0.4
    assert found.interpolation_error < 1e-7
    for point in (trajectory.points[0], trajectory.points[-1]):
        assert point.position == pytest.approx(limits.start, abs=1e-12)
        assert not point.velocity.any()
        assert not point.acceleration.any()


def test_it_is_better_than_random_ones(excitation):
    assert len(excitation.random_conditions) == 20
    assert excitation.condition < excitation.random_conditions.min()
    assert excitation.condition < 0.6 * np.median(excitation.random_conditions)


@pytest.mark.parametrize('robot', ['planar', pytest.param('ur10', marks=pytest.mark.soak)])
def test_every_blas_kernel_finds_the_same_trajectory(robot, tmp_path):
    """The search ranks costs, so that rounding has no effect; gradients were sensitive to it."""
    urdf = [] if robot == 'planar' else ['--urdf', str(robot_path(robot)), '--harmonics', '3']
    found = {}
    for name, environment in blas_environments().items():
        file = tmp_path / f'{name}.yaml'
        children.run(
            [sys.executable, '-m', 'robot_dynamics_tools', 'excite', *urdf,
             '--output', str(file)],
            env=environment, check=True, capture_output=True, timeout=LONG)
        points = json.loads(file.read_text(encoding='utf-8'))['points']
        found[name] = np.array([
            point[field] for point in points
            for field in ('positions', 'velocities', 'accelerations')])
    first, *others = found.values()
    assert others
    for other in others:
        assert other == pytest.approx(first, abs=1e-6)


def test_the_ranking_search_finds_the_minimum_of_an_ill_conditioned_quadratic():
    scale = np.logspace(0.0, 2.0, 12)
    goal = np.linspace(-1.0, 1.0, 12)
    found = minimize_by_rank(
        lambda x: float((scale * (x - goal)**2).sum()), np.zeros(12), 0.5, 400,
        np.random.default_rng(2))
    assert found == pytest.approx(goal, abs=1e-6)


def test_the_condition_number_is_that_of_the_base_regressor():
    """For a planar arm with two links the result is known: seven columns, and friction."""
    random = np.random.default_rng(5)
    q, v, a = random.normal(size=(3, 50, 2))
    condition = ConditionNumber(DYNAMICS.arm)
    assert condition.parameter_count == 7 + 6
    values = condition(Reference(q, v, a))
    assert condition(Reference(q, v, a)) == values > 1.0
    # a joint at rest does not excite its rotor inertia and its friction
    v[:, 1] = a[:, 1] = 0.0
    assert condition(Reference(q, v, a)) >= 1e8


def test_rounded_angles_of_a_urdf_excite_no_parameters():
    """The xArm 7 turns its axes by 1.5708, which differs from π/2 by 4e-6."""
    arm = load_arm(robot_urdf('xarm7'))
    q, v, a = np.random.default_rng(0).normal(size=(3, 100, 7))
    assert ConditionNumber(arm)(Reference(q, v, a)) < 1e3


@pytest.mark.parametrize(('settings', 'words'), [
    ({'velocity_scale': 0.0}, 'velocity_scale is 0'),
    ({'effort_scale': 1.5}, 'effort_scale is 1.5'),
    ({'position_margin': 0.5}, 'position_margin is 0.5'),
    ({'acceleration': -1.0}, 'acceleration is -1'),
    ({'effort_scale': 0.1, 'start': np.array([1.5, 0.0])},
     "'joint1' needs .* to hold the arm at the start"),
    ({'start': np.array([math.inf, 0.0])}, r'start\[0\] \(joint1\) is inf'),
    ({'start': np.array([0.0])}, 'start has 1 values, expected 2'),
])
def test_limits_that_make_no_sense_are_refused(settings, words):
    with pytest.raises(InvalidInputError, match=words):
        motion_limits(DYNAMICS, **settings)


def test_a_start_that_leaves_no_room_is_refused():
    arm = load_arm(robot_urdf('ur10'))
    with pytest.raises(InvalidInputError, match="start of 'shoulder_pan_joint' is .* can move"):
        motion_limits(ArmDynamics(arm), arm.limits.upper)


# ------------------------------------------------------------------------------ the file

def test_a_file_is_a_message_and_comes_back(excitation, tmp_path):
    trajectory = exciting_trajectory(excitation, DYNAMICS, lead=2.0).trajectory
    path = tmp_path / 'trajectory.yaml'
    write_trajectory(path, trajectory)
    data = json.loads(path.read_text(encoding='utf-8'))
    message = JointTrajectoryMsg(joint_names=data['joint_names'], points=[
        JointTrajectoryPoint(**{**point, 'time_from_start': Duration(**point['time_from_start'])})
        for point in data['points']])
    names = ('joint2', 'joint1')
    for read in (read_trajectory(path, names), trajectory_from_ros(message, names)):
        assert read.joint_names == names
        assert len(read.points) == 24 * HARMONICS + 1 < 2000
        for back, point in zip(read.points, trajectory.points):
            assert back.time_from_start == pytest.approx(point.time_from_start, abs=1e-9)
            for ours, theirs in zip(
                    (back.position, back.velocity, back.acceleration),
                    (point.position, point.velocity, point.acceleration)):
                assert ours[::-1] == pytest.approx(theirs, abs=1e-9)
    assert read.points[0].time_from_start == 2.0


@pytest.mark.parametrize(('text', 'words'), [
    ('joint_names: [joint1', 'trajectory.yaml: while parsing'),
    ('[]', 'is list, expected a mapping'),
    ('{joint_names: [joint1, joint2]}', 'points is NoneType, expected a list'),
    ('{joint_names: [joint1, joint2], points: [3]}', r'points\[0\] is int, expected a mapping'),
    ('{joint_names: [joint1, joint2], points: [{time_from_start: {sec: x}}]}',
     'expected sec and nanosec'),
    ('{joint_names: [joint1], points: []}', 'lacks'),
])
def test_what_is_no_trajectory_is_refused(tmp_path, text, words):
    path = tmp_path / 'trajectory.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(TrajectoryError, match=words):
        read_trajectory(path, ('joint1', 'joint2'))


# ------------------------------------------------------------------------------ the tool

@pytest.mark.parametrize(('arguments', 'words'), [
    (['--harmonics', '1'], 'harmonics is 1, expected at least 2'),
    (['--harmonics', '51'], 'harmonics is 51, expected at most 50'),
    (['--joints', 'elbow'], "'elbow', expected joints out of"),
    (['--urdf', 'none.urdf'], 'none.urdf'),
    (['--start', '0', 'nan'], 'start'),
])
def test_the_tool_reports_errors(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv('OPENBLAS_NUM_THREADS', '1')
    assert main([*arguments, '--output', str(tmp_path / 'trajectory.yaml')]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert 'Traceback' not in error
    assert not list(tmp_path.iterdir())
