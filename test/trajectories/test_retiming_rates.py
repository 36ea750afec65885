# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Retiming with limits of the rate of the efforts: limits, path and rests of the result."""

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from retimed import distance_from_lines, sampled
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.goal_limits import motion_excesses
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.path import path_of
from robot_dynamics.trajectories.retiming import retime
from robot_dynamics.trajectories.segments import TrajectorySegments
from robots import JOINTS, robot_urdf

ARMS = ('two_link', 'ur10')


def arm_of(name: str) -> ArmModel:
    arm = load_arm(default_arm_urdf() if name == 'two_link' else robot_urdf(name),
                   JOINTS.get(name, ()))
    limit = arm.limits.effort
    return arm.with_reflected_inertia(np.where(np.isfinite(limit), limit / 500.0, 0.01))


def rates_of(arm: ArmModel) -> np.ndarray:
    return np.where(np.isfinite(arm.limits.effort), 7.5 * arm.limits.effort, 750.0)


def random_path(arm: ArmModel, seed: int, count: int = 4) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.limits.lower, -2.0), np.minimum(arm.limits.upper, 2.0)
    middle = 0.5 * (low + high)
    q = np.clip(middle + rng.uniform(-0.8, 0.8, (count, len(middle))), low, high)
    return make_trajectory(arm.joint_names, np.arange(float(count)), q)


@settings(max_examples=4)
@given(name=st.sampled_from(ARMS), seed=st.integers(0, 10**6), share=st.sampled_from((0.5, 1.0)))
def test_the_result_keeps_all_limits(name, seed, share):
    arm = arm_of(name)
    dynamics, path, rates = ArmDynamics(arm), random_path(arm, seed), rates_of(arm)
    gravity = np.abs(dynamics.gravity_batch([point.position for point in path.points]))
    assume((gravity < 0.9 * share * arm.limits.effort).all())
    result = retime(
        dynamics, path, corner_tolerance=0.05, effort_limit_fraction=share,
        effort_rate_limits=rates)
    assert efforts_along(dynamics, result.trajectory).worst_ratio <= share * 1.005
    assert not [one for one in motion_excesses(arm, result.trajectory) if 'velocity' in one]
    tau = dynamics.unchecked.rigid_body.inverse_dynamics_batch(*sampled(result.trajectory, 5))
    segments = TrajectorySegments(result.trajectory)
    t = segments.time(np.repeat(np.arange(segments.count), 5), np.tile(
        np.linspace(0.0, 1.0, 5), segments.count))
    new = np.diff(t) > 1e-9
    steps = np.abs(np.diff(tau, axis=0))[new] / np.diff(t)[new][:, None]
    assert (steps <= 1.02 * rates).all()


@pytest.mark.parametrize('name', ARMS)
def test_the_arm_stays_on_the_path_and_rests_at_its_ends(name):
    arm = arm_of(name)
    path = random_path(arm, 5)
    result = retime(
        ArmDynamics(arm), path, corner_tolerance=0.05, effort_rate_limits=rates_of(arm)).trajectory
    rounded, phases = path_of(path, 0.05), np.linspace(0.0, 1.0, 4001)
    k = len(rounded.coefficients)
    samples = rounded.sample(np.repeat(np.arange(k), len(phases)), np.tile(phases, k))[0]
    assert distance_from_lines(samples, sampled(result, 4)[0]) < 1e-5
    first, last = result.points[0], result.points[-1]
    assert first.position == pytest.approx(path.points[0].position, abs=1e-12)
    assert last.position == pytest.approx(path.points[-1].position, abs=1e-12)
    for point in (first, last):
        assert not point.velocity.any()
        assert not point.acceleration.any()


def test_rests_of_the_request_remain_rests():
    arm = arm_of('two_link')
    zero = [[0.0, 0.0]] * 3
    points = [[0.0, 0.0], [0.6, -0.4], [0.1, 0.8]]
    path = make_trajectory(arm.joint_names, [0.0, 1.0, 2.0], points, zero, zero)
    result = retime(ArmDynamics(arm), path, effort_rate_limits=rates_of(arm)).trajectory
    nearest = min(result.points, key=lambda point: np.abs(point.position - points[1]).max())
    assert nearest.position == pytest.approx(np.array(points[1]), abs=1e-9)
    assert nearest.velocity == pytest.approx(0.0, abs=1e-9)
